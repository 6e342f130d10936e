// The clock and its controls; `window.replay` is the same for scripts.

const SPEEDS = [0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1, 2, 5];

class Player {
  constructor(data, parts) {
    Object.assign(this, { data, ...parts });
    [this.start, this.end] = this.plots.range.full;
    this.time = this.start;
    this.speed = 1;
    this.playing = false;
    this.com_at_start = this.bodies[0].com.clone();
    this.build_controls();
    this.stage.viewer.controls.addEventListener("change", () => { this.dirty = true; });
    this.seek(this.start);
    let before = performance.now();
    const tick = (now) => {
      this.advance(Math.min((now - before) / 1000, 0.25));
      before = now;
      this.refresh();
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  advance(seconds) {
    if (!this.playing) return;
    let time = this.time + seconds * this.speed;
    if (time >= this.end) {
      if (document.getElementById("loop").checked) time = this.start; else { time = this.end; this.play(false); }
    }
    this.seek(time);
  }

  seek(time) {
    this.time = Math.min(Math.max(time, this.start), this.end);
    for (const part of [...this.bodies, ...this.arrows, this.plots, this.events]) part.set_time(this.time);
    this.stage.follow(this.bodies[0].com.clone().sub(this.com_at_start));
    this.dirty = true;
  }

  refresh() {
    this.stage.viewer.controls.update();
    if (!this.dirty && !this.stage.viewer.needs_render) return;
    this.dirty = false;
    this.stage.render();
    this.legend.update();
    this.draw_scrub();
    const digits = this.end - this.start < 1 ? 4 : 3;
    document.getElementById("clock").textContent = `${this.time.toFixed(digits)} / ${this.end.toFixed(digits)} s`;
  }

  play(on = true) {
    if (on && this.time >= this.end) this.seek(this.start);
    this.playing = on;
    document.getElementById("play").innerHTML = on
      ? '<svg width="14" height="14"><path d="M2 1h3.5v12H2zM8.5 1H12v12H8.5z" fill="currentColor"/></svg>'
      : '<svg width="14" height="14"><path d="M2 .5L13 7L2 13.5Z" fill="currentColor"/></svg>';
  }

  // The next or previous drawn step of the first run.
  step(direction) {
    this.play(false);
    const { t } = this.bodies[0].run;
    const i = index_before(t, this.time + 1e-9);
    this.seek(t[Math.min(Math.max(i + direction, 0), t.length - 1)]);
  }

  build_controls() {
    const button = document.getElementById("play");
    button.addEventListener("click", () => this.play(!this.playing));
    this.play(false);
    const speed = document.getElementById("speed");
    speed.append(...SPEEDS.map((value) => make("option", { value, textContent: `${value}\u00d7`, selected: value === 1 })));
    speed.addEventListener("change", () => { this.speed = Number(speed.value); });
    document.getElementById("fold").addEventListener("click", () => document.body.classList.toggle("folded"));
    for (const view of document.querySelectorAll("#views button")) {
      view.addEventListener("click", () => this.stage.look(view.dataset.view));
    }
    const scrub = document.getElementById("scrub");
    const to = (event) => {
      const box = scrub.getBoundingClientRect();
      this.seek(this.start + Math.min(Math.max((event.clientX - box.left - 8) / (box.width - 16), 0), 1) * (this.end - this.start));
    };
    scrub.addEventListener("pointerdown", (event) => { scrub.setPointerCapture(event.pointerId); to(event); });
    scrub.addEventListener("pointermove", (event) => { if (event.buttons & 1) to(event); });
    new ResizeObserver(() => { this.dirty = true; }).observe(scrub);
    window.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    if (event.target.matches("input, select, summary") || event.ctrlKey || event.metaKey || event.altKey) return;
    const actions = {
      " ": () => this.play(!this.playing), ArrowRight: () => this.step(1), ArrowLeft: () => this.step(-1),
      Home: () => this.seek(this.start), End: () => this.seek(this.end),
    };
    if (!(event.key in actions)) return;
    event.preventDefault();
    if (document.activeElement) document.activeElement.blur();
    actions[event.key]();
  }

  draw_scrub() {
    const canvas = document.querySelector("#scrub canvas");
    const width = canvas.clientWidth, height = canvas.clientHeight, ratio = window.devicePixelRatio || 1;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const pen = canvas.getContext("2d"), middle = height / 2;
    pen.scale(ratio, ratio);
    const x = (t) => 8 + ((t - this.start) / (this.end - this.start)) * (width - 16);
    pen.fillStyle = "#dfe5ea";
    pen.fillRect(8, middle - 2.5, width - 16, 5);
    pen.fillStyle = color_of("accent");
    pen.fillRect(8, middle - 2.5, x(this.time) - 8, 5);
    pen.globalAlpha = 0.75;
    for (const { t, kind } of this.events.events.slice(0, MAX_EVENT_ROWS)) {
      pen.fillStyle = color_of(EVENT_COLORS[kind] || "soft");
      pen.fillRect(x(t) - 0.75, 3, 1.5, 7);
    }
    pen.globalAlpha = 1;
    pen.fillStyle = color_of("accent");
    pen.beginPath();
    pen.arc(x(this.time), middle, 7, 0, 2 * Math.PI);
    pen.fill();
  }
}

async function main() {
  const [data, shapes] = await Promise.all(["payload", "shapes"].map(read_payload));
  data.runs.forEach((run, number) => { run.objects = shapes.runs[number]; });
  build_tabs();
  const stage = new Stage(document.getElementById("pane"), data);
  const bodies = data.runs.map((run, number) => new Bodies(stage, run, number));
  await Promise.all(bodies.map(({ ready }) => ready));
  for (const body of bodies) body.set_time(body.run.t[0]);
  const arrows = data.runs.map((run, number) => new Arrows(stage, run, number));
  stage.add_planes(data.planes, bodies);
  let player = null;
  const seek = (time) => { player.play(false); player.seek(time); };
  const plots = new Plots(document.getElementById("tab-plots"), data, seek);
  const events = new EventList(document.getElementById("tab-events"), data, seek);
  build_audit(document.getElementById("tab-audit"), data);
  const legend = new Legend(stage, arrows);
  player = new Player(data, { stage, bodies, arrows, plots, events, legend });
  const redraw = (change) => (on) => { change(on); player.seek(player.time); };
  build_runs(data, redraw_run(player));
  const scale = (value) => arrows.forEach((a) => { a.scale = value; });
  build_switches(redraw(scale), [
    { id: "forces", text: "forces", checked: true, change: redraw((on) => arrows.forEach(({ root }) => { root.visible = on; })) },
    { id: "cones", text: "friction cones", checked: false, change: redraw((on) => arrows.forEach((a) => { a.cones_visible = on; })) },
    { id: "trace", text: "centre of mass", checked: false, change: redraw((on) => bodies.forEach(({ trace }) => { trace.visible = on; })) },
    { id: "frames", text: "frames", checked: false, change: redraw((on) => bodies.forEach((body) => body.show_axes(on))) },
    { id: "follow", text: "follow", checked: data.follow, change: redraw((on) => stage.set_follow(on)) },
  ]);
  window.replay = {
    start: player.start, end: player.end, play: () => player.play(), pause: () => player.play(false),
    time: () => player.time, set_time: (time) => { seek(time); player.refresh(); },
    forces: () => arrows.map(({ carrying }) => carrying), viewer: stage.viewer,
  };
  if (!location.hash.includes("paused")) player.play();
}

function redraw_run(player) {
  return (number, visible) => {
    player.bodies[number].root.visible = player.arrows[number].root.visible = visible;
    player.plots.hide_run(number, !visible);
    player.seek(player.time);
  };
}

main().catch((error) => {
  const message = document.getElementById("message");
  message.hidden = false;
  message.textContent = `This replay cannot be shown here: ${error.message}`;
  throw error;
});

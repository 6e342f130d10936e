// What stands around the picture: tabs, events, audit, legend, what to show.

const EVENT_COLORS = { impact: "impact", "lift-off": "soft", slip: "slip", stick: "stick", closed: "normal" };
const MAX_EVENT_ROWS = 2000;

function build_tabs() {
  const tabs = document.getElementById("tabs");
  for (const name of ["plots", "events", "audit"]) {
    const button = make("button", { textContent: name, id: `show-${name}` });
    button.addEventListener("click", () => {
      for (const other of tabs.children) {
        other.classList.toggle("on", other === button);
        document.getElementById(other.id.replace("show", "tab")).hidden = other !== button;
      }
    });
    tabs.append(button);
  }
  tabs.firstChild.classList.add("on");
}

class EventList {
  constructor(parent, data, on_seek) {
    this.parent = parent;
    this.on_seek = on_seek;
    this.many = data.runs.length > 1;
    this.events = data.runs.flatMap((run) => run.events.map(([t, kind, name, impulse]) => ({ t, kind, name, impulse, run: run.label })));
    this.events.sort((a, b) => a.t - b.t);
    this.off = new Set();
    document.getElementById("show-events").textContent = `events (${this.events.length})`;
    this.build();
  }

  build() {
    const count = {};
    for (const { kind } of this.events) count[kind] = (count[kind] || 0) + 1;
    const kinds = Object.keys(count).map((kind) => {
      const button = make("button", { textContent: `${kind} ${count[kind]}`, className: this.off.has(kind) ? "" : "on" });
      button.addEventListener("click", () => { if (!this.off.delete(kind)) this.off.add(kind); this.build(); });
      return button;
    });
    const wanted = this.events.filter(({ kind }) => !this.off.has(kind));
    this.rows = wanted.slice(0, MAX_EVENT_ROWS).map((event) => ({ t: event.t, row: this.row(event) }));
    const titles = ["t [s]", "event", "between", "impulse [N s]"].map((text, n) => make("th", { textContent: text, className: n % 3 ? "" : "number" }));
    const table = make("table", {}, [make("thead", {}, [make("tr", {}, titles)]), make("tbody", {}, this.rows.map(({ row }) => row))]);
    const rest = wanted.length - this.rows.length;
    const note = rest > 0 ? `${rest} later events are not listed` : wanted.length ? "" : "no events";
    this.parent.replaceChildren(make("div", { className: "kinds" }, kinds), table, make("div", { className: "note", textContent: note }));
  }

  row({ t, kind, name, impulse, run }) {
    const dot = make("span", { className: "dot" });
    dot.style.background = color_of(EVENT_COLORS[kind] || "soft");
    const row = make("tr", { title: "Go to this moment" }, [
      make("td", { className: "number", textContent: t.toFixed(4) }),
      make("td", { className: "kind" }, [dot, kind]),
      make("td", { textContent: this.many ? `${name} \u00b7 ${run}` : name }),
      make("td", { className: "number", textContent: impulse ? readable(impulse) : "" }),
    ]);
    row.addEventListener("click", () => this.on_seek(t));
    return row;
  }

  set_time(time) {
    let now = -1;
    while (now + 1 < this.rows.length && this.rows[now + 1].t <= time + 1e-9) now++;
    if (now === this.now) return;
    if (this.rows[this.now]) this.rows[this.now].row.classList.remove("now");
    if (this.rows[now]) this.rows[now].row.classList.add("now");
    this.now = now;
  }
}

function build_audit(parent, data) {
  for (const run of data.runs) {
    if (data.runs.length > 1) parent.lastElementChild.before(make("h3", { textContent: run.label }));
    if (!run.success) parent.lastElementChild.before(make("p", { className: "fail", textContent: run.message || "the run stopped early" }));
    const rows = run.audit.map(([name, value, unit, ok]) => make("tr", {}, [
      make("td", { className: `mark ${ok === null ? "" : ok ? "pass" : "fail"}`, textContent: ok === null ? "" : ok ? "\u2713" : "\u2717" }),
      make("td", { textContent: name }),
      make("td", { className: "number", textContent: value.replace(/^-(?=\d)|(?<=\de)-/g, "\u2212") }),
      make("td", { textContent: unit }),
    ]));
    parent.lastElementChild.before(make("table", {}, [make("tbody", {}, rows)]));
  }
  const failed = data.runs.some((run) => run.audit.some((row) => row[3] === false));
  if (failed) document.getElementById("show-audit").classList.add("fail");
}

// Which runs are visible, by name and colour.
function build_runs(data, on_toggle) {
  const parent = document.getElementById("runs");
  data.runs.forEach((run, number) => {
    const failure = run.message || "the run stopped early";
    if (!run.success) parent.append(make("div", { className: "failed", textContent: failure, title: failure }));
    if (data.runs.length < 2) {
      parent.prepend(make("div", { className: "about", textContent: run.note, title: run.method }));
      return;
    }
    const box = make("input", { type: "checkbox", checked: true });
    box.addEventListener("change", () => on_toggle(number, box.checked));
    const swatch = make("span", { className: "swatch" });
    swatch.style.background = run.tint ? `rgb(${run.tint.slice(0, 3).map((c) => 255 * c)})` : "#8b97a3";
    parent.append(make("label", { title: `${run.note}\n${run.method}` }, [box, swatch, run.label]));
  });
}

function build_switches(scale_arrows, options) {
  const parent = document.getElementById("show");
  const scale = make("input", { type: "range", id: "scale", min: -1.5, max: 1.5, step: 0.05, value: 0, title: "Length of the arrows" });
  scale.addEventListener("input", () => scale_arrows(10 ** scale.value));
  for (const { id, text, checked, change } of options) {
    const box = make("input", { type: "checkbox", checked, id });
    box.addEventListener("change", () => change(box.checked));
    parent.append(make("label", {}, [box, text]));
    if (id === "forces") parent.append(scale);
  }
}

class Legend {
  constructor(stage, arrows) {
    Object.assign(this, { stage, arrows });
    const states = new Set(arrows.flatMap(({ run }) => [...new Set(run.contacts.state)]));
    const rows = [];
    if (states.has(1) || states.has(2) || states.has(3)) rows.push(["normal", "normal force", "arrow"]);
    if (states.has(2)) rows.push(["stick", "friction, sticking", "arrow"]);
    if (states.has(3)) rows.push(["slip", "friction, slipping", "arrow"]);
    if (arrows.some(({ impacts }) => impacts.length)) {
      const strongest = Math.max(...arrows.flatMap(({ impacts }) => impacts.map((event) => event[2])));
      rows.push(["impact", `impact, at most ${readable(strongest)} N s`, "ring"]);
    }
    this.bars = ["N", "m"].filter((unit) => unit === "m" || rows.length).map((unit) => {
      const bar = make("div", { className: "bar" }), text = make("span");
      return { unit, bar, text, row: make("div", { className: "row" }, [bar, text]) };
    });
    const parent = document.getElementById("legend");
    parent.append(...rows.map(([color, text, kind]) => make("div", { className: "row", innerHTML: legend_sign(color, kind) }, [text])));
    parent.append(...this.bars.map(({ row }) => row));
  }

  // Bars of about 80 pixels, as on a map, true at the point the camera looks at.
  update() {
    const pixels = this.stage.pixels_per_metre();
    for (const { unit, bar, text } of this.bars) {
      const per_unit = unit === "m" ? pixels : pixels * this.stage.data.metres_per_newton * this.arrows[0].scale;
      const wanted = 90 / per_unit, power = 10 ** Math.floor(Math.log10(wanted));
      const value = [5, 2, 1].map((m) => m * power).find((v) => v <= wanted * 1.0001) || power;
      bar.style.width = `${(value * per_unit).toFixed(1)}px`;
      text.textContent = `${Number(value.toPrecision(1))} ${unit}`;
    }
  }
}

function legend_sign(name, kind) {
  const color = color_of(name);
  if (kind === "ring") {
    return `<svg width="26" height="12"><ellipse cx="13" cy="6" rx="9" ry="4.5" fill="none" stroke="${color}" stroke-width="2"/></svg>`;
  }
  return `<svg width="26" height="12"><path d="M1 6H18" stroke="${color}" stroke-width="2.5"/><path d="M16 1.5L25 6L16 10.5Z" fill="${color}"/></svg>`;
}

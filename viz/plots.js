// The column of plots: one fold per panel, a legend with the values at the cursor, one shared time axis.

const MOST_CURVES = 8;  // that a panel begins with: those that vary most

const FOLDED = ["position", "rate", "speed", "iterations", "impulse", "limit", "constraint", "axial", "bending", "joint friction"];

class Plots {
  constructor(parent, data, on_seek) {
    const full = [Math.min(...data.runs.map((run) => run.t[0])), Math.max(...data.runs.map((run) => run.t[run.t.length - 1]))];
    if (full[1] <= full[0]) full[1] = full[0] + 1;
    this.range = { low: full[0], high: full[1], full };
    this.runs = data.runs;
    this.plots = [];
    for (const panel of data.panels) this.add(parent, panel, on_seek);
    parent.append(make("div", { className: "note", textContent: "drag: time \u00b7 shift + wheel: zoom \u00b7 double click: whole run \u00b7 shift + click on a name: only this one" }));
    new ResizeObserver(() => this.draw()).observe(parent);
  }

  add(parent, panel, on_seek) {
    for (const curve of panel.curves) curve.size = curve.line[1].reduce((most, y) => Math.max(most, Math.abs(y)), 1e-3);
    const labels = [...new Set(panel.curves.map((curve) => curve.label))];
    const hidden = panel.curves.some((curve) => curve.group) ? [] : calm(panel.curves, labels);
    const color = (curve) => CURVE_COLORS[labels.indexOf(curve.label) % CURVE_COLORS.length];
    const plot = new Plot(panel, this.range, color, on_seek, (low, high) => this.zoom(low, high));
    hidden.forEach((label) => plot.off.add(label));
    const keys = make("div", { className: "keys" });
    const summary = make("summary", {}, [panel.title, make("span", { className: "unit", textContent: panel.unit && `[${panel.unit}]` })]);
    const fold = make("details", { className: "plot", open: !FOLDED.includes(panel.key) }, [summary, plot.canvas, keys]);
    const groups = [...new Set(panel.curves.map((curve) => curve.group).filter((name) => name))];
    if (groups.length) {
      const choice = make("select", { title: "Of which pair or constraint" }, groups.map((name) => make("option", { textContent: name })));
      choice.addEventListener("click", (event) => event.stopPropagation());
      choice.addEventListener("change", () => { plot.group = choice.value; this.list_keys(plot); plot.draw(); });
      summary.append(choice);
      const size = (name) => Math.max(...panel.curves.filter((curve) => curve.group === name).map((curve) => curve.size));
      plot.group = groups.reduce((a, b) => (size(b) > size(a) ? b : a));
      choice.value = plot.group;
    }
    fold.addEventListener("toggle", () => plot.draw());
    parent.append(fold);
    Object.assign(plot, { keys, fold });
    this.plots.push(plot);
    this.list_keys(plot);
  }

  list_keys(plot) {
    plot.entries = [];
    plot.keys.replaceChildren();
    for (const curve of plot.panel.curves) {
      if (curve.group && curve.group !== plot.group) continue;
      const value = make("b");
      const mark = make("i", { className: curve.run ? "dashed" : "" });
      mark.style.borderTopColor = plot.color(curve);
      const name = this.runs.length > 1 ? `${curve.label} \u00b7 ${this.runs[curve.run].label}` : curve.label;
      const entry = make("span", { title: "Show or hide; with shift: only this one" }, [mark, `${name} `, value]);
      entry.classList.toggle("off", plot.off.has(curve.label));
      entry.addEventListener("click", (event) => {
        if (event.shiftKey) plot.off = this.all_but(plot, curve.label);
        else if (!plot.off.delete(curve.label)) plot.off.add(curve.label);
        this.list_keys(plot);
        plot.draw();
      });
      plot.keys.append(entry);
      plot.entries.push({ curve, value });
    }
    this.write_values(plot);
  }

  // Labels to hide so that one remains, or none if it remains alone already.
  all_but(plot, label) {
    const others = new Set(plot.panel.curves.map((curve) => curve.label).filter((other) => other !== label));
    const alone = !plot.off.has(label) && [...others].every((other) => plot.off.has(other));
    return alone ? new Set() : others;
  }

  write_values(plot) {
    for (const { curve, value } of plot.entries) {
      const number = value_at(curve.line, plot.time);
      value.textContent = Math.abs(number) < 1e-9 * curve.size ? "0" : readable(number);
    }
  }

  hide_run(number, hidden) {
    for (const plot of this.plots) {
      if (hidden) plot.hidden_runs.add(number); else plot.hidden_runs.delete(number);
    }
    this.draw();
  }

  zoom(low, high) {
    Object.assign(this.range, { low, high });
    this.draw();
  }

  draw() {
    for (const plot of this.plots) if (plot.fold.open) plot.draw();
  }

  set_time(time) {
    for (const plot of this.plots) {
      plot.time = time;
      if (!plot.fold.open) continue;
      plot.draw_cursor();
      this.write_values(plot);
    }
  }
}

// Labels of the curves that vary least, where there are more than a panel begins with.
function calm(curves, labels) {
  const span = Object.fromEntries(labels.map((label) => [label, 0]));
  for (const { label, line } of curves) {
    let low = Infinity, high = -Infinity;
    for (const y of line[1]) if (Number.isFinite(y)) { low = Math.min(low, y); high = Math.max(high, y); }
    if (high > low) span[label] = Math.max(span[label], high - low);
  }
  return [...labels].sort((a, b) => span[b] - span[a]).slice(MOST_CURVES);
}

// One set of axes over time: curves, a cursor at the time of the replay, zoom by wheel.

const CURVE_COLORS = ["#1f6fb2", "#e0541b", "#1d9a5b", "#a3389c", "#c79a00", "#4b3fb0", "#00889b", "#b02a4c", "#6b7a2a",
  "#7a4d24", "#5c6b7a", "#d05c90", "#2c8f8f", "#8a6fd0", "#b8860b", "#3a5f8a"];
const MARGIN = { left: 58, right: 10, top: 8, bottom: 20 };

class Plot {
  // `range` is shared by all plots: { low, high, full: [low, high] }, in seconds.
  constructor(panel, range, colors, on_seek, on_zoom) {
    Object.assign(this, { panel, range, on_seek, on_zoom });
    this.canvas = make("canvas");
    this.off = new Set();
    this.hidden_runs = new Set();
    this.group = "";
    this.color = colors;
    this.time = range.low;
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      this.on_seek(this.time_at(event));
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) this.on_seek(this.time_at(event));
    });
    this.canvas.addEventListener("dblclick", () => this.on_zoom(...range.full));
    this.canvas.addEventListener("wheel", (event) => this.zoom(event), { passive: false });
  }

  zoom(event) {
    if (!(event.shiftKey || event.ctrlKey)) return;  // the wheel alone scrolls the column of plots
    event.preventDefault();
    const { low, high, full } = this.range, at = this.time_at(event);
    const factor = Math.exp(Math.sign(event.deltaY || event.deltaX) * 0.25);
    const width = Math.min(Math.max((high - low) * factor, (full[1] - full[0]) * 1e-4), full[1] - full[0]);
    const start = Math.min(Math.max(at - ((at - low) / (high - low)) * width, full[0]), full[1] - width);
    this.on_zoom(start, start + width);
  }

  time_at(event) {
    const box = this.canvas.getBoundingClientRect();
    const share = (event.clientX - box.left - MARGIN.left) / (box.width - MARGIN.left - MARGIN.right);
    return this.range.low + Math.min(Math.max(share, 0), 1) * (this.range.high - this.range.low);
  }

  shown() {
    const chosen = (curve) => !curve.group || curve.group === this.group;
    return this.panel.curves.filter((curve) => chosen(curve) && !this.off.has(curve.label) && !this.hidden_runs.has(curve.run));
  }

  // Lowest and highest value between the ends of the time axis, with a margin.
  limits(curves) {
    let low = Infinity, high = -Infinity;
    const take = ([t, y], sign = 1) => {
      const a = index_before(t, this.range.low), b = Math.min(index_before(t, this.range.high) + 1, t.length - 1);
      for (let n = a; n <= b; n++) {
        if (!Number.isFinite(y[n])) continue;
        if (sign * y[n] < low) low = sign * y[n];
        if (sign * y[n] > high) high = sign * y[n];
      }
    };
    for (const curve of curves) {
      take(curve.line);
      if (curve.bound) { take(curve.bound); take(curve.bound, -1); }
    }
    const size = Math.max(Math.abs(low), Math.abs(high));
    if (!(low <= high) || size < 1e-12) return [-1, 1];
    const span = Math.max(high - low, 1e-6 * size);
    return [low - 0.06 * span, high + 0.06 * span];
  }

  draw() {
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (!width) return;
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const pen = this.canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const curves = this.shown(), [bottom, top] = this.limits(curves);
    const inner = { w: width - MARGIN.left - MARGIN.right, h: height - MARGIN.top - MARGIN.bottom };
    this.x = (t) => MARGIN.left + ((t - this.range.low) / (this.range.high - this.range.low)) * inner.w;
    this.y = (v) => MARGIN.top + ((top - v) / (top - bottom)) * inner.h;
    this.draw_axes(pen, width, height, bottom, top);
    pen.save();
    pen.beginPath();
    pen.rect(MARGIN.left, 0, inner.w, height - MARGIN.bottom);
    pen.clip();
    for (const curve of curves) if (curve.bound) this.draw_band(pen, curve.bound);
    for (const curve of curves) this.draw_line(pen, curve);
    pen.restore();
    this.picture = pen.getImageData(0, 0, this.canvas.width, this.canvas.height);
    this.draw_cursor();
  }

  draw_axes(pen, width, height, bottom, top) {
    pen.font = `11px ${getComputedStyle(document.body).fontFamily}`;
    pen.fillStyle = color_of("soft");
    pen.lineWidth = 1;
    pen.textBaseline = "middle";
    pen.textAlign = "right";
    const values = ticks(bottom, top, 4);
    for (const v of values) {
      const y = Math.round(this.y(v)) + 0.5;
      pen.strokeStyle = Math.abs(v) < 1e-9 * (top - bottom) ? "#aab4be" : "#e8ecf0";
      line(pen, MARGIN.left, y, width - MARGIN.right, y);
      pen.fillText(number_text(v, values), MARGIN.left - 6, y);
    }
    pen.textAlign = "center";
    pen.textBaseline = "top";
    const times = ticks(this.range.low, this.range.high, Math.max(2, Math.floor(width / 90)));
    for (const t of times) {
      const x = Math.round(this.x(t)) + 0.5;
      pen.strokeStyle = "#f0f3f6";
      line(pen, x, MARGIN.top, x, height - MARGIN.bottom);
      const last = x > width - MARGIN.right - 24;
      pen.fillText(last ? "t [s]" : number_text(t, times), last ? width - 22 : x, height - MARGIN.bottom + 5);
    }
    pen.strokeStyle = "#c4ccd4";
    pen.strokeRect(MARGIN.left + 0.5, MARGIN.top + 0.5, width - MARGIN.left - MARGIN.right - 1, height - MARGIN.top - MARGIN.bottom - 1);
  }

  draw_line(pen, curve) {
    const [t, y] = curve.line;
    const a = Math.max(index_before(t, this.range.low) - 1, 0);
    const b = Math.min(index_before(t, this.range.high) + 2, t.length - 1);
    pen.beginPath();
    for (let n = a; n <= b; n++) pen.lineTo(this.x(t[n]), this.y(y[n]));
    pen.strokeStyle = this.color(curve);
    pen.setLineDash(curve.run ? [5, 3] : []);
    pen.lineWidth = 1.4;
    pen.lineJoin = "round";
    pen.stroke();
    pen.setLineDash([]);
  }

  draw_band(pen, [t, y]) {
    pen.beginPath();
    for (let n = 0; n < t.length; n++) pen.lineTo(this.x(t[n]), this.y(y[n]));
    for (let n = t.length - 1; n >= 0; n--) pen.lineTo(this.x(t[n]), this.y(-y[n]));
    pen.closePath();
    pen.fillStyle = "rgba(90, 110, 130, .14)";
    pen.fill();
    pen.strokeStyle = "rgba(90, 110, 130, .35)";
    pen.lineWidth = 0.8;
    pen.stroke();
  }

  draw_cursor() {
    if (!this.picture) return;
    const pen = this.canvas.getContext("2d");
    pen.putImageData(this.picture, 0, 0);
    if (this.time < this.range.low || this.time > this.range.high) return;
    const x = this.x(this.time);
    pen.strokeStyle = "rgba(29, 39, 51, .75)";
    pen.lineWidth = 1;
    line(pen, x, MARGIN.top, x, this.canvas.clientHeight - MARGIN.bottom);
    for (const curve of this.shown()) {
      pen.fillStyle = this.color(curve);
      pen.beginPath();
      pen.arc(x, this.y(value_at(curve.line, this.time)), 2.6, 0, 2 * Math.PI);
      pen.fill();
    }
  }
}

function line(pen, x0, y0, x1, y1) {
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
}

function value_at([t, y], time) {
  const [i, k, s] = neighbours(t, time);
  return s > 0 ? (1 - s) * y[i] + s * y[k] : y[i];
}

// About n round numbers between two ends.
function ticks(low, high, n) {
  const raw = (high - low) / n, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(k * step);
  return found;
}

// Text of a tick with as many digits as its neighbours need.
function number_text(value, neighbours) {
  const step = neighbours.length > 1 ? neighbours[1] - neighbours[0] : Math.abs(value) || 1;
  const size = Math.max(...neighbours.map(Math.abs));
  if (size >= 1e5 || (size > 0 && size < 1e-3)) return value === 0 ? "0" : value.toExponential(1).replace("-", "\u2212");
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return value.toFixed(Math.min(digits, 8)).replace("-", "\u2212");
}

function readable(value) {
  if (!Number.isFinite(value)) return "\u2013";
  const size = Math.abs(value);
  const text = size !== 0 && (size < 1e-3 || size >= 1e5) ? value.toExponential(2) : value.toPrecision(4);
  return text.replace("-", "\u2212");
}

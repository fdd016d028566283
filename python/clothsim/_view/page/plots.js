// Small plots over time beside the picture: energy, contacts, time per frame. A click goes to that frame.

class Plot {
  constructor(holder, spec, times, onPick) {
    this.spec = spec;
    this.times = times;
    this.figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    caption.textContent = spec.title;
    const unit = document.createElement("span");
    unit.textContent = spec.unit;
    caption.append(unit);
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", this.summary());
    this.key = document.createElement("ul");
    this.readings = spec.series.map((series) => {
      const item = document.createElement("li");
      const swatch = document.createElement("i");
      swatch.style.background = series.colour;
      const reading = document.createElement("b");
      item.append(swatch, series.label, reading);
      this.key.append(item);
      return reading;
    });
    this.figure.append(caption, this.canvas, this.key);
    holder.append(this.figure);
    const pick = (event) => {
      const box = this.canvas.getBoundingClientRect();
      const share = (event.clientX - box.left - this.margin) / (box.width - 2 * this.margin);
      onPick(Math.max(0, Math.min(1, share)));
    };
    this.margin = 2;
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      pick(event);
    });
    this.canvas.addEventListener("pointermove", (event) => event.buttons && pick(event));
  }

  summary() {
    const { title, unit, series } = this.spec;
    const ends = series.map((s) => `${s.label} from ${short(s.values[0])} to ${short(s.values[s.values.length - 1])}`);
    return `${title} [${unit}] over time: ${ends.join(", ")}`;
  }

  // The curves; drawn when size or theme change, kept as a picture under the cursor.
  prepare(theme) {
    const ratio = window.devicePixelRatio || 1;
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (!width || !height) return;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.backdrop = document.createElement("canvas");
    this.backdrop.width = this.canvas.width;
    this.backdrop.height = this.canvas.height;
    const c = this.backdrop.getContext("2d");
    c.scale(ratio, ratio);
    const all = this.spec.series.flatMap((s) => s.values);
    let low = Math.min(0, ...extent(all)), high = Math.max(...extent(all));
    if (!(high > low)) high = low + 1;
    const from = this.times[0], span = this.times[this.times.length - 1] - from || 1;
    const x = (t) => this.margin + ((t - from) / span) * (width - 2 * this.margin);
    const y = (v) => 4 + (1 - (v - low) / (high - low)) * (height - 8);
    this.x = x;
    c.lineWidth = 1;
    c.strokeStyle = theme.line;
    c.fillStyle = theme.faint;
    c.font = "10px system-ui, sans-serif";
    for (const v of [low, 0, high]) {
      c.beginPath();
      c.moveTo(0, Math.round(y(v)) + 0.5);
      c.lineTo(width, Math.round(y(v)) + 0.5);
      c.stroke();
    }
    c.textAlign = "right";
    c.fillText(short(high), width - 3, y(high) + 11);
    if (low < 0) c.fillText(short(low), width - 3, y(low) - 3);
    for (const series of this.spec.series) {
      c.strokeStyle = series.colour === "ink" ? theme.ink : series.colour;
      c.lineWidth = 1.6;
      c.lineJoin = "round";
      c.beginPath();
      series.values.forEach((v, k) => (k ? c.lineTo(x(this.times[k]), y(v)) : c.moveTo(x(this.times[k]), y(v))));
      c.stroke();
    }
    this.figure.querySelectorAll("i").forEach((swatch, k) => {
      const colour = this.spec.series[k].colour;
      swatch.style.background = colour === "ink" ? theme.ink : colour;
    });
  }

  draw(time, frame, theme) {
    if (!this.backdrop) return;
    const c = this.canvas.getContext("2d");
    const ratio = window.devicePixelRatio || 1;
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, this.canvas.width, this.canvas.height);
    c.drawImage(this.backdrop, 0, 0);
    c.scale(ratio, ratio);
    c.fillStyle = theme.accent;
    c.fillRect(this.x(time) - 0.75, 0, 1.5, this.canvas.clientHeight);
    this.readings.forEach((b, k) => (b.textContent = short(this.spec.series[k].values[frame])));
  }
}

function extent(values) {
  let low = Infinity, high = -Infinity;
  for (const v of values) {
    if (v < low) low = v;
    if (v > high) high = v;
  }
  return [low, high];
}

// Three significant digits.
function short(value) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-3) return value.toExponential(1).replace("e+", "e");
  return String(Number(value.toPrecision(3)));
}

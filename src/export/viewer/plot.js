// One curve with its axes, as SVG.

const SPACE = { left: 46, right: 10, top: 10, bottom: 30 };

function element(name, attributes, text) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

// Round numbers between two ends, about `count` of them.
export function ticks(low, high, count) {
  const raw = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((m) => m * power >= raw * 0.999);
  const out = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) out.push(k * step);
  return { values: out, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

export class Plot {
  constructor(svg, unitX, unitY) {
    Object.assign(this, { svg, unitX, unitY });
  }

  // `xs` rising; values that are no numbers break the curve. `area` fills down to 0.
  draw(xs, ys, { area = false } = {}) {
    const { svg } = this;
    const { width, height } = svg.getBoundingClientRect();
    svg.replaceChildren();
    this.x = null;
    if (!width || !height) return;
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const known = Array.from(ys).filter(Number.isFinite);
    if (known.length < 2) {
      svg.append(element("text", { x: width / 2, y: height / 2, "text-anchor": "middle" }, "nothing is known of it"));
      return;
    }
    let [low, high] = area ? [0, Math.max(...known)] : [Math.min(...known), Math.max(...known)];
    const room = Math.max(0.06 * (high - low), 1e-3);
    if (!area) low -= room;
    high += room;
    const [first, last] = [xs[0], xs[xs.length - 1]];
    const { left, right, top, bottom } = SPACE;
    const x = (v) => left + ((v - first) / (last - first || 1)) * (width - left - right);
    const y = (v) => height - bottom - ((v - low) / (high - low)) * (height - top - bottom);
    this.axes(x, y, ticks(first, last, 6), ticks(low, high, 4), width, height);
    let path = "";
    let pen = "M";
    for (let k = 0; k < xs.length; k++) {
      if (!Number.isFinite(ys[k])) {
        pen = "M";
        continue;
      }
      path += `${pen}${x(xs[k]).toFixed(1)} ${y(ys[k]).toFixed(1)}`;
      pen = "L";
    }
    if (area) svg.append(element("path", { class: "area", d: `${path}L${x(last)} ${y(0)}L${x(first)} ${y(0)}Z` }));
    svg.append(element("path", { class: "curve", d: path }));
    Object.assign(this, { x, y, first, last, width, height });
  }

  axes(x, y, forX, forY, width, height) {
    const { svg } = this;
    const { left, right, bottom } = SPACE;
    for (const v of forY.values) {
      svg.append(element("line", { class: "axis", x1: left, x2: width - right, y1: y(v), y2: y(v) }));
      svg.append(element("text", { x: left - 6, y: y(v) + 4, "text-anchor": "end" }, `${v.toFixed(forY.digits)}${this.unitY}`));
    }
    forX.values.forEach((v, k) => {
      const unit = k === forX.values.length - 1 ? ` ${this.unitX}` : "";
      const anchor = x(v) > width - right - 18 ? "end" : "middle";
      svg.append(element("text", { x: x(v), y: height - bottom + 18, "text-anchor": anchor }, `${v.toFixed(forX.digits)}${unit}`));
    });
  }

  // A line at one place of the x axis, which stays the same line when it moves.
  now(v) {
    if (!this.x) return;
    let line = this.svg.querySelector(".now");
    if (!line) this.svg.append((line = element("line", { class: "now", y1: SPACE.top, y2: this.height - SPACE.bottom })));
    line.setAttribute("x1", this.x(v));
    line.setAttribute("x2", this.x(v));
  }

  // A named place on the curve.
  mark(v, height, text) {
    if (!this.x) return;
    const [x, y] = [this.x(v), this.y(height)];
    const beside = x > this.width * 0.6 ? { x: x - 8, "text-anchor": "end" } : { x: x + 8 };
    this.svg.append(element("circle", { class: "peak", cx: x, cy: y, r: 3.5 }));
    this.svg.append(element("text", { class: "peak", y: Math.max(y + 4, SPACE.top + 10), ...beside }, text));
  }

  // A range of the x axis.
  band(from, to) {
    if (!this.x) return;
    const [a, b] = [from, to].map((v) => this.x(Math.min(this.last, Math.max(this.first, v))));
    this.svg.append(element("rect", { class: "band", x: a, width: Math.max(1, b - a), y: SPACE.top, height: this.height - SPACE.top - SPACE.bottom }));
  }

  // The value of the x axis under a pointer.
  under(event) {
    if (!this.x) return null;
    const { left, right } = SPACE;
    const share = (event.clientX - this.svg.getBoundingClientRect().left - left) / (this.width - left - right);
    return this.first + Math.min(1, Math.max(0, share)) * (this.last - this.first);
  }
}

// Plot of a quantity over moments with a cursor; a click or drag goes to the moment under the pointer.
import { svg } from "./dom.js";
import { brief, tickLabel } from "./numbers.js";

export class Plot {
  // lines: [{moments, values}]; others: lines of another run for comparison, in `otherColor`, of `otherLength` steps: the axis is the share of each
  // run; bands: [{first, end, tint}], tint: a colour or none; isKnownAtPoints: lines have values at some moments only; onJump: called with a moment.
  constructor(host, { title, unit, lines, others = [], otherColor, otherLength = 0, bands, length, isLog, isKnownAtPoints = false, color, onJump }) {
    const share = Math.max(1, length) / Math.max(1, otherLength);
    others = others.map(({ moments, values }) => ({ moments: moments.map((moment) => moment * share), values }));
    Object.assign(this, { host, title, unit, lines, others, otherColor, bands, length, isLog, isKnownAtPoints, color });
    this.last = Math.max(1, length); // moment at the right border
    const values = [...lines, ...others].flatMap((line) => line.values).filter((value) => Number.isFinite(value) && (!isLog || value > 0));
    this.floor = Math.min(...values);
    const scaled = values.map((value) => this.scaled(value));
    const low = Math.min(...scaled), high = Math.max(...scaled), margin = 0.08 * (high - low) || 1;
    this.low = isLog || low < 0 ? low - margin : Math.max(0, low - margin);
    this.high = high + margin;
    this.build();
    const jump = (event) => {
      const box = this.svg.getBoundingClientRect();
      onJump(Math.round((event.clientX - box.left - this.left) / (box.width - this.left - this.right) * this.last));
    };
    host.addEventListener("pointerdown", (event) => { host.setPointerCapture(event.pointerId); jump(event); });
    host.addEventListener("pointermove", (event) => { if (event.buttons & 1) jump(event); });
    new ResizeObserver(() => { this.build(); this.cursor(this.moment ?? 0); }).observe(host);
  }

  scaled(value) { return this.isLog ? Math.log10(Math.max(value, this.floor)) : value; }
  x(moment) { return this.left + (this.width - this.left - this.right) * moment / this.last; }
  y(value) { return this.height - this.bottom - (this.height - this.top - this.bottom) * (this.scaled(value) - this.low) / (this.high - this.low); }

  build() {
    Object.assign(this, { left: 56, right: 8, top: 20, bottom: 6, width: this.host.clientWidth || 380, height: this.host.clientHeight || 110 });
    this.host.replaceChildren();
    this.svg = svg("svg", { width: "100%", height: "100%", viewBox: `0 0 ${this.width} ${this.height}`, role: "img", "aria-label": this.title }, this.host);
    this.bands.forEach(({ first, end, tint }, k) => {
      if (tint) svg("rect", { x: this.x(first), y: this.top - 4, width: this.x(end) - this.x(first), height: this.height - this.top - this.bottom + 4, style: `fill:${tint};opacity:.14` }, this.svg);
      else if (k % 2) svg("rect", { x: this.x(first), y: this.top - 4, width: this.x(end) - this.x(first), height: this.height - this.top - this.bottom + 4, class: "band" }, this.svg);
    });
    const ticks = this.ticks(), digits = [3, 4, 5].find((count) => new Set(ticks.map((tick) => tickLabel(tick, count))).size === ticks.length) ?? 6;
    for (const tick of ticks) {
      const y = this.y(tick);
      svg("line", { x1: this.left, x2: this.width - this.right, y1: y, y2: y, class: "grid" }, this.svg);
      svg("text", { x: this.left - 6, y: y + 4, "text-anchor": "end" }, this.svg).textContent = tickLabel(tick, digits);
    }
    svg("text", { x: 4, y: 12, class: "name" }, this.svg).textContent = this.title;
    this.reading = svg("text", { x: this.width - this.right, y: 12, "text-anchor": "end", class: "reading" }, this.svg);
    this.others.forEach((line) => this.curve(line, this.otherColor));
    this.lines.forEach((line) => this.curve(line, this.color));
    this.bar = svg("line", { y1: this.top - 4, y2: this.height - this.bottom, class: "cursor" }, this.svg);
    this.dot = svg("circle", { r: 4, class: "dot" }, this.svg);
  }

  curve({ moments, values }, color) {
    const points = moments.map((m, i) => `${this.x(m).toFixed(1)},${this.y(values[i]).toFixed(1)}`).join(" ");
    svg("polyline", { points, fill: "none", style: `stroke:${color}`, "stroke-width": 1.8, "stroke-linejoin": "round" }, this.svg);
  }

  ticks() {
    const count = Math.max(2, Math.floor((this.height - this.top) / 26));
    if (this.isLog) {
      const step = Math.max(1, Math.ceil((this.high - this.low) / count));
      const result = [];
      for (let power = Math.ceil(this.low); power <= this.high; power += step) result.push(10 ** power);
      if (result.length > 1) return result;
      const between = [Math.floor(this.low), Math.ceil(this.low)].flatMap((power) => [1, 2, 5].map((factor) => factor * 10 ** power));
      const within = between.filter((value) => Math.log10(value) >= this.low && Math.log10(value) <= this.high);
      if (within.length) return within;
    }
    const [low, high] = this.isLog ? [10 ** this.low, 10 ** this.high] : [this.low, this.high];
    const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((factor) => factor * power).find((candidate) => candidate >= rough);
    const result = [];
    for (let value = Math.ceil(low / step) * step; value <= high; value += step) result.push(value);
    return result;
  }

  // The moment and value that the dot marks: of the last known one where lines are known at points; null between lines: a fit reads no photo.
  value(moment) {
    let found = null;
    for (const { moments, values } of this.lines) {
      if (moments[0] > moment) continue;
      const at = this.isKnownAtPoints ? moments.findLastIndex((m) => m <= moment) : moment - moments[0];
      found = at < values.length ? [moments[at], values[at]] : null;
    }
    return found;
  }

  cursor(moment) {
    this.moment = moment;
    const [known, value] = this.value(moment) ?? [moment, null], x = this.x(moment);
    this.bar.setAttribute("x1", x);
    this.bar.setAttribute("x2", x);
    this.dot.setAttribute("visibility", value === null ? "hidden" : "visible");
    this.reading.textContent = value === null ? "" : `${brief(value, 3)}${this.unit}`;
    if (value === null) return;
    this.dot.setAttribute("cx", this.x(known));
    this.dot.setAttribute("cy", this.y(value));
  }
}

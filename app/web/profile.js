// Plot of the energy of the faces around a vertex while it is moved along each axis.
import { svg } from "./dom.js";
import { brief } from "./numbers.js";

const AXES = ["x", "y", "z"];
const HEIGHT = 99, SIDE = 8, TOP = 20, BOTTOM = 17; // px

// Draws the profiles of a vertex into an element. `offsets`: where the energies `lines` (3 arrays) are known; `at`: the offset
// of the dot on each line; `colors`: one a line; `labels`: of the first offset, 0 and the last; `distance`: the last in words.
export function drawProfile(host, { vertex, offsets, lines, at, colors, labels, distance }) {
  const width = host.clientWidth || 230, values = lines.flat(), low = Math.min(...values), high = Math.max(...values, low + 1e-9);
  const reach = offsets.at(-1), x = (offset) => SIDE + (width - 2 * SIDE) * (offset + reach) / (2 * reach);
  const y = (value) => TOP + (HEIGHT - TOP - BOTTOM) * (high - value) / (high - low);
  const words = `Energy of the faces around vertex ${vertex} while it is moved along x, y or z by up to ${distance}, from ${brief(low)} to ${brief(high)}`;
  const plot = svg("svg", { viewBox: `0 0 ${width} ${HEIGHT}`, role: "img", "aria-label": words });
  const title = svg("text", { x: SIDE, y: 12, class: "name" }, plot);
  title.textContent = `E if vertex ${vertex} moves along `;
  AXES.forEach((name, axis) => { svg("tspan", { style: `fill:${colors[axis]};font-weight:700` }, title).textContent = `${name} `; });
  [[-reach, "start"], [0, "middle"], [reach, "end"]].forEach(([offset, anchor], k) => {
    svg("line", { x1: x(offset), x2: x(offset), y1: TOP, y2: HEIGHT - BOTTOM, style: "stroke:var(--line)" }, plot);
    svg("text", { x: x(offset), y: HEIGHT - 3, "text-anchor": anchor }, plot).textContent = labels[k];
  });
  lines.forEach((line, axis) => {
    const points = line.map((value, i) => `${x(offsets[i])},${y(value)}`).join(" ");
    svg("polyline", { points, fill: "none", "stroke-width": 1.8, style: `stroke:${colors[axis]}` }, plot);
    svg("circle", { cx: x(at[axis]), cy: y(between(offsets, line, at[axis])), r: 3.5, style: `fill:${colors[axis]}` }, plot);
  });
  host.replaceChildren(plot);
}

// The value of a line at an offset, by linear interpolation.
function between(offsets, line, at) {
  const apart = offsets[1] - offsets[0], i = Math.max(0, Math.min(line.length - 2, Math.floor((at - offsets[0]) / apart)));
  return line[i] + (at - offsets[i]) / apart * (line[i + 1] - line[i]);
}

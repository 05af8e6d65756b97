// The replay page: everything shown is a function of the moment, the selected vertex and the selected face.
import { cellHeads, cellRow, photoTitle } from "../../web/cell_rows.js";
import { Cells } from "../../web/cells.js";
import { $, chip, element, press } from "../../web/dom.js";
import { brief } from "../../web/numbers.js";
import { openPage, viewOrNote } from "../../web/open_page.js";
import { pageData } from "../../web/page_data.js";
import { Playback } from "../../web/playback.js";
import { Plot } from "../../web/plot.js";
import { facesAround, onGrid, RunRecord, textureCoordinates } from "../../web/record.js";
import { unpack } from "../../web/unpack.js";
import { Viewer } from "../../web/viewer.js";

const data = pageData();
const KINDS_SHOWN = {
  observed: { head: "I", meaning: "Observed cell: the face in the photo, warped to the cell" },
  reconstruction: { head: "U c", meaning: "Reconstruction from the eigenspace" },
  residual: { head: "I − U c", meaning: "Residual. Blue: darker than the reconstruction; red: brighter" },
  weight: { head: "weight", meaning: "Robust weight of each sample: dark is small, bright is full; yellow: outlier" },
};
const BASE_RATE = Math.max(5, data.length / 16); // moments per second: a run plays in about 16 s

// Set by `open` when the data is unpacked.
let arrays = null, record = null, cells = null, viewer = null;
const plots = [];

const verticesAt = (moment) => record.verticesAt(moment);

const state = { moment: -1, vertex: null, face: null, speed: 1 };

const playback = new Playback({
  length: () => data.length,
  rate: () => BASE_RATE * state.speed,
  moment: () => state.moment,
  go,
  onStop: () => { if (cells && state.moment >= 0) showCells(); },
});
const jump = (moment) => playback.jump(moment);

// ---------------------------------------------------------------- time

function go(moment) {
  moment = Math.max(0, Math.min(data.length, Math.round(moment)));
  if (moment === state.moment) return;
  state.moment = moment;
  playback.show();
  viewer?.show(moment, verticesAt(moment), record.blendAt(moment, data.keyframes));
  plots.forEach((plot) => plot.cursor(moment));
  showStep();
  if (!playback.isOn || performance.now() > cellsDue) showCells();
}

// Goes to the next of these moments, or to the previous one.
function edge(moments, direction) {
  const edges = [0, ...moments, data.length];
  jump(direction > 0 ? edges.find((m) => m > state.moment) ?? data.length : edges.findLast((m) => m < state.moment) ?? 0);
}

// ---------------------------------------------------------------- texts about the step

function showStep() {
  const m = state.moment, step = m ? data.steps[m - 1] : null;
  $("headline").textContent = m === 0 ? "The start" : m === data.length ? "The end" : `Moment ${m}`;
  $("where").textContent = step ? `${step.where} · level ${step.level} of ${data.levels.length}` : data.length ? `${data.length} steps` : "no recorded steps";
  const summary = $("change");
  $("outcome").textContent = step ? step.outcome : "";
  summary.textContent = "";
  const { moments, values } = data.residual, known = moments.findLastIndex((each) => each <= m);
  if (known >= 0) {
    const percent = 100 * (values[known] / values[0] - 1), since = ` ${percent > 0 ? "+" : ""}${brief(percent)} % since the start`;
    summary.append("residual ", element("b", {}, brief(values[known], 4)), " grey levels", element("span", { className: percent < 0 ? "good" : "dim" }, m ? since : ""));
  }
  if (step?.longest > 0) summary.append(`${known >= 0 ? " · " : ""}longest step ${brief(step.longest)} px`);
  summary.title = step && step.after !== null ? `By this step: ${step.measure === "energy" ? "sweep energy" : step.measure} ${brief(step.before, 5)} → ${brief(step.after, 5)}` : "";
  $("what").textContent = step ? data.kinds[step.kind].title : "Before the first step";
  $("why").textContent = step ? data.kinds[step.kind].text : data.intro;
  $("level-text").textContent = step?.measure === "objective" ? "" : step ? data.levels[step.level - 1].text : data.levels[0]?.text ?? "";
  showVertex();
}

function showVertex() {
  const v = state.vertex, m = state.moment;
  $("vertex-facts").hidden = v === null;
  if (v === null || !viewer) return;
  const now = verticesAt(m), at = (values) => values.subarray(3 * v, 3 * v + 3);
  const apart = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]) / data.diagonal * 100;
  const rows = [["distance to start", `${brief(apart(at(now), at(arrays.start)))} % of the diagonal`]];
  if (arrays.truth) rows.push(["distance to truth", `${brief(apart(at(now), at(arrays.truth)))} %`]);
  const reason = lastReason(v, m);
  if (reason !== null) rows.push(["last step", data.reasons[reason]]);
  $("vertex-name").textContent = `Vertex ${v}`;
  showPulls(v, m);
  $("vertex-rows").replaceChildren(...rows.map(([name, value]) => element("tr", {}, element("th", {}, name), element("td", {}, value))));
}

// The pulls on a vertex at the last moment up to this one at which the file has them.
function showPulls(vertex, moment) {
  const { moments, terms, px, shares, pxUnit, shareUnit } = data.pulls, at = moments.findLastIndex((m) => m <= moment);
  $("pulls").hidden = at < 0 || !terms.length;
  if ($("pulls").hidden) return;
  $("pulls-title").textContent = `Pulls on the step after moment ${moments[at]}`;
  const count = px.length / moments.length / terms.length;
  $("pull-rows").replaceChildren(...terms.map(({ name, color, hint }, t) => {
    const k = (at * terms.length + t) * count + vertex, share = shares[k] ? `${Math.round(100 * (shares[k] - 1) * shareUnit)} %` : "";
    const head = element("th", {}, element("i", { className: "swatch", style: `background:${color}` }), name);
    return element("tr", { title: hint }, head, element("td", {}, `${brief(px[k] * pxUnit)} px`), element("td", {}, share));
  }));
}

function lastReason(vertex, moment) {
  for (let step = moment - 1; step >= 0; step--)
    for (let i = data.involved.starts[step]; i < data.involved.starts[step + 1]; i++) if (data.involved.vertices[i] === vertex) return data.involved.reasons[i];
  return null;
}

// ---------------------------------------------------------------- cells

let cellsDue = 0; // time of the next update while playing, so that the cells do not slow down the playback

const ring = (vertex) => facesAround(arrays.faces, vertex);

function select(vertex) {
  state.vertex = vertex;
  const faces = ring(vertex).filter((f) => cells.has(f));
  const photos = (face) => cells.photosOf(face, state.moment);
  const most = faces.reduce((best, f) => (best !== null && (change(f) - change(best) || photos(f) - photos(best)) <= 0 ? best : f), null);
  state.face = faces.includes(state.face) ? state.face : most;
  if (viewer) { viewer.selected = vertex; viewer.redraw(); }
  $("faces").replaceChildren(...faces.map((f) => Object.assign(chip(`face ${f}`, false, () => { state.face = f; showCells(); }), { face: f })));
  showCells();
  showVertex();
}

// The comparable residual of a face in a photo at the last known moment, and its largest value in any photo at any moment: of a full bar.
function comparableResidual(face, view, moment) {
  const { moments, faces } = data.residuals, values = faces[face] ?? {};
  const at = moments.findLastIndex((known) => known <= moment);
  return { value: at < 0 ? null : values[view]?.[at] ?? null, most: Math.max(1e-9, ...Object.values(values).flat()) };
}

// How much the comparable residual of a face changed in a photo, or in all photos.
function changeIn(face, view) {
  const values = data.residuals.faces[face]?.[view];
  return values ? Math.abs(values.at(-1) - values[0]) : 0;
}
function change(face) { return Object.keys(data.residuals.faces[face] ?? {}).reduce((sum, view) => sum + changeIn(face, view), 0); }

function showCells() {
  const began = performance.now();
  const isKept = state.face !== null;
  $("cells").hidden = !isKept;
  $("no-cells").hidden = isKept;
  $("no-cells").textContent = state.vertex === null ? "Click a vertex to see the cells of its faces." : `This file has no photos around vertex ${state.vertex}; it contains those around the vertices that moved most. `;
  if (!isKept) { $("no-cells").append(...(state.vertex === null ? [] : [chip(`vertex ${data.chosen}`, false, () => select(data.chosen))])); return; }
  for (const button of $("faces").children) press(button, button.face === state.face);
  const { moment } = state, found = cells.at(state.face, moment, verticesAt(moment));
  const views = cells.viewsOf(state.face).toSorted((a, b) => changeIn(state.face, b) - changeIn(state.face, a)); // first where most happened
  $("cell-facts").textContent = found ? `k = ${found.k} · blur ${data.levels[data.cells.sweeps.level[data.cells.sweepAt[moment]]].blur} px · sweep energy ${brief(found.energy, 4)}` : "fewer than three photos see the face well enough at this moment";
  $("residual-scale").textContent = found ? `±${brief(found.scale.residual)} grey levels` : "";
  const kinds = Object.keys(KINDS_SHOWN), cellOf = found && cells.pictures(found);
  const tile = Math.round(parseFloat(getComputedStyle($("cell-rows")).gridAutoRows));
  $("cell-heads").replaceChildren(cellHeads(Object.values(KINDS_SHOWN), tile));
  $("cell-rows").replaceChildren(...views.map((view) => {
    const { name } = data.cells.photos.views[view], { value, most } = comparableResidual(state.face, view, moment);
    const words = value !== null ? `residual ${brief(value)}` : found?.views.includes(view) ? "not measured" : "not used";
    const bar = element("i", { style: `width:${value === null ? 0 : 100 * value / most}%` });
    const title = photoTitle(view, name), measured = element("span", { title: "Grey levels at the finest level, comparable between moments" }, words);
    const label = `Cell of face ${state.face} in ${name}: ${Object.values(KINDS_SHOWN).map(({ head }) => head).join(", ")}; ${words}`;
    return cellRow({ view, about: [element("b", { title }, title), measured, bar], kinds, tile, cellOf, label });
  }));
  $("cell-moment").textContent = `moment ${moment}`;
  cellsDue = performance.now() + 2 * (performance.now() - began);
}

// ---------------------------------------------------------------- plots

const bands = data.stages.map((stage) => ({ ...stage, tint: stage.is_fit ? stage.color : null }));
function showPlots() {
  $("plots").hidden = !data.length;
  $("residual").hidden = !data.residual.moments.length;
  $("error").hidden = !data.errors;
  $("expert").hidden = !data.energy.length;
  if (!data.length) return;
  const common = { bands, length: data.length, isLog: false, color: data.css.now, onJump: jump };
  if (data.residual.moments.length) {
    plots.push(new Plot($("residual"), { ...common, title: data.errors ? "Residual, grey levels" : "Residual at the finest level, grey levels", unit: "", lines: [data.residual], isKnownAtPoints: true }));
  }
  if (data.energy.length) plots.push(new Plot($("energy"), { ...common, title: "Energy, one line per sweep", unit: "", lines: data.energy }));
  if (data.errors) {
    plots.push(new Plot($("error"), { title: "Error", unit: " %", lines: [{ moments: data.errors.map((_, m) => m), values: data.errors }], bands, length: data.length, isLog: true, color: data.css.truth, onJump: jump }));
  }
}
$("bands").replaceChildren(...bands.map((stage) => element("button", { type: "button", style: `flex:${stage.end - stage.first};background:${stage.ground};border-color:${stage.color}`, title: `${stage.hint} Click to go to its beginning.`, onclick: () => jump(stage.first) }, element("span", {}, stage.name))));

// ---------------------------------------------------------------- controls

const layers = { texture: "Texture", paths: "Paths", dots: "Vertices", wire: "Edges now", start: "Edges at the start", truth: "Truth", cameras: "Cameras" };
function showLayers() {
  for (const [name, title] of Object.entries(layers)) {
    if (name === "truth" && !arrays.truth) continue;
    const button = chip(title, viewer.shown[name], () => {
      viewer.shown[name] = !viewer.shown[name];
      press(button, viewer.shown[name]);
      if (name === "cameras" && viewer.shown.cameras) viewer.overview();
      else if (name === "cameras") viewer.home();
      viewer.redraw();
    });
    if (data.css[name]) button.prepend(element("i", { style: `background:${data.css[name]}` }));
    $("layers").append(button);
  }
  for (const button of document.querySelectorAll("[data-side]")) button.onclick = () => showSide(button.dataset.side);
}

function showSide(side) {
  if (!viewer) return;
  viewer.side = side;
  for (const button of document.querySelectorAll("[data-side]")) button.classList.toggle("on", button.dataset.side === side);
  $("divider").hidden = side !== "both";
  viewer.redraw();
}

$("divider").addEventListener("pointerdown", (event) => $("divider").setPointerCapture(event.pointerId));
$("divider").addEventListener("pointermove", (event) => {
  if (!(event.buttons & 1)) return;
  const box = $("scene").getBoundingClientRect();
  viewer.split = Math.max(0.02, Math.min(0.98, (event.clientX - box.left) / box.width));
  $("divider").style.left = `${100 * viewer.split}%`;
  viewer.redraw();
});

for (const tab of document.querySelectorAll("[data-tab]")) {
  tab.onclick = () => {
    for (const other of document.querySelectorAll("[data-tab]")) {
      other.classList.toggle("on", other === tab);
      other.setAttribute("aria-selected", other === tab);
      $(other.dataset.tab).hidden = other !== tab;
    }
  };
}

$("speed").onchange = () => { state.speed = Number($("speed").value); $("speed").blur(); if (playback.isOn) playback.play(true); };

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
  const actions = {
    ...playback.keys,
    ArrowRight: () => (event.shiftKey ? edge(data.sweeps, 1) : jump(state.moment + 1)),
    ArrowLeft: () => (event.shiftKey ? edge(data.sweeps, -1) : jump(state.moment - 1)),
    PageDown: () => edge(bands.map((stage) => stage.end), 1),
    PageUp: () => edge(bands.map((stage) => stage.first), -1),
    b: () => showSide({ now: "before", before: "both", both: "now" }[viewer?.side ?? "now"]),
  };
  if (!(event.key in actions)) return;
  event.preventDefault();
  actions[event.key]();
});

async function open() {
  await unpack(data);
  record = new RunRecord(data, data.grid);
  arrays = {
    start: record.start, truth: data.truth && onGrid(data.truth, data.grid), faces: data.faces, edges: data.edges, cameras: data.cameras,
    uv: textureCoordinates(data.keyframes), paths: record.paths(),
  };
  cells = new Cells(data.cells, arrays.faces, data.colors);
  viewer = viewOrNote(() => new Viewer($("scene"), data, arrays));
  if (viewer) {
    viewer.onPick = (vertex) => { if (vertex !== null) select(vertex); };
    showLayers();
  }
  showPlots();
  go(data.at);
  select(data.chosen);
}

openPage(open);

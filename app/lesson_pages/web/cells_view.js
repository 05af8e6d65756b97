// The panel of cells and photos: functions of the lesson's state (lesson_state.js).
import {
  arrays, cellsOf, data, facesOf, isAtStep, pictures, point, positions, run, shownFace, state, step,
} from "./lesson_state.js";
import { CELL_COLORS, drawCell } from "../../web/cell_picture.js";
import { cellHeads, cellRow, GAP, photoTitle } from "../../web/cell_rows.js";
import { $, chip, element, fillGroup, label, press, svg } from "../../web/dom.js";
import { brief } from "../../web/numbers.js";

const WIDEST_TILE = 150; // px
const KIND_NAMES = { photo: "observed", reconstruction: "reconstruction", residual: "residual", weight: "weight", norm: "norm" };
const ENERGIES_DELAY = 150; // ms without a change before the energies of all k are computed

// What the panel calls when the reader has chosen something in it; set by lesson.js.
export const actions = { update: null, select: null, lookAt: null };

let energiesTimer = 0;

export function showCellsPanel() {
  clearTimeout(energiesTimer);
  const vertex = state.vertices.at(-1), face = shownFace(), { page } = state.cells;
  for (const button of document.querySelectorAll("[data-page]")) press(button, button.dataset.page === page);
  for (const button of document.querySelectorAll("[data-span]")) press(button, button.dataset.span === state.cells.span);
  for (const name of ["cells", "photos", "pair"]) $(`page-${name}`).hidden = name !== page || face === null;
  $("nothing").hidden = face !== null;
  $("nothing").textContent = vertex === undefined ? "Select a vertex to see the cells of its faces: click it in the 3D view, or choose it below."
    : `This file contains no photos around vertex ${vertex}; it contains those around the vertices that moved most.`;
  fillGroup("faces", facesOf(vertex).map((f) => chip(`face ${f}`, f === face, () => { state.face = f; actions.update(); })));
  if (face === null) {
    const choices = vertex === undefined ? verticesWithCells().slice(0, 8) : [];
    $("nothing").append(element("div", { className: "chips" }, ...choices.map((v) => chip(`vertex ${v}`, false, () => { actions.select([v]); $("faces").querySelector("button").focus(); }))));
    return;
  }
  ({ cells: showCellsPage, photos: showPhotosPage, pair: showPairPage })[page](vertex, face);
}

const verticesWithCells = () => [...Array(arrays.start.length / 3).keys()].filter((v) => facesOf(v).length > 0);

// ---------------------------------------------------------------- cells

function showCellsPage(vertex, face) {
  const found = cellsOf(face, state.cells.dimensions);
  const columns = Object.keys(data.kinds).filter((kind) => state.cells.columns.includes(kind));
  fillGroup("columns", Object.entries(data.kinds).filter(([kind]) => KIND_NAMES[kind] || step().flows).map(([kind, { head, meaning }]) =>
    chip(head, columns.includes(kind), () => toggleColumn(kind), meaning)));
  for (const id of ["k-row", "basis", "charts"]) $(id).hidden = !found;
  $("rows").replaceChildren();
  if (!found) { $("facts").textContent = "Fewer than three photos see this face well enough at this moment."; return; }
  const largest = found.observed.length - 2, threshold = Number.isFinite(found.threshold) ? [" · e", element("sub", {}, "T"), ` ${brief(found.threshold)}`] : [];
  $("facts").replaceChildren("Energy ", element("b", {}, brief(found.energy, 4)), ` with k = ${found.k}${found.k === found.own ? "" : ` instead of ${found.own}`} · ${found.views.length} photos · ${found.size} × ${found.size} · σ ${brief(found.sigma)}`, ...threshold, " grey levels");
  Object.assign($("k"), { max: largest, value: found.k });
  $("k-shown").textContent = found.k === found.own ? `${found.k} (the run's)` : found.k;
  drawBasis(found);
  showBars("singular", found.singular.map(Math.log1p), found.singular.map((value, i) => `singular value ${i + 1}: ${brief(value)}`), (i) => (i < found.k ? "on" : ""));
  energiesTimer = setTimeout(() => showEnergies(found), ENERGIES_DELAY);
  showRows(found, face, columns);
}

function toggleColumn(kind) {
  const chosen = state.cells.columns.includes(kind) ? state.cells.columns.filter((other) => other !== kind) : [...state.cells.columns, kind];
  if (chosen.length) state.cells = { ...state.cells, columns: chosen };
  actions.update();
}

// The energies of all k, computed one after another so that the page stays responsive.
function showEnergies(found, energies = []) {
  const count = found.observed.length - 2, shown = [...energies, run().cells.energyWith(found, energies.length + 1)];
  if (shown.length < count) { energiesTimer = setTimeout(() => showEnergies(found, shown)); return; }
  const most = Math.max(...shown, 1e-12), heights = shown.map((energy) => 1 + Math.log10(Math.max(energy / most, 1e-4)) / 4);
  showBars("by-k", heights, shown.map((energy, i) => `k = ${i + 1}: energy ${brief(energy, 4)}; click to show the cells with this k`),
    (i) => (i + 1 === found.k ? "chosen" : i + 1 === found.own ? "own" : ""), (i) => setDimensions(i + 1));
}

export function setDimensions(k) { state.cells = { ...state.cells, dimensions: k }; actions.update(); }

function showBars(id, heights, names, css, onChoose = null) {
  const most = onChoose ? 1 : Math.max(...heights, 1e-12);
  $(id).className = "bars";
  fillGroup(id, heights.map((height, i) => {
    const bar = element("i", { style: `height:${Math.max(2, 100 * height / most)}%` });
    return onChoose ? element("button", { type: "button", className: css(i), title: names[i], "aria-label": names[i], onclick: () => onChoose(i) }, bar)
      : element("div", { className: css(i), title: names[i] }, bar);
  }));
  if (!onChoose) Object.assign($(id), { role: "img", ariaLabel: names.join("; ") });
}

function drawBasis(found) {
  const side = Math.min(64, Math.floor(320 / found.basis.length)), { size } = found, canvas = $("basis");
  Object.assign(canvas, { width: found.basis.length * (side + GAP) - GAP, height: side });
  const context = canvas.getContext("2d");
  if (!context) return;
  found.basis.forEach((values, n) => {
    const largest = values.reduce((most, value) => Math.max(most, Math.abs(value)), 1e-12);
    drawCell(context, n * (side + GAP), 0, side, { size, color: (s) => Array(3).fill(127.5 + 127.5 * values[s] / largest) });
  });
  canvas.setAttribute("aria-label", `${found.basis.length} basis images of the face`);
}

// One row per photo: name, energy, and the columns. The columns υ and f show arrows of the step, over the residual before it.
function showRows(found, face, columns) {
  const flows = flowsOf(face), before = flows?.moment ? cellsOf(face, state.cells.dimensions, flows.moment - 1, null) : found;
  const hasArrows = columns.some((kind) => !KIND_NAMES[kind]);
  fillGroup("arrow-row", hasArrows ? [label("Arrows"), ...[1, 3, 10, 30, 100].map((scale) => chip(`×${scale}`, scale === state.cells.arrows, () => { state.cells = { ...state.cells, arrows: scale }; actions.update(); }))] : []);
  $("flow-note").textContent = !hasArrows ? "" : !flows ? `The arrows belong to moment ${step().moment} of this step; Resume lesson returns there.`
    : flows.moment === null ? "No step yet; f of the current cells." : `υ, f: of the step to moment ${flows.moment}${flows.model ? "" : "; it moved no corner of this face"}`;
  const width = Math.max(200, $("cells-panel").clientWidth - 40), tile = Math.min(WIDEST_TILE, Math.floor((width + GAP) / columns.length) - GAP);
  const cellOf = picturesOf(found, before, flows);
  const rows = found.views.map((view, i) => {
    const { name } = data.photos.views[view], energy = `E ${brief(found.energies[i])}`;
    const over = svg("svg", { viewBox: `0 0 ${columns.length * (tile + GAP) - GAP} ${tile}`, "aria-hidden": "true" });
    columns.forEach((kind, n) => { if (flows && !KIND_NAMES[kind]) drawArrows(over, flows, kind, view, n * (tile + GAP), tile); });
    return cellRow({
      view, about: [through(view), element("span", {}, energy)], kinds: columns, tile, cellOf, over,
      label: `Cell of face ${face} in ${name}: ${columns.map((kind) => data.kinds[kind].head).join(", ")}; ${energy}`,
    });
  });
  $("rows").replaceChildren(cellHeads(columns.map((kind) => data.kinds[kind]), tile), ...rows);
}

// A button with a photo's name that looks through its camera.
function through(view) {
  const { name } = data.photos.views[view];
  return element("button", { type: "button", className: "chip", title: `Look through the camera of ${name}`, onclick: () => actions.lookAt(view) }, photoTitle(view, name));
}

// The cells of a row. Where the column shows arrows, they lie over the strength of the residual before the step.
function picturesOf(found, before, flows) {
  const shown = run().cells.pictures(found), full = before && (Number.isFinite(before.threshold) ? before.threshold : before.scale.residual);
  return (view, column) => {
    if (KIND_NAMES[column]) return shown(view, KIND_NAMES[column]);
    const i = before && flows ? before.views.indexOf(view) : -1;
    if (i < 0) return null;
    return { size: before.size, color: (s) => Array(3).fill(CELL_COLORS.zero + 130 * Math.sqrt(Math.min(1, Math.abs(before.residual[i][s]) / full))) };
  };
}

function flowsOf(face) {
  return isAtStep() ? step().flows?.[face] ?? null : null;
}

function drawArrows(host, flows, kind, view, left, tile) {
  const field = kind === "model" ? flows.model : flows.optical, i = flows.views.indexOf(view);
  if (!field || i < 0) return;
  const unit = field.unit * tile / flows.size, count = field.places.length / 2;
  let path = "";
  for (let q = 0; q < count; q++) {
    const x = left + unit * field.places[2 * q], y = unit * field.places[2 * q + 1];
    const dx = unit * state.cells.arrows * field.vectors[2 * (i * count + q)], dy = unit * state.cells.arrows * field.vectors[2 * (i * count + q) + 1];
    const size = Math.hypot(dx, dy);
    if (size < 1.2) continue;
    const head = Math.min(4, 0.4 * size) / size, [hx, hy, sx, sy] = [head * dx, head * dy, 0.6 * head * dy, 0.6 * head * dx];
    path += `M${x} ${y}l${dx} ${dy}m${-hx - sx} ${-hy + sy}L${x + dx} ${y + dy}l${-hx + sx} ${-hy - sy}`;
  }
  svg("path", { d: path, fill: "none", "stroke-width": 1.3, style: `stroke:${kind === "model" ? data.rgb.now : "#f2f4f7"}` }, host);
}

// ---------------------------------------------------------------- photos

const cornersOf = (vertices, face) => [0, 1, 2].map((c) => point(vertices, arrays.faces[3 * face + c]));

function showPhotosPage(vertex) {
  const faces = facesOf(vertex), now = positions(), { record } = run(), path = [point(record.start, vertex)];
  const { starts, vertices: moved } = record.run.moved;
  let last = null;
  for (let s = 0; s < state.moment; s++)
    for (let i = starts[s]; i < starts[s + 1]; i++)
      if (moved[i] === vertex) { const place = Array.from(record.places.subarray(3 * i, 3 * i + 3)); last = [Array.from(path.at(-1)), place]; path.push(place); }
  if (state.offset) path.push(point(now, vertex));
  const shown = { start: faces.map((f) => cornersOf(record.start, f)), now: faces.map((f) => cornersOf(now, f)), path, step: state.offset ? null : last };
  $("arrow-scale").textContent = state.cells.arrows;
  const views = [...new Set(faces.flatMap((f) => run().cells.viewsOf(f)))].sort((a, b) => a - b);
  $("crops").replaceChildren(...views.map((view) => {
    const { name } = data.photos.views[view], canvas = pictures.crop(view, shown, state.cells.span, state.cells.arrows);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `Vertex ${vertex} in ${name}: start green, now red`);
    return element("figure", {}, element("figcaption", {}, through(view)), element("div", { className: "picture" }, canvas));
  }));
}

function showPairPage(vertex, face) {
  const views = run().cells.viewsOf(face), [i, j] = chosenPair(views, state.cells.pair), { affine } = run().cells.cells;
  const pick = (host, letter, chosen, take) => fillGroup(host, [label(letter), ...views.map((view) => chip(String(view + 1), view === chosen, () => { state.cells = { ...state.cells, pair: take(view) }; actions.update(); }, `Photo ${letter}: ${data.photos.views[view].name}`))]);
  pick("first-photo", "i", i, (view) => [view, j]);
  pick("second-photo", "j", j, (view) => [i, view]);
  const names = [i, j].map((view) => data.photos.views[view].name), moments = { "At the start": run().record.start, Now: positions() };
  $("pair-note").textContent = `${names[0]} warped into ${names[1]} by ${affine ? "the affine map" : "the plane-induced homography"}. Doubled edges in the average show that a vertex is misplaced.`;
  const all = Object.values(moments).flatMap((vertices) => cornersOf(vertices, face)).map((corner) => pictures.pixel(j, corner)), box = pictures.window(all, 0.06);
  const found = Object.entries(moments).map(([when, vertices]) => {
    const corners = cornersOf(vertices, face), difference = run().cells.photos.difference(i, j, Float32Array.from(corners.flatMap((at) => [...at])));
    return [when, pictures.pair(i, j, corners, box, affine, when === "Now" ? data.rgb.now : data.rgb.start), difference];
  });
  const figures = [];
  for (const [kind, caption] of Object.entries({ average: "average", warped: "i warped into j", own: "j" }))
    for (const [when, pair, difference] of found) {
      if (!pair) continue;
      pair[kind].setAttribute("role", "img");
      pair[kind].setAttribute("aria-label", `${caption}, ${when.toLowerCase()}`);
      const value = Number.isNaN(difference) ? "" : ` · |i − j| ${brief(difference)}`;
      const head = kind === "average" ? [element("div", { className: "dim", title: data.difference }, element("b", {}, when), value)] : [];
      figures.push(element("figure", {}, ...head, element("div", { className: "picture" }, pair[kind]), element("figcaption", {}, caption)));
    }
  $("pair").replaceChildren(...figures);
}

function chosenPair(views, [first, second]) {
  const j = views.includes(second) ? second : null, i = views.includes(first) && first !== j ? first : views.find((view) => view !== j);
  return [i, j ?? [...views.slice(Math.floor(views.length / 2)), ...views].find((view) => view !== i)];
}

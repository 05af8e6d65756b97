// The lesson page: a step sets run, moment, selection, layers, viewpoint and cells; what is shown is a function of that state.
import { actions, setDimensions, showCellsPanel } from "./cells_view.js";
import {
  arrays, data, facesOf, isAtStep, pictures, point, positions, run, runs, SHAPES, state, step, surfacePositions, unpackLesson,
} from "./lesson_state.js";
import { LessonViewer } from "./lesson_viewer.js";
import { $, chip, element, fillGroup, label, press } from "../../web/dom.js";
import { brief, tickLabel } from "../../web/numbers.js";
import { openPage, viewOrNote } from "../../web/open_page.js";
import { Playback } from "../../web/playback.js";
import { Plot } from "../../web/plot.js";
import { drawProfile } from "../../web/profile.js";

const PLAY_SECONDS = 8; // of a whole run
const MOVES = [["−x", 0, -1], ["+x", 0, 1], ["−y", 1, -1], ["+y", 1, 1], ["−z", 2, -1], ["+z", 2, 1]];
const EYES = { mesh: "Mesh", front: "Front", cameras: "Cameras" };
const SURFACES = { textured: "Textured", flat: "Flat", none: "None" };

let viewer = null, playback = null, plots = [];

// ---------------------------------------------------------------- what is shown

// The weight of each photo in the texture of each face, 0 to 255, (faces x photos).
function textureWeights() {
  const { sweeps, sweepAt, faces } = run().cells.cells, count = data.photos.views.length, weights = new Uint8Array(arrays.faces.length / 3 * count);
  for (const face of faces) {
    const at = run().cells.number(face, sweepAt[state.moment]), first = sweeps.starts[at], end = sweeps.starts[at + 1];
    const most = sweeps.weight.subarray(first, end).reduce((a, b) => Math.max(a, b), 1e-12);
    for (let pair = first; pair < end; pair++) weights[face * count + sweeps.views[pair]] = Math.round(255 * sweeps.weight[pair] / most);
  }
  return weights;
}

let cellsDue = 0; // time of the next update of the cells while playing or dragging, so that they do not slow it down

function update() {
  const isHere = isAtStep();
  if (viewer) {
    viewer.surface = step().coloring && state.surface === "colored" && !isHere ? "flat" : state.surface;
    viewer.marked = state.vertices;
    viewer.selected = state.vertices.at(-1) ?? null;
    viewer.shown = { ...state.shown };
    viewer.showEllipsoids(state.shown.certainty && isHere ? step().certainty : null);
    viewer.present({ moment: state.moment, vertices: surfacePositions(), now: positions(), weights: run().keyframes.length ? null : textureWeights(), magnification: state.magnification });
  }
  plots.forEach((plot) => plot.cursor(state.moment));
  showMoment();
  showControls();
  showMove();
  $("left").hidden = isHere && state.vertices.join() === step().vertices.join();
  if (performance.now() >= cellsDue) showCellsTimed();
  else scheduleCells();
}

let cellsTimer = 0;
function scheduleCells() {
  clearTimeout(cellsTimer);
  cellsTimer = setTimeout(showCellsTimed, Math.max(0, cellsDue - performance.now()));
}

function showCellsTimed() {
  clearTimeout(cellsTimer);
  const began = performance.now();
  showCellsPanel();
  showTry();
  cellsDue = playback.isOn || state.dragging ? performance.now() + 2 * (performance.now() - began) : 0;
}

function showMoment() {
  const { record } = run(), m = state.moment, done = m ? record.run.steps[m - 1] : null;
  $("headline").textContent = m === 0 ? "The start" : m === record.length && record.run.isFinished ? "The end" : `Moment ${m}`;
  $("where").textContent = done ? `level ${done.level} of ${record.run.levels.length} · photos blurred by ${record.run.levels[done.level - 1].blur} px · ${done.outcome}` : "";
  playback.show();
  const vertex = state.vertices.at(-1);
  $("scene").setAttribute("aria-label", `The mesh in 3D at moment ${m} of ${record.length}. ${vertex === undefined ? "No vertex is selected." : `Vertex ${vertex} is selected${distanceText(vertex)}.`} Arrow keys rotate, plus and minus zoom.`);
}

// Distance of a vertex from its true position, in the unit of the lessons: that of the record, unless the reader has moved the vertex.
function off(vertex) {
  if (!state.offset && run().off) return offAt(run(), vertex, state.moment);
  const [a, b] = [point(positions(), vertex), point(arrays.truth, vertex)];
  return 100 * Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]) / data.stage.pageFromWorld;
}

const offAt = ({ off: recorded }, vertex, moment) => recorded[moment * arrays.start.length / 3 + vertex];

const distanceText = (vertex) => (arrays.truth && data.isCube ? `, ${brief(off(vertex))} % of an edge length off its true position` : "");

// ---------------------------------------------------------------- trying: a moved vertex

const ringEnergy = (vertex, vertices) => facesOf(vertex).reduce((sum, face) => sum + (run().cells.at(face, state.moment, vertices)?.energy ?? 0), 0);

function moveVertex(by) {
  const vertex = state.vertices.at(-1), limit = (value) => Math.max(-data.reach, Math.min(data.reach, value));
  if (vertex === undefined) return;
  const before = state.offset?.vertex === vertex ? state.offset.by : [0, 0, 0], after = before.map((value, c) => limit(value + by[c]));
  if (playback.isOn) playback.play(false);
  state.offset = after.some((value) => Math.abs(value) > 1e-6) ? { vertex, by: after } : null;
  state.shape = SHAPES.now;
  update();
}

function showMove() {
  const vertex = state.vertices.at(-1), size = state.moveBy / 100 * data.stage.pageFromWorld, unit = data.isCube ? "%" : "hundredths";
  if (vertex === undefined || !facesOf(vertex).length) { $("move").replaceChildren(); return; }
  const focused = document.activeElement?.dataset?.move;
  const buttons = MOVES.map(([way, axis, sign]) => element("button", { type: "button", className: "chip", "data-move": way, "aria-label": `Move vertex ${vertex} by ${state.moveBy} ${unit} along ${way}`, onclick: () => moveVertex([0, 1, 2].map((c) => (c === axis ? sign * size : 0))) }, way));
  const steps = element("button", { type: "button", className: "chip", "data-move": "size", title: "Size of a move", onclick: () => { state.moveBy = { 1: 5, 5: 0.2, 0.2: 1 }[state.moveBy]; showMove(); } }, `by ${state.moveBy} ${unit}`);
  const back = element("button", { type: "button", className: "chip", "data-move": "back", disabled: !state.offset, onclick: () => { state.offset = null; update(); } }, "Back to the run");
  $("move").replaceChildren(element("span", { className: "dim" }, `Move vertex ${vertex}`), ...buttons, steps, back);
  if (focused) $("move").querySelector(`[data-move="${focused}"]`)?.focus();
}

// Energy of the faces around the vertex, in the record and where it was moved; the profiles of the step.
function showTry() {
  const vertex = state.vertices.at(-1), note = $("try");
  note.replaceChildren();
  if (vertex !== undefined && facesOf(vertex).length) {
    const error = arrays.truth && data.isCube ? [element("b", {}, `${brief(off(vertex))} %`), " of an edge off its true position. "] : [];
    if (state.offset) {
      const [before, after] = [ringEnergy(vertex, run().record.verticesAt(state.moment)), ringEnergy(vertex, positions())];
      const isFarthest = state.offset.by.some((value) => Math.abs(value) > 0.999 * data.reach);
      note.append("Moved by hand", isFarthest ? " as far as the photos in this file reach: " : ": ", ...error, "E of its faces ", element("b", {}, brief(after, 4)), ` instead of ${brief(before, 4)}`);
    } else {
      const axes = isAtStep() ? step().axes[vertex] : null;
      if (axes) note.append("Certainty ellipsoid ", element("b", {}, axes.map((length) => (length < 1e6 ? brief(length, 2) : "∞")).join(" : ")), ". ");
      note.append(...error, "Drag it: E changes.");
    }
  }
  showProfile();
}

function showProfile() {
  const { profile } = step(), vertex = state.vertices.at(-1);
  const isShown = profile !== null && profile.vertex === vertex && state.run === step().run && state.moment === step().moment;
  $("profile").hidden = !isShown;
  if (!isShown) return;
  const at = [0, 1, 2].map((axis) => (state.offset ? 100 * state.offset.by[axis] / data.stage.pageFromWorld : 0));
  const reach = profile.offsets.at(-1), labels = [-reach, 0, reach].map((offset) => `${offset > 0 ? "+" : ""}${tickLabel(offset)}${data.isCube ? " %" : ""}`);
  drawProfile($("profile"), { ...profile, at, colors: data.curves, labels, distance: `${tickLabel(reach)} hundredths of a unit` });
}

// ---------------------------------------------------------------- time

function go(moment) {
  moment = Math.max(0, Math.min(run().record.length, Math.round(moment)));
  state.moment = moment;
  state.offset = null;
  update();
}

const jump = (moment) => playback.jump(moment);

function takeRun(number, moment) {
  const isOther = state.run !== number || !plots.length;
  Object.assign(state, { run: number, moment, offset: null });
  if (isOther) {
    viewer?.take(run());
    viewer?.color(step().coloring);
    showPlots();
  }
}

// ---------------------------------------------------------------- plots

let plotted = null; // the vertex whose error is plotted

// The vertex that a run moved farthest.
function movedMost(record) {
  const end = record.verticesAt(record.length), apart = (v) => Math.hypot(...[0, 1, 2].map((c) => end[3 * v + c] - record.start[3 * v + c]));
  return [...Array(end.length / 3).keys()].reduce((best, v) => (apart(v) > apart(best) ? v : best), 0);
}

function showPlots() {
  const { record } = run(), { levels, length, residual, errors } = record.run, other = step().compared ? runs[step().compared[0]] : null;
  const bands = levels.filter((level) => level.end > level.first);
  plots = [];
  for (const host of [$("residual"), $("error")]) host.replaceChildren();
  if (!length) return;
  const make = (host, settings) => {
    const place = element("div", { className: "plot" });
    host.append(place);
    plots.push(new Plot(place, { bands, length, onJump: jump, otherColor: "var(--reference)", otherLength: other?.record.run.length, ...settings }));
  };
  if (residual.moments.length) {
    make($("residual"), { title: "Residual, grey levels", unit: "", lines: [residual], others: other ? [other.record.run.residual] : [], isLog: false, isKnownAtPoints: true, color: data.css.now });
  }
  const line = (values) => ({ moments: values.map((_, m) => m), values });
  const vertex = state.vertices.at(-1) ?? movedMost(record), isOfVertex = arrays.truth && data.isCube;
  const error = (of) => [line(isOfVertex ? Array.from({ length: of.record.length + 1 }, (_, m) => offAt(of, vertex, m)) : of.record.run.errors)];
  const title = isOfVertex ? "Error, % of an edge" : "Error, % of the diagonal";
  if (errors) make($("error"), { title, unit: "", lines: error(run()), others: other ? error(other) : [], isLog: true, color: data.css.truth });
  plotted = vertex;
}

// ---------------------------------------------------------------- controls

function select(vertices) {
  Object.assign(state, { vertices, face: null, offset: null });
  if (vertices.at(-1) !== plotted) showPlots();
  update();
}

function lookAt(eye) {
  state.eye = eye;
  viewer?.look(eye);
  showControls();
}

function showControls() {
  if (viewer) {
    const through = typeof state.eye === "number" ? [chip(data.photos.views[state.eye].name, true, () => lookAt("front"), "Leave the photo (0)")] : [];
    fillGroup("eyes", [...Object.entries(EYES).map(([eye, name]) => chip(name, state.eye === eye, () => lookAt(eye))), ...through]);
    const surfaces = step().coloring ? { colored: "Coloured", ...SURFACES } : SURFACES;
    fillGroup("surfaces", [label("Surface"), ...Object.entries(surfaces).map(([name, title]) => chip(title, state.surface === name, () => { state.surface = name; update(); }))]);
    fillGroup("shapes", [label("Vertices at"), ...Object.entries({ start: "Start", now: "Now", ...(arrays.truth ? { truth: "Truth" } : {}) }).map(([name, title]) => chip(title, state.shape === SHAPES[name], () => { state.shape = SHAPES[name]; update(); }))]);
    fillGroup("layers", Object.entries(data.layers).filter(([name]) => name !== "points" && (name !== "truth" || arrays.truth)).map(([name, title]) => {
      const button = chip(title, state.shown[name], () => { state.shown = { ...state.shown, [name]: !state.shown[name] }; update(); });
      if (data.css[name]) button.prepend(element("i", { style: `background:${data.css[name]}` }));
      return button;
    }));
    $("legend").hidden = !(step().coloring && state.surface === "colored" && viewer.surface === "colored");
  }
  const used = [...new Set(data.steps.slice(0, state.step + 1).map((earlier) => earlier.run))];
  fillGroup("runs", used.length < 2 ? [] : [label("Run"), ...used.map((number) => chip(data.runs[number].name, number === state.run, () => { takeRun(number, Math.min(state.moment, runs[number].record.length)); update(); }, data.runs[number].title))]);
}

// ---------------------------------------------------------------- steps of the lesson

function goToStep(number, isFirst = false) {
  const target = Math.max(0, Math.min(data.steps.length - 1, number));
  if (playback.isOn) playback.play(false);
  state.step = target;
  const found = step();
  Object.assign(state, {
    vertices: [...found.vertices], face: found.face, surface: found.coloring ? "colored" : found.surface, shape: found.shape,
    magnification: found.magnification, shown: { ...found.shown }, cells: { ...found.cells }, offset: null,
  });
  viewer?.compare(found.compared ? runs[found.compared[0]].record.verticesAt(found.compared[1]) : null);
  viewer?.color(found.coloring);
  state.run = -1;
  takeRun(found.run, found.moment);
  if (found.eye !== null && (isFirst || state.eye !== found.eye)) lookAt(found.eye);
  else if (isFirst) lookAt("mesh");
  showText(isFirst);
  update();
  const heading = { "Cells by photo": "cells-heading", "Basis images": "basis-heading" }[found.heading], panel = $("cells-panel");
  panel.scrollTop = heading && getComputedStyle(panel).overflowY === "auto" ? $(heading).offsetTop - panel.offsetTop - 4 : 0;
  if (location.hash !== `#${target + 1}`) history.replaceState(null, "", `#${target + 1}`);
}

function showText(isFirst) {
  const found = step(), count = data.steps.length, n = state.step;
  $("title").textContent = found.title;
  $("text").innerHTML = found.text;
  showQuestion();
  showExperiment();
  $("listing").hidden = found.code === null;
  for (const lines of document.querySelectorAll("[data-lines]")) {
    lines.classList.toggle("at", lines.dataset.lines === found.code);
    lines.toggleAttribute("aria-current", lines.dataset.lines === found.code);
  }
  $("claims").hidden = found.claims.length === 0;
  $("claims").querySelector("summary").textContent = `✓ ${found.claims.length} of ${found.claims.length} claims verified when this page was made`;
  $("claims").querySelector("ul").replaceChildren(...found.claims.map((claim) => element("li", {}, element("code", {}, claim))));
  $("legend").innerHTML = found.coloring?.legend ?? "";
  fillGroup("steps", data.steps.map((each, k) => {
    const button = element("button", { type: "button", className: k < n ? "done" : "", title: `${k + 1}. ${each.title}`, "aria-label": `Step ${k + 1}: ${each.title}`, onclick: () => goToStep(k) });
    if (k === n) button.setAttribute("aria-current", "step");
    return button;
  }));
  $("count").textContent = `${n + 1} / ${count}`;
  $("count").setAttribute("aria-label", `step ${n + 1} of ${count}`);
  $("previous").disabled = n === 0;
  $("next").disabled = n === count - 1;
  if (!isFirst) $("announcement").textContent = `Step ${n + 1} of ${count}: ${found.title}`;
  document.querySelector("article").scrollTop = 0;
  document.querySelector("main").scrollTop = 0;
}

function showQuestion() {
  const { question } = step(), chosen = state.chosen.get(state.step);
  $("question").hidden = question === null;
  if (question === null) return;
  const isAnswered = chosen !== undefined;
  const parts = [element("div", { innerHTML: question.text })];
  question.choices.forEach((choice, k) => {
    if (isAnswered && k !== chosen && k !== question.right) return;
    const mark = !isAnswered ? "" : k === question.right ? "right" : "wrong";
    parts.push(element("button", { type: "button", className: mark, disabled: isAnswered, innerHTML: choice, onclick: () => { state.chosen.set(state.step, k); showQuestion(); $("verdict").focus(); } }));
  });
  if (isAnswered) {
    parts.push(element("p", { id: "verdict", className: "verdict", tabIndex: -1 }, chosen === question.right ? "Right." : "Not quite: the marked answer is right."));
    parts.push(element("div", { innerHTML: question.answer }));
  }
  $("question").replaceChildren(...parts);
}

function showExperiment() {
  const host = $("experiment"), { experiment } = data;
  host.hidden = step().experiment === null || experiment === null;
  if (host.hidden) return;
  host.innerHTML = `<h3></h3><p class="dim"></p>${experiment.charts}<p>${experiment.finding}</p>`;
  host.querySelector("h3").textContent = experiment.title;
  host.querySelector("p").textContent = `${experiment.question} This file contains ${experiment.runs} runs, measured when it was made.`;
}

// ---------------------------------------------------------------- events

const isTyped = ({ target }) => target.matches("select, input, textarea");
const isPressed = ({ target }) => target.closest("button, summary, a, label");

function turnByKey(event) {
  const turns = { ArrowLeft: [-0.12, 0], ArrowRight: [0.12, 0], ArrowUp: [0, 0.12], ArrowDown: [0, -0.12] };
  if (event.key in turns) viewer.turn(...turns[event.key]);
  else if (event.key === "+" || event.key === "=") viewer.zoom(0.9);
  else if (event.key === "-") viewer.zoom(1 / 0.9);
  else return false;
  return true;
}

function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const flip = () => { state.shape = state.shape === SHAPES.start ? SHAPES.now : SHAPES.start; update(); };
  const { " ": space, ...ends } = playback.keys, keys = {
    PageDown: () => goToStep(state.step + 1),
    PageUp: () => goToStep(state.step - 1),
    ...(isTyped(event) ? {} : { ",": () => jump(state.moment - 1), ".": () => jump(state.moment + 1), x: flip, X: flip, ...ends }),
    ...(isTyped(event) || isPressed(event) ? {} : { " ": space }),
  };
  if (viewer && !isTyped(event) && /^[0-9]$/.test(event.key)) {
    const photo = Number(event.key) - 1;
    if (photo < data.photos.views.length) lookAt(photo < 0 ? "front" : photo);
  } else if (viewer && event.target === $("scene") && turnByKey(event)) event.preventDefault();
  else if (event.key in keys) {
    event.preventDefault();
    keys[event.key]();
  }
}

function listen() {
  playback = new Playback({
    length: () => run().record.length,
    rate: () => Math.max(3, run().record.length / PLAY_SECONDS),
    moment: () => state.moment,
    go,
    onStop: showCellsTimed,
  });
  $("next").onclick = () => goToStep(state.step + 1);
  $("previous").onclick = () => goToStep(state.step - 1);
  $("resume").onclick = () => { goToStep(state.step); document.querySelector("article").focus(); };
  $("all-lines").onclick = () => press($("all-lines"), $("listing").classList.toggle("whole"));
  $("k").oninput = () => setDimensions(Number($("k").value));
  for (const button of document.querySelectorAll("[data-page]")) button.onclick = () => { state.cells = { ...state.cells, page: button.dataset.page }; update(); };
  for (const button of document.querySelectorAll("[data-span]")) button.onclick = () => { state.cells = { ...state.cells, span: button.dataset.span }; update(); };
  document.addEventListener("keydown", onKey);
  window.addEventListener("hashchange", () => goToStep(stepInAddress()));
  window.addEventListener("resize", () => { if (state.step >= 0) scheduleCells(); });
  if (!viewer) return;
  viewer.onPick = (vertex) => { if (vertex !== null) select([vertex]); };
  viewer.onLeave = () => { state.eye = "front"; showControls(); };
  viewer.onGrab = (x, y) => {
    const vertex = state.vertices.at(-1), at = vertex === undefined || viewer.through !== null ? null : viewer.place(vertex);
    if (!at || Math.hypot(at[0] - x, at[1] - y) > 22 || !facesOf(vertex).length) return null;
    return (dx, dy) => {
      state.dragging = true;
      moveVertex(viewer.shiftOf(vertex, dx, dy));
    };
  };
  const drop = () => { if (state.dragging) { state.dragging = false; showCellsTimed(); } };
  $("scene").addEventListener("pointerup", drop);
  $("scene").addEventListener("pointercancel", drop);
}

const stepInAddress = () => (Number(location.hash.slice(1)) || 1) - 1;

Object.assign(actions, { update, select, lookAt });

async function open() {
  await unpackLesson();
  viewer = viewOrNote(() => new LessonViewer($("scene"), data, arrays, pictures));
  $("looks").hidden = !viewer;
  listen();
  goToStep(stepInAddress(), true);
  document.body.dataset.ready = "true";
}

openPage(open);

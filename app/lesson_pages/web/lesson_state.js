// The lesson: its data, what the reader has chosen, and what follows from both.
import { PhotoPictures } from "./photo_pictures.js";
import { Cells } from "../../web/cells.js";
import { pageData } from "../../web/page_data.js";
import { facesAround, onGrid, RunRecord, textureCoordinates } from "../../web/record.js";
import { unpack } from "../../web/unpack.js";

export const data = pageData();
export const SHAPES = { start: 0, now: 1, truth: 2 };

export let arrays = null, runs = [], pictures = null; // set by `unpackLesson`

// `offset`: a vertex moved by the reader from its position in the record, {vertex, by} page units; null otherwise.
export const state = {
  step: -1, run: 0, moment: 0, vertices: [], face: null, offset: null, surface: "textured", shape: 1, magnification: 1, shown: {}, cells: {}, eye: "mesh",
  moveBy: 1, chosen: new Map(),
};

export const step = () => data.steps[state.step];
export const isAtStep = () => state.run === step().run && state.moment === step().moment && !state.offset;
export const run = () => runs[state.run];

export async function unpackLesson() {
  await unpack(data);
  data.rgb = Object.fromEntries(Object.entries(data.colors).map(([name, rgb]) => [name, `rgb(${rgb})`]));
  pictures = new PhotoPictures(data.photos.views, data.rgb);
  runs = data.runs.map((each) => {
    const record = new RunRecord(each, data.grid);
    return { record, paths: record.paths(), keyframes: each.keyframes, off: each.off, uv: textureCoordinates(each.keyframes), cells: new Cells({ ...each.cells, photos: data.photos }, data.faces, data.colors) };
  });
  const first = runs[0];
  arrays = { start: first.record.start, truth: data.truth && onGrid(data.truth, data.grid), faces: data.faces, edges: data.edges, cameras: data.cameras, uv: [], paths: first.paths };
  await pictures.ready;
}

export function positions() {
  const vertices = run().record.verticesAt(state.moment);
  if (state.offset) for (let c = 0; c < 3; c++) vertices[3 * state.offset.vertex + c] += state.offset.by[c];
  return vertices;
}

export function surfacePositions() {
  if (state.shape === SHAPES.truth && arrays.truth) return arrays.truth;
  return state.shape === SHAPES.start ? run().record.start : positions();
}

// The cells of a face at a moment; `vertices` default to the shown ones, null are those of the record.
export function cellsOf(face, dimensions = null, moment = state.moment, vertices = undefined) {
  return run().cells.at(face, moment, vertices === undefined ? positions() : vertices ?? run().record.verticesAt(moment), dimensions);
}

export const facesOf = (vertex) => (vertex === undefined ? [] : facesAround(arrays.faces, vertex).filter((f) => run().cells.has(f)));

export function shownFace() {
  const faces = facesOf(state.vertices.at(-1));
  return faces.includes(state.face) ? state.face : faces[0] ?? null;
}

export const point = (vertices, v) => vertices.slice(3 * v, 3 * v + 3);

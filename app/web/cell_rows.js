// The table of the cells of a face: a row a photo, a column a kind of cell. Exported runs and lessons show it.
import { drawCells } from "./cell_picture.js";
import { element } from "./dom.js";

export const GAP = 2; // px between cells

// A photo's number, from 1 as on the keyboard, and its name.
export const photoTitle = (view, name) => `${view + 1} · ${name}`;

// The names of the columns. `columns`: {head, meaning} each.
export function cellHeads(columns, tile) {
  const heads = columns.map(({ head, meaning }) => element("span", { title: meaning }, head));
  return element("div", { className: "heads", style: `grid-template-columns:repeat(${columns.length}, ${tile}px);gap:${GAP}px` }, ...heads);
}

// The row of a photo. `about`: the elements that name it; `kinds`: of its cells; `cellOf`: as for `drawCells`; `label`: for those who
// do not see it; `over`: an element over the cells.
export function cellRow({ view, about, kinds, tile, cellOf, label, over = null }) {
  const ratio = Math.min(2, window.devicePixelRatio || 1), whole = kinds.length * (tile + GAP) - GAP;
  const canvas = element("canvas", { role: "img", "aria-label": label });
  drawCells(canvas, { view, kinds, side: Math.round(tile * ratio), gap: Math.round(GAP * ratio), cellOf });
  const strip = element("div", { className: "strip", style: `width:${whole}px;height:${tile}px` }, canvas, ...(over ? [over] : []));
  return element("div", { className: "cell-row", style: `--strip:${whole}px` }, element("div", { className: "about" }, ...about), strip);
}

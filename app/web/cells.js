// The cells of a face at any moment, computed from the photos, and their pictures.
import { CELL_COLORS } from "./cell_picture.js";
import { fitEigenspace, weigh } from "./eigenspace.js";
import { Photos } from "./photos.js";

export class Cells {
  // `cells`: the data of page_cells.py, unpacked; `faces`: corners of all faces.
  constructor(cells, faces, colors) {
    Object.assign(this, { cells, faces, colors, rows: new Map(cells.faces.map((face, row) => [face, row])), views: new Map() });
    this.photos = new Photos(cells.photos, cells.affine);
  }

  // Whether the file contains cells of a face at any moment.
  has(face) { return this.rows.has(face) && this.viewsOf(face).length > 0; }

  // Number of photos used for a face at a moment.
  photosOf(face, moment) {
    const { k, starts } = this.cells.sweeps, at = this.number(face, this.cells.sweepAt[moment]);
    return k[at] ? starts[at + 1] - starts[at] : 0;
  }

  // Photos that see the face at some moment, in ascending order.
  viewsOf(face) {
    if (!this.views.has(face)) {
      const found = new Set(), { starts, views, level, k } = this.cells.sweeps;
      for (let sweep = 0; sweep < level.length; sweep++) {
        const at = this.number(face, sweep);
        if (k[at]) for (let pair = starts[at]; pair < starts[at + 1]; pair++) found.add(views[pair]);
      }
      this.views.set(face, [...found].sort((a, b) => a - b));
    }
    return this.views.get(face);
  }

  number(face, sweep) { return sweep * this.cells.faces.length + this.rows.get(face); }

  // The cells at a moment with the given vertices and number of dimensions, by default that of the run; null if the face
  // is not used.
  at(face, moment, vertices, dimensions = null) {
    const { sweeps, sweepAt, scales, photos } = this.cells, sweep = sweepAt[moment], at = this.number(face, sweep);
    const own = sweeps.k[at], size = sweeps.size[at], p = size * (size + 1) / 2;
    if (!own) return null;
    const k = Math.min(dimensions ?? own, sweeps.starts[at + 1] - sweeps.starts[at] - 2);
    const points = new Float32Array(9);
    for (let c = 0; c < 3; c++) points.set(vertices.subarray(3 * this.faces[3 * face + c], 3 * this.faces[3 * face + c] + 3), 3 * c);
    const observed = [], counts = [], views = [], weight = [];
    for (let pair = sweeps.starts[at]; pair < sweeps.starts[at + 1]; pair++) {
      const cell = new Float32Array(p * photos.channels);
      const place = { view: sweeps.views[pair], blur: sweeps.blur.subarray(3 * pair, 3 * pair + 3), key: pair };
      if (!this.photos.sample(place, points, size, sweeps.inset[at], sweeps.cubic[sweep], sweeps.common[sweep], cell)) return null;
      observed.push(cell);
      counts.push(this.mask(pair, p));
      views.push(sweeps.views[pair]);
      weight.push(sweeps.weight[pair]);
    }
    const fitted = fitEigenspace(observed, counts, k, this.cells);
    const weighed = fitted.residual.map((residual) => weigh(residual, this.cells.norm, sweeps.scale[at]));
    const energies = weighed.map(({ total }, i) => weight[i] * total);
    return {
      ...fitted, counts, views, energies, k, own, size, pairWeight: weight, scale: scales[this.rows.get(face)],
      weight: weighed.map(({ weights }) => weights),
      sigma: Math.sqrt(sweeps.scale[at]),
      energy: energies.reduce((sum, energy) => sum + energy, 0),
      threshold: (this.cells.threshold ?? Infinity) * Math.sqrt(sweeps.scale[at]),
    };
  }

  // The energy of a face with k dimensions, from its cells `found` with any other k.
  energyWith(found, k) {
    if (k === found.k) return found.energy;
    const { residual } = fitEigenspace(found.observed, found.counts, k, this.cells);
    return residual.reduce((sum, e, row) => sum + found.pairWeight[row] * weigh(e, this.cells.norm, found.sigma ** 2).total, 0);
  }

  // Mask of a pair: a byte per sample and channel, 1 if it counts; null if all samples count.
  mask(pair, p) {
    const { masks, maskStarts } = this.cells.sweeps, first = maskStarts[pair];
    if (first === maskStarts[pair + 1]) return null;
    const { channels } = this.cells.photos, counts = new Uint8Array(p * channels);
    for (let t = 0; t < p; t++) {
      const counted = (masks[first + (t >> 3)] >> (7 - (t & 7))) & 1;
      for (let k = 0; k < channels; k++) counts[k * p + t] = counted;
    }
    return counts;
  }

  // For `drawCells`: a function from a photo and a kind to the cell; null where the photo has none.
  pictures(found) {
    const paint = this.painters(found), { size } = found;
    return (view, kind) => {
      const i = found.views.indexOf(view), values = found[kind === "norm" ? "residual" : kind][i];
      if (i < 0) return null;
      const counts = kind === "observed" || kind === "reconstruction" ? null : found.counts[i];
      return { size, color: (s) => (counts && !counts[s] ? CELL_COLORS.masked : paint[kind](values[s], i, s)) };
    };
  }

  // For each kind a function from value to colour, with scales common to all photos, as in app/pictures/cell_images.py.
  painters(found) {
    const seen = [], every = Math.max(1, Math.floor(found.observed[0].length * found.observed.length / 20000));
    found.observed.forEach((cell, i) => { for (let t = i % every; t < cell.length; t += every) if (!found.counts[i] || found.counts[i][t]) seen.push(cell[t]); });
    const sorted = Float64Array.from(seen).sort();
    const dark = sorted[Math.floor(0.005 * seen.length)], bright = Math.max(sorted[Math.floor(0.995 * seen.length)], dark + 8);
    const most = Math.max(...found.weight.map((weights) => weights.reduce((a, b) => Math.max(a, b), 0)), 1e-12);
    const grey = (value) => [value, value, value];
    const stretched = (value) => grey(Math.min(255, Math.max(0, (value - dark) * 255 / (bright - dark))));
    const { now, truth, selected } = this.colors;
    return {
      observed: stretched,
      reconstruction: stretched,
      residual: (value) => {
        const strength = Math.sqrt(Math.min(1, Math.abs(value) / found.scale.residual));
        return (value < 0 ? truth : now).map((part) => (1 - strength) * CELL_COLORS.zero + strength * part);
      },
      norm: (value) => heat(this.rho(value, found) / this.rho(Math.min(found.threshold, 3 * found.sigma) * 2, found)),
      weight: (value, i, s) => (Math.abs(found.residual[i][s]) > found.threshold ? selected : grey(230 * value / most)),
    };
  }

  rho(value, found) { return weigh([value], this.cells.norm, found.sigma ** 2).total; }
}

// Colour of a share from 0 (black) to 1 (pale yellow), close to the colour map inferno.
const HEAT = [[0, 0, 4], [40, 11, 84], [101, 21, 110], [159, 42, 99], [212, 72, 66], [245, 125, 21], [250, 193, 39], [252, 255, 164]];
function heat(share) {
  const at = Math.min(1, Math.max(0, share)) * (HEAT.length - 1), i = Math.min(HEAT.length - 2, Math.floor(at));
  return HEAT[i].map((low, c) => low + (at - i) * (HEAT[i + 1][c] - low));
}

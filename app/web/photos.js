// Photos: stored as tiles, blurred around a face with the sweep's blur, and sampled into cells.
// Mirrors fairing/cells/scale_space.py, point_spread.py, fairing/kernels/sampling.py, and `mean_difference` of
// app/pictures/photo_crops.py.
import { filtered } from "./fourier.js";

const AROUND = 8; // px around the face that are blurred as well, so that the next moments of the sweep can reuse the part
const MOST_PARTS = 600; // blurred parts in the cache
const LUMA = [0.299, 0.587, 0.114]; // of red, green, blue
const DIFFERENCE_SAMPLES = 100; // along a leg of the face, see `difference`
const POLE = Math.sqrt(3) - 2; // pole of the inverse filter of the cubic B-spline

export class Photos {
  // `photos`: the data of page_cells.py, unpacked; `affine`: whether the warp is affine.
  constructor(photos, affine) {
    Object.assign(this, { photos, affine, parts: new Map() });
    for (const view of photos.views.filter(({ at }) => !at)) { // the tiles of several runs are decoded once
      view.at = new Map(Array.from(view.tiles ?? [], (number, k) => [number, k]));
      for (let i = 1; i < (view.pixels?.length ?? 0); i++) view.pixels[i] += view.pixels[i - 1];
    }
  }

  // Homogeneous pixels of the three corners `points` (3 x 3), page units; null if a corner lies behind the camera.
  corners(view, points) {
    const P = this.photos.views[view].imageFromPage, q = [];
    for (let c = 0; c < 3; c++) {
      const [x, y, z] = points.subarray(3 * c, 3 * c + 3);
      const w = P[8] * x + P[9] * y + P[10] * z + P[11];
      const u = [P[0] * x + P[1] * y + P[2] * z + P[3], P[4] * x + P[5] * y + P[6] * z + P[7], w];
      q.push(this.affine ? [u[0] / w, u[1] / w, 1] : u);
      if (w <= 0) return null;
    }
    return q;
  }

  // Writes the cell of a face into `cell` (channels * p). `pair`: {view, blur: [xx, xy, yy], key}. False behind the camera.
  sample(pair, points, size, inset, cubic, isFourier, cell) {
    const q = this.corners(pair.view, points);
    if (!q) return false;
    const { width, height } = this.photos.views[pair.view], { channels } = this.photos;
    const pixels = q.map(([x, y, w]) => [x / w, y / w]);
    const part = this.part(pair, pixels, cubic, isFourier);
    const shrink = 1 - 3 * inset, p = size * (size + 1) / 2;
    for (let r = 0, s = 0; r < size; r++) {
      for (let c = 0; c + r < size; c++, s++) {
        const a = inset + shrink * (c + 1 / 3) / size, b = inset + shrink * (r + 1 / 3) / size, g = 1 - a - b;
        const w = a * q[0][2] + b * q[1][2] + g * q[2][2];
        const x = Math.min(Math.max((a * q[0][0] + b * q[1][0] + g * q[2][0]) / w, 1), width - 2.001) - part.left;
        const y = Math.min(Math.max((a * q[0][1] + b * q[1][1] + g * q[2][1]) / w, 1), height - 2.001) - part.top;
        for (let k = 0; k < channels; k++) cell[k * p + s] = cubic ? spline(part, k, x, y) : bilinear(part, k, x, y);
      }
    }
    return true;
  }

  // Mean absolute difference in luma between a face in photos i and j as taken, grey levels; NaN where pixels are missing.
  difference(i, j, points) {
    const one = this.corners(i, points), other = this.corners(j, points), size = DIFFERENCE_SAMPLES;
    if (!one || !other) return NaN;
    let total = 0, count = 0;
    for (let r = 0; r < size; r++) {
      for (let c = 0; c + r < size; c++) {
        const a = (c + 1 / 3) / size, b = (r + 1 / 3) / size;
        const [p, q] = [[i, one], [j, other]].map(([view, [s, t, u]]) => {
          const [x, y, w] = s.map((_, k) => a * s[k] + b * t[k] + (1 - a - b) * u[k]);
          return this.luma(view, x / w, y / w);
        });
        if (p === null || q === null) continue;
        total += Math.abs(p - q);
        count++;
      }
    }
    return total / count;
  }

  // Luma of a photo as taken, by bilinear interpolation; null outside the photo, NaN where its tile is not in the file.
  luma(view, x, y) {
    const { tile, channels, unit, views } = this.photos, photo = views[view], { width, height } = photo;
    if (!(x >= 0 && y >= 0 && x <= width - 1 && y <= height - 1)) return null;
    const left = Math.min(Math.floor(x), width - 2), top = Math.min(Math.floor(y), height - 2), across = Math.ceil(width / tile), area = tile * tile;
    const pixel = (column, row) => {
      const number = photo.at.get(Math.floor(row / tile) * across + Math.floor(column / tile));
      if (number === undefined) return NaN;
      const at = number * channels * area + (row % tile) * tile + column % tile;
      return unit * (channels === 1 ? photo.pixels[at] : LUMA.reduce((sum, share, k) => sum + share * photo.pixels[at + k * area], 0));
    };
    const above = pixel(left, top) + (x - left) * (pixel(left + 1, top) - pixel(left, top));
    const below = pixel(left, top + 1) + (x - left) * (pixel(left + 1, top + 1) - pixel(left, top + 1));
    return above + (y - top) * (below - above);
  }

  // The blurred part of a photo around a face: {left, top, width, height, planes}. Cached while it contains the face.
  part(pair, pixels, cubic, isFourier) {
    const { width, height } = this.photos.views[pair.view];
    const range = (axis, end) => {
      const at = pixels.map((pixel) => Math.min(Math.max(pixel[axis], 0), end - 1));
      return [Math.max(0, Math.floor(Math.min(...at)) - 2), Math.min(end, Math.ceil(Math.max(...at)) + 4)];
    };
    const [[left, right], [top, bottom]] = [range(0, width), range(1, height)];
    const kept = this.parts.get(pair.key);
    if (kept && kept.left <= left && kept.top <= top && kept.left + kept.width >= right && kept.top + kept.height >= bottom) return kept;
    const box = { left: Math.max(0, left - AROUND), top: Math.max(0, top - AROUND) };
    box.width = Math.min(width, right + AROUND) - box.left;
    box.height = Math.min(height, bottom + AROUND) - box.top;
    const [xx, xy, yy] = pair.blur;
    if (isFourier) this.blurAskew(pair.view, box, xx, xy, yy, cubic);
    else this.blurEven(pair.view, box, evenKernel(Math.sqrt(xx), cubic));
    if (this.parts.size >= MOST_PARTS) this.parts.clear();
    this.parts.set(pair.key, box);
    return box;
  }

  // A box of a photo with a border of `border` px, mirrored at the photo's edge: one plane of grey levels per channel.
  cut(view, { left, top, width, height }, border) {
    const { tile, channels, unit, views } = this.photos, photo = views[view];
    const across = Math.ceil(photo.width / tile), area = tile * tile;
    const mirrored = (at, end) => { at = Math.abs(at); return Math.max(0, at >= end ? 2 * end - 2 - at : at); };
    const wide = width + 2 * border, high = height + 2 * border, columns = new Int32Array(wide);
    for (let x = 0; x < wide; x++) columns[x] = mirrored(left + x - border, photo.width);
    const planes = Array.from({ length: channels }, () => new Float32Array(wide * high));
    for (let y = 0; y < high; y++) {
      const row = mirrored(top + y - border, photo.height), first = Math.floor(row / tile) * across;
      for (let x = 0; x < wide; x++) {
        const number = photo.at.get(first + Math.floor(columns[x] / tile));
        if (number === undefined) continue;
        const at = number * channels * area + (row % tile) * tile + columns[x] % tile;
        for (let k = 0; k < channels; k++) planes[k][y * wide + x] = photo.pixels[at + k * area] * unit;
      }
    }
    return { planes, wide, high };
  }

  blurEven(view, box, kernel) {
    const border = (kernel.length - 1) / 2, { planes, wide, high } = this.cut(view, box, border);
    box.planes = planes.map((plane) => {
      const between = new Float32Array(box.width * high), blurred = new Float32Array(box.width * box.height);
      for (let y = 0; y < high; y++)
        for (let k = 0; k < kernel.length; k++)
          for (let x = 0, from = y * wide + k, to = y * box.width; x < box.width; x++) between[to + x] += kernel[k] * plane[from + x];
      for (let y = 0; y < box.height; y++)
        for (let k = 0; k < kernel.length; k++)
          for (let x = 0, from = (y + k) * box.width, to = y * box.width; x < box.width; x++) blurred[to + x] += kernel[k] * between[from + x];
      return blurred;
    });
  }

  // By a Gaussian with covariance [[xx, xy], [xy, yy]], exactly, as point_spread.py.
  blurAskew(view, box, xx, xy, yy, cubic) {
    const border = Math.ceil(3.5 * Math.sqrt(xx + yy)) + 3, { planes, wide, high } = this.cut(view, box, border);
    const response = (w) => (cubic ? (2 + Math.cos(w)) / 3 : 1);
    box.planes = planes.map((plane) => {
      filtered(plane, wide, high, (wx, wy) => Math.exp(-0.5 * (xx * wx * wx + 2 * xy * wx * wy + yy * wy * wy)) / (response(wx) * response(wy)));
      const inner = new Float32Array(box.width * box.height);
      for (let y = 0; y < box.height; y++) inner.set(plane.subarray((y + border) * wide + border, (y + border) * wide + border + box.width), y * box.width);
      return inner;
    });
  }
}

// Samples of a Gaussian; with `cubic`, convolved with the filter that yields B-spline coefficients.
function evenKernel(sigma, cubic) {
  const gauss = sampledGaussian(sigma);
  if (!cubic) return gauss;
  const reach = (gauss.length - 1) / 2, radius = reach + 8, kernel = new Float64Array(2 * radius + 1);
  for (let i = 0; i < gauss.length; i++)
    for (let j = -8; j <= 8; j++) kernel[i + 8 + j] += gauss[i] * Math.sqrt(3) * POLE ** Math.abs(j);
  return kernel;
}

function sampledGaussian(sigma) {
  const radius = sigma > 0 ? Math.ceil(4 * sigma) : 0;
  const values = Float64Array.from({ length: 2 * radius + 1 }, (_, i) => (radius ? Math.exp(-((i - radius) ** 2) / (2 * sigma * sigma)) : 1));
  const total = values.reduce((sum, value) => sum + value, 0);
  return values.map((value) => value / total);
}

function bilinear({ planes, width }, k, x, y) {
  const plane = planes[k], i = Math.floor(x), j = Math.floor(y), fx = x - i, fy = y - j, at = j * width + i;
  const above = plane[at] + fx * (plane[at + 1] - plane[at]), below = plane[at + width] + fx * (plane[at + width + 1] - plane[at + width]);
  return above + fy * (below - above);
}

function spline({ planes, width }, k, x, y) {
  const plane = planes[k], i = Math.floor(x), j = Math.floor(y), f = x - i, g = y - j, r = 1 - f, q = 1 - g;
  const a = r * r * r / 6, b = (4 - 3 * f * f * (2 - f)) / 6, d = f * f * f / 6, c = 1 - a - b - d;
  const A = q * q * q / 6, B = (4 - 3 * g * g * (2 - g)) / 6, D = g * g * g / 6, C = 1 - A - B - D;
  const row = (at) => a * plane[at] + b * plane[at + 1] + c * plane[at + 2] + d * plane[at + 3], at = (j - 1) * width + i - 1;
  return A * row(at) + B * row(at + width) + C * row(at + 2 * width) + D * row(at + 3 * width);
}

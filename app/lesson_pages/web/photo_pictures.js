// Pictures cut from the photos: the faces of a vertex in each photo, and a face in two photos (the paper's figures 2, 4a, 4d).
// Mirrors app/pictures/photo_crops.py and app/panels/photo_pages.py.
import { cross, dot } from "../../web/vectors.js";

const CROP_SIDE = 200, PAIR_SIDE = 260; // px of the canvases
const DIMMED = 0.35; // brightness of a photo outside the face
const OUTSIDE = 40; // grey level outside a photo
const ARROW_HEAD = 7; // px

export class PhotoPictures {
  // `rgb`: CSS colours by name.
  constructor(views, rgb) {
    Object.assign(this, { views, rgb, cached: new Map() });
    this.images = views.map(({ picture }) => Object.assign(new Image(), { src: picture }));
    this.ready = Promise.all(this.images.map((image) => image.decode()));
  }

  // Pixel of a point (page units): [u, v, depth].
  pixel(view, [x, y, z]) {
    const P = this.views[view].imageFromPage, w = P[8] * x + P[9] * y + P[10] * z + P[11];
    return [(P[0] * x + P[1] * y + P[2] * z + P[3]) / w, (P[4] * x + P[5] * y + P[6] * z + P[7]) / w, w];
  }

  pixelsOf(view) {
    if (!this.cached.has(view)) {
      const { width, height } = this.views[view], canvas = Object.assign(document.createElement("canvas"), { width, height });
      const context = canvas.getContext("2d");
      context.drawImage(this.images[view], 0, 0);
      this.cached.set(view, context.getImageData(0, 0, width, height));
    }
    return this.cached.get(view);
  }

  // A square window {left, top, span} of a photo around pixels.
  window(pixels, margin, least = 16) {
    const range = (axis) => { const at = pixels.map((p) => p[axis]); return [Math.min(...at), Math.max(...at)]; };
    const [x, y] = [range(0), range(1)], span = Math.max(least, Math.ceil((1 + 2 * margin) * Math.max(x[1] - x[0], y[1] - y[0])));
    return { left: Math.round((x[0] + x[1]) / 2 + 0.5 - span / 2), top: Math.round((y[0] + y[1]) / 2 + 0.5 - span / 2), span };
  }

  // A photo with lines over it. `shown`: {start, now} (faces of 3 points), path (points), step ([before, after] or null).
  crop(view, { start, now, path, step }, span, arrows) {
    const place = (points) => points.map((point) => this.pixel(view, point));
    const [before, after, along] = [start.map(place), now.map(place), place(path)];
    const tail = step && this.pixel(view, step[0]), head = step && this.pixel(view, step[1]);
    const tip = step && [tail[0] + arrows * (head[0] - tail[0]), tail[1] + arrows * (head[1] - tail[1])];
    const around = span === "faces" ? [...before, ...after].flat() : [...along, ...(step ? [tail, tip] : [])];
    const box = this.window(around, span === "faces" ? 0.06 : 0.3), scale = CROP_SIDE / box.span;
    const at = ([u, v]) => [(u + 0.5 - box.left) * scale, (v + 0.5 - box.top) * scale];
    const canvas = Object.assign(document.createElement("canvas"), { width: CROP_SIDE, height: CROP_SIDE }), context = canvas.getContext("2d");
    if (!context) return canvas;
    context.fillStyle = `rgb(${OUTSIDE},${OUTSIDE},${OUTSIDE})`;
    context.fillRect(0, 0, CROP_SIDE, CROP_SIDE);
    context.drawImage(this.images[view], -box.left * scale, -box.top * scale, this.views[view].width * scale, this.views[view].height * scale);
    const line = (points, color, width, closed) => {
      context.beginPath();
      points.map(at).forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
      if (closed) context.closePath();
      Object.assign(context, { strokeStyle: color, lineWidth: width, lineJoin: "round" });
      context.stroke();
    };
    const { start: green, now: red, selected } = this.rgb;
    before.forEach((face) => line(face, green, 1.5, true));
    after.forEach((face) => line(face, red, 1.5, true));
    line(along, red, 3, false);
    const [x, y] = at(along.at(-1));
    context.beginPath();
    context.arc(x, y, 4, 0, 2 * Math.PI);
    context.fillStyle = red;
    context.fill();
    if (step) {
      line([tail, tip], selected, 2.5, false);
      const [a, b] = [at(tail), at(tip)], length = Math.hypot(b[0] - a[0], b[1] - a[1]);
      if (length > 3) {
        const h = Math.min(ARROW_HEAD, 0.5 * length) / length, d = [h * (b[0] - a[0]), h * (b[1] - a[1])];
        context.beginPath();
        context.moveTo(b[0] - d[0] - 0.6 * d[1], b[1] - d[1] + 0.6 * d[0]);
        context.lineTo(b[0], b[1]);
        context.lineTo(b[0] - d[0] + 0.6 * d[1], b[1] - d[1] - 0.6 * d[0]);
        context.stroke();
      }
    }
    return canvas;
  }

  // The 3 x 3 matrix from barycentric weights of a face's corners to homogeneous pixels of a photo.
  cornersOf(view, corners, affine) {
    const q = corners.map((corner) => this.pixel(view, corner));
    if (q.some(([, , w]) => w <= 0)) return null;
    return [0, 1, 2].map((row) => q.map(([u, v, w]) => [u, v, 1][row] * (affine ? 1 : w)));
  }

  // A face in photos i and j, in a window of photo j: canvases {average, warped, own}; null behind a camera.
  pair(i, j, corners, box, affine, color) {
    const one = this.cornersOf(i, corners, affine), other = this.cornersOf(j, corners, affine);
    if (!one || !other) return null;
    const inverse = inverted(other), [first, second] = [this.pixelsOf(i), this.pixelsOf(j)], side = PAIR_SIDE, step = box.span / side;
    const canvases = Object.fromEntries(["average", "warped", "own"].map((name) => [name, Object.assign(document.createElement("canvas"), { width: side, height: side })]));
    const images = Object.fromEntries(Object.keys(canvases).map((name) => [name, new ImageData(side, side)]));
    const a = [0, 0, 0], b = [0, 0, 0];
    for (let y = 0; y < side; y++)
      for (let x = 0; x < side; x++) {
        const u = box.left - 0.5 + (x + 0.5) * step, v = box.top - 0.5 + (y + 0.5) * step;
        const bary = inverse.map((row) => row[0] * u + row[1] * v + row[2]);
        const isInside = bary[0] >= 0 && bary[1] >= 0 && bary[2] >= 0, at = 4 * (y * side + x);
        readPixel(second, u, v, b);
        if (isInside) {
          const [p, q, w] = one.map((row) => row[0] * bary[0] + row[1] * bary[1] + row[2] * bary[2]);
          readPixel(first, p / w, q / w, a);
        }
        for (let c = 0; c < 3; c++) {
          images.own.data[at + c] = isInside ? b[c] : DIMMED * b[c];
          images.average.data[at + c] = isInside ? (a[c] + b[c]) / 2 : DIMMED * b[c];
          images.warped.data[at + c] = isInside ? a[c] : 0.5 * OUTSIDE;
        }
        for (const image of Object.values(images)) image.data[at + 3] = 255;
      }
    const outline = corners.map((corner) => this.pixel(j, corner)).map(([u, v]) => [(u + 0.5 - box.left) / step, (v + 0.5 - box.top) / step]);
    for (const [name, canvas] of Object.entries(canvases)) {
      const context = canvas.getContext("2d");
      if (!context) continue;
      context.putImageData(images[name], 0, 0);
      context.beginPath();
      outline.forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
      context.closePath();
      Object.assign(context, { strokeStyle: color, lineWidth: 1.5 });
      context.stroke();
    }
    return canvases;
  }
}

// The colour of a photo at a pixel by bilinear interpolation, into `into`; grey outside.
function readPixel({ data: values, width, height }, u, v, into) {
  if (!(u >= 0 && v >= 0 && u <= width - 1.001 && v <= height - 1.001)) { into.fill(OUTSIDE); return; }
  const x = Math.floor(u), y = Math.floor(v), f = u - x, g = v - y, at = 4 * (y * width + x), down = 4 * width;
  for (let c = 0; c < 3; c++) {
    const above = values[at + c] + f * (values[at + 4 + c] - values[at + c]), below = values[at + down + c] + f * (values[at + down + 4 + c] - values[at + down + c]);
    into[c] = above + g * (below - above);
  }
}

// The inverse of a 3 x 3 matrix of rows, up to a positive scale.
function inverted([a, b, c]) {
  const rows = [cross(b, c), cross(c, a), cross(a, b)], sign = Math.sign(dot(a, rows[0])) || 1;
  return [0, 1, 2].map((row) => rows.map((column) => sign * column[row]));
}

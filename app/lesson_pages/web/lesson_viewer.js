// The 3D view of a lesson: the mesh of any run, textured by the page from the photos, views through a camera, and moved vertices.
import { add, scale, unit } from "../../web/vectors.js";
import { attribute, corners, edgeLines, FIELD_OF_VIEW, fill, program, release, Viewer } from "../../web/viewer.js";

const MOST_PHOTOS = 32; // of a texture made by the page
const PHOTO_SIDE = 1024; // px, largest
const ROBUST_SCALE = 40; // grey levels: photos that differ more from the mean count less

const PHOTO_MESH_VERTEX = `#version 300 es
in vec3 position; in float face;
uniform mat4 clipFromPage;
out vec3 place; flat out int faceId;
void main() { place = position; faceId = int(face + 0.5); gl_Position = clipFromPage * vec4(position, 1.0); }`;

// The mean of all photos that see the face, weighted by their resolution; a second pass reduces the weight of outliers.
const photoMeshFragment = (count) => `#version 300 es
precision highp float; precision highp sampler2DArray;
in vec3 place; flat in int faceId;
uniform sampler2DArray photos; uniform sampler2D weights; uniform vec4 rows[${3 * count}]; uniform vec2 sizes[${count}];
uniform bool textured; uniform vec3 eye;
out vec4 color;
void main() {
  vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
  vec3 flatColor = vec3(0.24, 0.25, 0.27) + 0.42 * abs(dot(normal, normalize(eye - place)));
  if (!textured) { color = vec4(flatColor, 1.0); return; }
  vec4 p = vec4(place, 1.0);
  vec3 seen[${count}]; float share[${count}];
  vec3 mean = vec3(0.0); float total = 0.0;
  for (int i = 0; i < ${count}; i++) {
    float w = dot(rows[3 * i + 2], p);
    vec2 uv = (vec2(dot(rows[3 * i], p), dot(rows[3 * i + 1], p)) / w + 0.5) / sizes[i];
    share[i] = w > 0.0 ? texelFetch(weights, ivec2(i, faceId), 0).r : 0.0;
    seen[i] = texture(photos, vec3(uv, float(i))).rgb;
    mean += share[i] * seen[i]; total += share[i];
  }
  if (total <= 0.0) { color = vec4(flatColor, 1.0); return; }
  mean /= total;
  for (int round = 0; round < 2; round++) {
    vec3 sum = vec3(0.0); float all = 0.0;
    for (int i = 0; i < ${count}; i++) {
      float off = length(seen[i] - mean) / ${(ROBUST_SCALE / 255).toFixed(4)}, weight = share[i] / ((1.0 + off * off) * (1.0 + off * off));
      sum += weight * seen[i]; all += weight;
    }
    mean = sum / all;
  }
  color = vec4(mean, 1.0);
}`;

const COLORED_VERTEX = `#version 300 es
in vec3 position; in vec2 uv; uniform mat4 clipFromPage; out vec2 at;
void main() { at = uv; gl_Position = clipFromPage * vec4(position, 1.0); }`;
const COLORED_FRAGMENT = `#version 300 es
precision highp float; in vec2 at; uniform sampler2D picture; out vec4 color;
void main() { color = vec4(texture(picture, at).rgb, 1.0); }`;

const PHOTO_VERTEX = `#version 300 es
uniform vec2 extent; out vec2 at;
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  at = vec2(corner.x, 1.0 - corner.y); gl_Position = vec4((2.0 * corner - 1.0) * extent, 0.9999, 1.0);
}`;
const PHOTO_FRAGMENT = `#version 300 es
precision highp float; precision highp sampler2DArray; in vec2 at; uniform sampler2DArray photos; uniform float layer; out vec4 color;
void main() { color = vec4(texture(photos, vec3(at, layer)).rgb, 1.0); }`;

export class LessonViewer extends Viewer {
  // `lesson`: the data of page_data.py; `arrays`: those of its first run; `pictures`: its photos. Throws an error without WebGL 2.
  constructor(canvas, lesson, arrays, pictures) {
    super(canvas, { ...lesson, keyframes: [], pace: [0] }, arrays);
    const { gl } = this;
    this.views = lesson.photos.views;
    this.pictures = pictures;
    this.coloredProgram = program(gl, COLORED_VERTEX, COLORED_FRAGMENT);
    this.photoProgram = program(gl, PHOTO_VERTEX, PHOTO_FRAGMENT);
    this.count = Math.min(this.views.length, MOST_PHOTOS);
    this.photoMeshProgram = program(gl, PHOTO_MESH_VERTEX, photoMeshFragment(this.count));
    this.faceIds = this.buffer(Float32Array.from(this.faces, (_, i) => Math.floor(i / 3)));
    this.weights = gl.createTexture();
    this.photos = this.photoLayers();
    this.surface = "textured";
    this.through = null;
    this.colored = null;
    this.textures = new Map();
    this.wireframes.reference = this.lines(new Float32Array(3 * this.edges.length));
  }

  photoLayers() {
    const { gl } = this, layers = gl.createTexture();
    const largest = Math.max(...this.views.flatMap(({ width, height }) => [width, height])), shrink = Math.min(1, PHOTO_SIDE / largest);
    const [width, height] = ["width", "height"].map((side) => Math.round(shrink * Math.max(...this.views.map((view) => view[side]))));
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, layers);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, Math.floor(Math.log2(Math.max(width, height))) + 1, gl.RGBA8, width, height, this.views.length);
    const canvas = Object.assign(document.createElement("canvas"), { width, height }), context = canvas.getContext("2d");
    this.pictures.images.forEach((image, layer) => {
      context.drawImage(image, 0, 0, width, height);
      gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, layer, width, height, 1, gl.RGBA, gl.UNSIGNED_BYTE, canvas);
    });
    gl.generateMipmap(gl.TEXTURE_2D_ARRAY);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    return layers;
  }

  // Shows another run: {record, paths, keyframes, uv}.
  take(run) {
    this.data = { ...this.data, pace: run.record.pace };
    this.run = run;
    this.startVertices = run.record.start;
    fill(this.gl, this.wireframes.start.ends, edgeLines(run.record.start, this.edges));
    this.pathCount = run.paths.count;
    for (const buffer of [this.paths.ends, this.paths.when]) this.gl.deleteBuffer(buffer);
    this.paths = this.lines(run.paths.lines, run.paths.when);
    if (!this.textures.has(run)) this.textures.set(run, run.keyframes.map((keyframe, k) => this.keyframe(keyframe, run.uv[k])));
    this.keyframes = this.textures.get(run);
  }

  // The state of the page: `vertices` of the surface, `now` of edges and dots (all (3 n), page units), `weights` (photos x faces)
  // of the texture, magnification of the paths.
  present({ moment, vertices, now, weights, magnification }) {
    const { gl } = this;
    this.moment = moment;
    this.now = now;
    this.blend = this.keyframes.length ? this.run.record.blendAt(moment, this.run.keyframes) : null;
    fill(gl, this.nowMesh, corners(vertices, this.faces));
    fill(gl, this.dots, now);
    fill(gl, this.wireframes.wire.ends, edgeLines(now, this.edges));
    const { lines, owner } = this.run.paths, ends = lines.slice();
    owner.forEach((v, i) => {
      for (let e = 0; e < 6; e++) ends[6 * i + e] = now[3 * v + e % 3] + magnification * (lines[6 * i + e] - now[3 * v + e % 3]);
    });
    fill(gl, this.paths.ends, ends);
    if (weights) {
      gl.bindTexture(gl.TEXTURE_2D, this.weights);
      gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, this.views.length, this.faces.length / 3, 0, gl.RED, gl.UNSIGNED_BYTE, weights);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    }
    this.redraw();
  }

  compare(vertices) {
    this.isCompared = vertices !== null;
    if (vertices) fill(this.gl, this.wireframes.reference.ends, edgeLines(vertices, this.edges));
  }

  // Lines (6 n) of certainty ellipsoids; null for none.
  showEllipsoids(ends) { this.wireframes.certainty = ends && this.lines(ends); }

  // A surface coloured by a quantity: {corners, uv, picture}; null for none.
  color(coloring) {
    if (!coloring) { this.colored = null; return; }
    const uv = Float32Array.from(coloring.uv, (number) => number / 65535);
    this.colored = { ...this.keyframe(coloring, uv), corners: this.buffer(coloring.corners), count: coloring.corners.length / 3 };
    this.gl.bindTexture(this.gl.TEXTURE_2D, this.colored.texture);
    this.gl.texParameteri(this.gl.TEXTURE_2D, this.gl.TEXTURE_MIN_FILTER, this.gl.LINEAR);
  }

  // A viewpoint: "mesh", "front", "cameras", or the number of a photo.
  look(eye) {
    const { stage } = this.data;
    this.through = typeof eye === "number" ? eye : null;
    if (this.through === null) {
      this.target = [0, 0, 0];
      this.offset = eye === "cameras" ? [...stage.overview] : scale(unit(stage[eye]), this.fittingDistance(unit(stage[eye])));
      this.up = stage.up;
    }
    this.eye = eye;
    this.redraw();
  }

  // In a low view, the buttons over it cover a larger part.
  fittingDistance(back) { return super.fittingDistance(back) * (this.canvas.clientHeight < 380 ? 1.2 : 1); }

  home() {
    this.up = this.data.stage.up;
    if (this.pictures) this.look("mesh");
    else super.home();
  }

  leavePhoto() {
    if (this.through === null) return;
    this.look("front");
    this.onLeave?.();
  }

  turn(sideways, over) { this.leavePhoto(); super.turn(sideways, over); }
  pan(dx, dy) { this.leavePhoto(); super.pan(dx, dy); }
  zoom(factor) { this.leavePhoto(); super.zoom(factor); }

  // Share of the canvas that the photo looked through covers, in x and y.
  photoExtent(aspect) {
    const { width, height } = this.views[this.through], own = width / height;
    return own > aspect ? [1, aspect / own] : [own / aspect, 1];
  }

  clipFromPage(aspect) {
    if (this.through === null || this.through === undefined) return super.clipFromPage(aspect);
    const { imageFromPage: P, width, height } = this.views[this.through], [wide, high] = this.photoExtent(aspect);
    const near = 0.02 * P[11], far = 20 * P[11], depth = (far + near) / (far - near), m = new Float32Array(16);
    for (let c = 0; c < 4; c++) {
      const w = P[8 + c];
      m[4 * c] = wide * (2 * (P[c] + 0.5 * w) / width - w);
      m[4 * c + 1] = -high * (2 * (P[4 + c] + 0.5 * w) / height - w);
      m[4 * c + 2] = depth * w - (c === 3 ? 2 * far * near / (far - near) : 0);
      m[4 * c + 3] = w;
    }
    return m;
  }

  // A movement on the screen (CSS px) as one of a vertex in space, page units.
  shiftOf(vertex, dx, dy) {
    const depth = this.place(vertex)?.[2] ?? 1, { clientWidth, clientHeight } = this.canvas;
    const step = 2 * Math.tan(FIELD_OF_VIEW / 2) * depth / Math.min(clientWidth, clientHeight);
    return add(scale(this.axes.right, step * dx), scale(this.axes.up, -step * dy));
  }

  half(left, width, height, ratio) {
    if (width <= 0) return;
    const { gl, shown, colors } = this;
    gl.scissor(left, 0, width, height);
    gl.clearColor(...colors.background, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (this.through !== null) this.photo(width / height);
    else if (this.colored && this.surface === "colored") this.coloredMesh();
    else if (this.surface !== "none" && this.keyframes.length) this.keyframedMesh();
    else if (this.surface !== "none") this.photoMesh();
    if (shown.cameras && this.through === null) this.line(this.wireframes.cameras, colors.camera, 1.2 * ratio);
    if (shown.truth && this.wireframes.truth) this.line(this.wireframes.truth, colors.truth, 1.6 * ratio);
    if (shown.start) this.line(this.wireframes.start, colors.start, 1.5 * ratio);
    if (this.isCompared) this.line(this.wireframes.reference, colors.reference, 1.5 * ratio);
    if (shown.now) this.line(this.wireframes.wire, colors.now, 1.5 * ratio);
    if (shown.vertices) this.points(0, this.now.length / 3, colors.now, this.dotSize * ratio);
    // Drawn without depth test: much of it lies behind the surface.
    gl.depthMask(false);
    gl.depthFunc(gl.ALWAYS);
    if (shown.paths) this.line(this.paths, colors.background, 4.2 * ratio, this.pathCount(this.moment));
    if (shown.paths) this.line(this.paths, colors.start, 2.2 * ratio, this.pathCount(this.moment), colors.now);
    if (this.wireframes.certainty) this.line(this.wireframes.certainty, colors.selected, 1.6 * ratio);
    for (const vertex of this.marked ?? []) this.points(vertex, 1, colors.selected, (vertex === this.selected ? 14 : 10) * ratio);
    gl.depthFunc(gl.LEQUAL);
    gl.depthMask(true);
  }

  keyframedMesh() {
    this.shown.texture = this.surface === "textured";
    this.mesh(this.nowMesh, this.blend);
  }

  photoMesh() {
    const { gl, photoMeshProgram: p } = this;
    gl.useProgram(p.program);
    gl.uniformMatrix4fv(p.uniform("clipFromPage"), false, this.matrix);
    gl.uniform1i(p.uniform("textured"), this.surface === "textured" ? 1 : 0);
    gl.uniform3fv(p.uniform("eye"), add(this.target, this.offset));
    gl.uniform4fv(p.uniform("rows"), this.views.slice(0, this.count).flatMap((view) => view.imageFromPage));
    gl.uniform2fv(p.uniform("sizes"), this.views.slice(0, this.count).flatMap(({ width, height }) => [width, height]));
    this.bindPhotos(p);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.weights);
    gl.uniform1i(p.uniform("weights"), 1);
    attribute(gl, p, "position", this.nowMesh, 3);
    attribute(gl, p, "face", this.faceIds, 1);
    gl.drawArrays(gl.TRIANGLES, 0, this.faces.length);
    release(gl, p);
  }

  bindPhotos(p) {
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.photos);
    gl.uniform1i(p.uniform("photos"), 0);
  }

  coloredMesh() {
    const { gl, coloredProgram: p, colored } = this;
    gl.useProgram(p.program);
    gl.uniformMatrix4fv(p.uniform("clipFromPage"), false, this.matrix);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, colored.texture);
    gl.uniform1i(p.uniform("picture"), 0);
    attribute(gl, p, "position", colored.corners, 3);
    attribute(gl, p, "uv", colored.uv, 2);
    gl.drawArrays(gl.TRIANGLES, 0, colored.count);
    release(gl, p);
  }

  photo(aspect) {
    const { gl, photoProgram: p } = this;
    gl.useProgram(p.program);
    gl.disable(gl.DEPTH_TEST);
    gl.uniform2fv(p.uniform("extent"), this.photoExtent(aspect));
    gl.uniform1f(p.uniform("layer"), this.through);
    this.bindPhotos(p);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.enable(gl.DEPTH_TEST);
  }
}

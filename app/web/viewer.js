// The 3D view on WebGL 2: the mesh with its texture keyframes, lines and dots.
import { add, cross, dot, magnitude, multiply, rotate, scale, unit } from "./vectors.js";

const MESH_VERTEX = `#version 300 es
in vec3 position; in vec2 uvA; in vec2 uvB;
uniform mat4 clipFromPage;
out vec2 atA; out vec2 atB; out vec3 place;
void main() { atA = uvA; atB = uvB; place = position; gl_Position = clipFromPage * vec4(position, 1.0); }`;

const MESH_FRAGMENT = `#version 300 es
precision highp float;
in vec2 atA; in vec2 atB; in vec3 place;
uniform sampler2D textureA; uniform sampler2D textureB;
uniform float share; uniform bool textured; uniform vec3 eye;
out vec4 color;
void main() {
  if (textured) { color = vec4(mix(texture(textureA, atA).rgb, texture(textureB, atB).rgb, share), 1.0); return; }
  vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
  color = vec4(vec3(0.24, 0.25, 0.27) + 0.42 * abs(dot(normal, normalize(eye - place))), 1.0);
}`;

// A line is a quad of constant width in screen space, slightly in front of the surface.
const LINE_VERTEX = `#version 300 es
in vec3 a; in vec3 b; in vec2 when;
uniform mat4 clipFromPage; uniform vec2 size; uniform float width; uniform float now;
uniform vec3 startColor; uniform vec3 endColor;
out vec3 shade;
void main() {
  vec4 p = clipFromPage * vec4(a, 1.0), q = clipFromPage * vec4(b, 1.0);
  float near = 0.01;
  if (p.w < near && q.w < near) { gl_Position = vec4(0.0, 0.0, 2.0, 1.0); return; }
  if (p.w < near) p = mix(p, q, (near - p.w) / (q.w - p.w));
  if (q.w < near) q = mix(q, p, (near - q.w) / (p.w - q.w));
  bool isEnd = gl_VertexID > 1;
  float side = (gl_VertexID & 1) == 0 ? -1.0 : 1.0;
  vec2 along = (q.xy / q.w - p.xy / p.w) * size;
  along = length(along) > 1e-6 ? normalize(along) : vec2(1.0, 0.0);
  vec4 here = isEnd ? q : p;
  here.xy += side * width * vec2(-along.y, along.x) / size * here.w;
  here.z -= 0.0015 * here.w;
  shade = mix(startColor, endColor, clamp((isEnd ? when.y : when.x) / max(now, 1e-6), 0.0, 1.0));
  gl_Position = here;
}`;

const LINE_FRAGMENT = `#version 300 es
precision highp float;
in vec3 shade; out vec4 color;
void main() { color = vec4(shade, 1.0); }`;

const DOT_VERTEX = `#version 300 es
in vec3 position;
uniform mat4 clipFromPage; uniform float size;
void main() { gl_Position = clipFromPage * vec4(position, 1.0); gl_Position.z -= 0.003 * gl_Position.w; gl_PointSize = size; }`;

const DOT_FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 dotColor; out vec4 color;
void main() {
  float r = length(gl_PointCoord - 0.5);
  if (r > 0.5) discard;
  color = vec4(r > 0.36 ? vec3(0.08) : dotColor, 1.0);
}`;

export const FIELD_OF_VIEW = Math.PI / 4;
const FILLED_WIDTH = 0.88, FILLED_HEIGHT = 0.74; // of the view; texts cover its borders

export class Viewer {
  // `data`: the data of page_data.py; `arrays`: its arrays, decoded. Throws an error without WebGL 2.
  constructor(canvas, data, arrays) {
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("no WebGL 2");
    Object.assign(this, { canvas, gl, data });
    this.faces = arrays.faces;
    this.colors = Object.fromEntries(Object.entries(data.colors).map(([name, rgb]) => [name, rgb.map((c) => c / 255)]));
    const takeGround = () => {
      const ground = getComputedStyle(document.documentElement).getPropertyValue("--ground");
      this.colors.background = ground.match(/\d+/g).map((part) => part / 255);
      this.redraw();
    };
    takeGround();
    window.matchMedia("(prefers-color-scheme: light)").addEventListener("change", takeGround);
    const isSmall = arrays.edges.length < 600;
    this.dotSize = isSmall ? 8 : 5;
    this.shown = { texture: true, wire: false, start: isSmall, truth: false, paths: true, cameras: false, dots: isSmall };
    this.side = "now"; // "before", "now" or "both"; with "both", `split` is the position of the divider
    this.split = 0.5;
    this.selected = null;
    this.moment = 0;
    this.blend = [0, 0, 0];
    this.startVertices = arrays.start;
    this.home();
    this.meshProgram = program(gl, MESH_VERTEX, MESH_FRAGMENT);
    this.lineProgram = program(gl, LINE_VERTEX, LINE_FRAGMENT);
    this.dotProgram = program(gl, DOT_VERTEX, DOT_FRAGMENT);
    this.keyframes = data.keyframes.map((keyframe, k) => this.keyframe(keyframe, arrays.uv[k]));
    this.startMesh = this.buffer(corners(arrays.start, this.faces));
    this.nowMesh = this.buffer(corners(arrays.start, this.faces), gl.DYNAMIC_DRAW);
    this.now = arrays.start;
    this.dots = this.buffer(arrays.start, gl.DYNAMIC_DRAW);
    this.wireframes = {
      start: this.lines(edgeLines(arrays.start, arrays.edges)),
      wire: this.lines(edgeLines(arrays.start, arrays.edges)),
      truth: arrays.truth && this.lines(edgeLines(arrays.truth, arrays.edges)),
      cameras: this.lines(arrays.cameras),
    };
    this.edges = arrays.edges;
    this.paths = this.lines(arrays.paths.lines, arrays.paths.when);
    this.pathCount = arrays.paths.count;
    this.listen();
    new ResizeObserver(() => this.redraw()).observe(canvas);
  }

  home() {
    const eye = this.data.stage.eye;
    this.up = this.data.stage.up;
    this.target = [0, 0, 0];
    this.offset = scale(unit(eye), this.fittingDistance(unit(eye)));
    this.redraw();
  }

  // Distance of the eye along a direction at which the start mesh is not covered by the texts over the view.
  fittingDistance(back) {
    const right = unit(cross(this.up, back)), up = cross(back, right), start = this.startVertices;
    const aspect = this.canvas.clientWidth / this.canvas.clientHeight || 1, reach = Math.tan(FIELD_OF_VIEW / 2);
    const [wide, high] = aspect < 1 ? [reach, reach / aspect] : [reach * aspect, reach];
    let distance = 0;
    for (let v = 0; v < start.length; v += 3) {
      const p = start.subarray(v, v + 3);
      const needed = Math.max(Math.abs(dot(p, right)) / (FILLED_WIDTH * wide), Math.abs(dot(p, up)) / (FILLED_HEIGHT * high));
      distance = Math.max(distance, needed + dot(p, back));
    }
    return distance;
  }

  // The mesh at a moment: `vertices` (3 n) page units; `blend`: two keyframes and the weight of the second.
  show(moment, vertices, blend) {
    const gl = this.gl;
    this.moment = moment;
    this.now = vertices;
    this.blend = blend;
    fill(gl, this.nowMesh, corners(vertices, this.faces));
    fill(gl, this.dots, vertices);
    fill(gl, this.wireframes.wire.ends, edgeLines(vertices, this.edges));
    this.redraw();
  }

  redraw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.draw(); });
  }

  draw() {
    const { gl, canvas } = this;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio)), height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    this.matrix = this.clipFromPage(width / height);
    gl.viewport(0, 0, width, height);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.SCISSOR_TEST);
    const cut = Math.round(width * (this.side === "both" ? this.split : this.side === "before" ? 1 : 0));
    this.half(0, cut, height, ratio, true);
    this.half(cut, width - cut, height, ratio, false);
    this.drawn = (this.drawn || 0) + 1;
  }

  half(left, width, height, ratio, isBefore) {
    if (width <= 0) return;
    const { gl, shown, colors } = this;
    gl.scissor(left, 0, width, height);
    gl.clearColor(...colors.background, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.mesh(isBefore ? this.startMesh : this.nowMesh, isBefore ? [0, 0, 0] : this.blend);
    if (shown.cameras) this.line(this.wireframes.cameras, colors.camera, 1.2 * ratio);
    if (shown.truth && this.wireframes.truth) this.line(this.wireframes.truth, colors.truth, 1.6 * ratio);
    if (shown.start) this.line(this.wireframes.start, colors.start, 1.4 * ratio);
    if (shown.wire && !isBefore) this.line(this.wireframes.wire, colors.now, 1.4 * ratio);
    if (isBefore) return;
    if (shown.dots) this.points(0, this.now.length / 3, colors.now, this.dotSize * ratio);
    // Drawn without depth test: many paths run behind the surface.
    gl.depthMask(false);
    gl.depthFunc(gl.ALWAYS);
    if (shown.paths) this.line(this.paths, colors.background, 4.2 * ratio, this.pathCount(this.moment));
    if (shown.paths) this.line(this.paths, colors.start, 2.2 * ratio, this.pathCount(this.moment), colors.now);
    if (this.selected !== null) this.points(this.selected, 1, colors.selected, 14 * ratio);
    gl.depthFunc(gl.LEQUAL);
    gl.depthMask(true);
  }

  // A viewpoint from which all cameras are visible.
  overview() {
    this.target = [0, 0, 0];
    this.offset = [...this.data.stage.overview];
    this.redraw();
  }

  mesh(buffer, [first, second, share]) {
    const { gl, meshProgram: p } = this;
    gl.useProgram(p.program);
    gl.uniformMatrix4fv(p.uniform("clipFromPage"), false, this.matrix);
    gl.uniform1i(p.uniform("textured"), this.shown.texture ? 1 : 0);
    gl.uniform1f(p.uniform("share"), share);
    gl.uniform3fv(p.uniform("eye"), add(this.target, this.offset));
    [[first, "A"], [second, "B"]].forEach(([index, name], layer) => {
      const keyframe = this.keyframes[index];
      gl.activeTexture(gl.TEXTURE0 + layer);
      gl.bindTexture(gl.TEXTURE_2D, keyframe.texture);
      gl.uniform1i(p.uniform("texture" + name), layer);
      attribute(gl, p, "uv" + name, keyframe.uv, 2);
    });
    attribute(gl, p, "position", buffer, 3);
    gl.drawArrays(gl.TRIANGLES, 0, this.faces.length);
    release(gl, p);
  }

  line(lines, color, width, count = lines.count, endColor = color) {
    if (!count) return;
    const { gl, lineProgram: p } = this;
    gl.useProgram(p.program);
    gl.uniformMatrix4fv(p.uniform("clipFromPage"), false, this.matrix);
    gl.uniform2f(p.uniform("size"), this.canvas.width, this.canvas.height);
    gl.uniform1f(p.uniform("width"), width);
    gl.uniform1f(p.uniform("now"), this.data.pace[this.moment]);
    gl.uniform3fv(p.uniform("startColor"), color);
    gl.uniform3fv(p.uniform("endColor"), endColor);
    attribute(gl, p, "a", lines.ends, 3, 1, 24, 0);
    attribute(gl, p, "b", lines.ends, 3, 1, 24, 12);
    attribute(gl, p, "when", lines.when, 2, 1);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
    release(gl, p);
  }

  points(first, count, color, size) {
    const { gl, dotProgram: p } = this;
    gl.useProgram(p.program);
    gl.uniformMatrix4fv(p.uniform("clipFromPage"), false, this.matrix);
    gl.uniform1f(p.uniform("size"), size);
    gl.uniform3fv(p.uniform("dotColor"), color);
    attribute(gl, p, "position", this.dots, 3);
    gl.drawArrays(gl.POINTS, first, count);
    release(gl, p);
  }

  keyframe({ picture }, uv) {
    const gl = this.gl, texture = gl.createTexture(), image = new Image();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array([96, 96, 96, 255]));
    image.onload = () => {
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
      gl.generateMipmap(gl.TEXTURE_2D);
      this.loaded = (this.loaded || 0) + 1;
      this.redraw();
    };
    image.src = picture;
    return { texture, uv: this.buffer(uv) };
  }

  buffer(values, usage = this.gl.STATIC_DRAW) {
    const buffer = this.gl.createBuffer();
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, buffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, values, usage);
    return buffer;
  }

  lines(ends, when = new Float32Array(ends.length / 3)) {
    return { ends: this.buffer(ends), when: this.buffer(when), count: ends.length / 6 };
  }

  clipFromPage(aspect) {
    const eye = add(this.target, this.offset), distance = magnitude(this.offset);
    const back = scale(this.offset, 1 / distance), right = unit(cross(this.up, back)), up = cross(back, right);
    const f = 1 / Math.tan(FIELD_OF_VIEW / 2), near = 0.01 * distance, far = 20 * distance + 100;
    const view = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
      -dot(right, eye), -dot(up, eye), -dot(back, eye), 1];
    const scaleX = aspect < 1 ? f : f / aspect, scaleY = aspect < 1 ? f * aspect : f;
    const projection = [scaleX, 0, 0, 0, 0, scaleY, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0];
    this.axes = { right, up };
    return multiply(projection, view);
  }

  // Position of a vertex on the canvas, CSS px, and its depth; null behind the eye.
  place(vertex) {
    const m = this.matrix, [x, y, z] = this.now.subarray(3 * vertex, 3 * vertex + 3);
    const w = m[3] * x + m[7] * y + m[11] * z + m[15];
    if (w <= 0) return null;
    const u = (m[0] * x + m[4] * y + m[8] * z + m[12]) / w, v = (m[1] * x + m[5] * y + m[9] * z + m[13]) / w;
    return [(u + 1) / 2 * this.canvas.clientWidth, (1 - v) / 2 * this.canvas.clientHeight, w];
  }

  nearest(x, y) {
    let best = null, least = 16;
    for (let v = 0; v < this.now.length / 3; v++) {
      const at = this.place(v);
      const apart = at ? Math.hypot(at[0] - x, at[1] - y) + 0.5 * at[2] : Infinity;
      if (at && Math.hypot(at[0] - x, at[1] - y) < 16 && apart < least + 8) { least = apart - 8; best = v; }
    }
    return best;
  }

  // One pointer rotates, pans (Shift or another button), selects a vertex, or drags what `onGrab` returns; two pinch and pan.
  listen() {
    const { canvas } = this, pointers = new Map();
    let travelled = 0, dragged = null;
    const place = (event) => [event.clientX, event.clientY];
    const within = ([x, y]) => { const box = canvas.getBoundingClientRect(); return [x - box.left, y - box.top]; };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, place(event));
      travelled = pointers.size > 1 ? Infinity : 0;
      dragged = pointers.size > 1 || event.shiftKey || event.button ? null : this.onGrab?.(...within(place(event))) ?? null;
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!pointers.has(event.pointerId)) return;
      const before = pointers.get(event.pointerId), here = place(event), dx = here[0] - before[0], dy = here[1] - before[1];
      const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
      pointers.set(event.pointerId, here);
      travelled += Math.abs(dx) + Math.abs(dy);
      if (other) {
        const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
        this.zoom(apart(before) / apart(here));
        this.pan(dx / 2, dy / 2);
      } else if (dragged) dragged(dx, dy);
      else if (event.shiftKey || event.buttons & 6) this.pan(dx, dy);
      else this.turn(-0.008 * dx, -0.008 * dy);
    });
    const end = (event) => {
      if (pointers.delete(event.pointerId) && travelled < 5 && event.type === "pointerup") this.onPick?.(this.nearest(...within(place(event))));
    };
    canvas.addEventListener("pointerup", end);
    canvas.addEventListener("pointercancel", end);
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", () => this.home());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(0.0012 * event.deltaY));
    }, { passive: false });
  }

  zoom(factor) {
    this.offset = scale(unit(this.offset), Math.min(1000, Math.max(0.15, magnitude(this.offset) * factor)));
    this.redraw();
  }

  turn(sideways, over) {
    const turned = rotate(this.offset, this.up, sideways), axis = unit(cross(turned, this.up));
    const tilted = rotate(turned, axis, -over);
    this.offset = Math.abs(dot(unit(tilted), this.up)) < 0.995 ? tilted : turned;
    this.redraw();
  }

  pan(dx, dy) {
    const step = 2 * Math.tan(FIELD_OF_VIEW / 2) * magnitude(this.offset) / this.canvas.clientHeight;
    this.target = add(this.target, add(scale(this.axes.right, -step * dx), scale(this.axes.up, step * dy)));
    this.redraw();
  }
}

export function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  const uniforms = {};
  return { program: made, used: [], uniform: (name) => (uniforms[name] ??= gl.getUniformLocation(made, name)) };
}

export function attribute(gl, p, name, buffer, size, divisor = 0, stride = 0, offset = 0) {
  const at = gl.getAttribLocation(p.program, name);
  if (at < 0) return;
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.enableVertexAttribArray(at);
  gl.vertexAttribPointer(at, size, gl.FLOAT, false, stride, offset);
  gl.vertexAttribDivisor(at, divisor);
  p.used.push(at);
}

export function release(gl, p) {
  for (const at of p.used.splice(0)) { gl.vertexAttribDivisor(at, 0); gl.disableVertexAttribArray(at); }
}

export function fill(gl, buffer, values) {
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferSubData(gl.ARRAY_BUFFER, 0, values);
}

// Positions (9 m) of the corners of faces (3 m).
export function corners(vertices, faces) {
  const result = new Float32Array(3 * faces.length);
  faces.forEach((v, i) => { for (let c = 0; c < 3; c++) result[3 * i + c] = vertices[3 * v + c]; });
  return result;
}

export const edgeLines = corners; // the same for edges (2 e): positions (6 e) of their ends

// The record of a run: positions at every moment and paths of the vertices.
export class RunRecord {
  // `run`: the data of page_data.run_data, unpacked; `grid`: page units of a unit of its positions.
  constructor(run, grid) {
    Object.assign(this, { run, length: run.length, pace: run.pace, start: onGrid(run.start, grid), kept: new Map() });
    const { moved } = run, last = run.start.slice();
    this.places = new Float32Array(moved.displacements.length);
    moved.vertices.forEach((v, i) => {
      for (let c = 0; c < 3; c++) this.places[3 * i + c] = grid * (last[3 * v + c] += moved.displacements[3 * i + c]);
    });
    this.kept.set(0, this.start);
  }

  // Positions (3 n) at a moment, page units. Every 32nd moment is cached, so that going back is fast.
  verticesAt(moment) {
    const { starts, vertices: moved } = this.run.moved;
    let at = moment - (moment % 32);
    while (!this.kept.has(at)) at -= 32;
    const vertices = this.kept.get(at).slice();
    for (let step = at; step < moment; step++) {
      if (step % 32 === 0 && !this.kept.has(step)) this.kept.set(step, vertices.slice());
      for (let i = starts[step]; i < starts[step + 1]; i++) vertices.set(this.places.subarray(3 * i, 3 * i + 3), 3 * moved[i]);
    }
    return vertices;
  }

  // The paths of all vertices as line segments, in the order of their steps.
  paths() {
    const { starts, vertices: moved } = this.run.moved, { places, length, pace } = this;
    const count = moved.length, lines = new Float32Array(6 * count), when = new Float32Array(2 * count), owner = new Uint32Array(count);
    const last = this.start.slice(), since = new Float32Array(last.length / 3), countAt = new Uint32Array(length + 1);
    for (let step = 0; step < length; step++) {
      for (let i = starts[step]; i < starts[step + 1]; i++) {
        const v = moved[i], place = places.subarray(3 * i, 3 * i + 3);
        lines.set(last.subarray(3 * v, 3 * v + 3), 6 * i);
        lines.set(place, 6 * i + 3);
        when.set([pace[since[v]], pace[step + 1]], 2 * i);
        owner[i] = v;
        last.set(place, 3 * v);
        since[v] = step + 1;
      }
      countAt[step + 1] = starts[step + 1];
    }
    return { lines, when, owner, count: (moment) => countAt[moment] };
  }

  // Indices of the texture keyframes before and after a moment, and the weight of the second.
  blendAt(moment, keyframes) {
    const moments = keyframes.map((keyframe) => keyframe.moment);
    let k = moments.length - 1;
    while (moments[k] > moment) k--;
    if (k + 1 === moments.length) return [k, k, 0];
    const [low, high] = [this.pace[moments[k]], this.pace[moments[k + 1]]];
    return [k, k + 1, high > low ? (this.pace[moment] - low) / (high - low) : 0];
  }
}

export function onGrid(numbers, grid) { return Float32Array.from(numbers, (number) => number * grid); }

export function textureCoordinates(keyframes) { return keyframes.map(({ uv }) => Float32Array.from(uv, (number) => number / 65535)); }

// Ids of the faces (3 m) around a vertex.
export function facesAround(faces, vertex) {
  return [...Array(faces.length / 3).keys()].filter((f) => faces.subarray(3 * f, 3 * f + 3).includes(vertex));
}

// One mesh drawn in place of many instances, which are only there to be clicked.
import { callBeforeFrames } from "./before_frame.js";

// Without a graphics card a browser draws every instance as slowly as a mesh of its own (ledger: vertex marks as one mesh). A
// matrix holds the size of an instance in its first element, and its position from the twelfth on.
export function drawAsOneMesh({ name, shapes, most, largest }) {
  callBeforeFrames(name, (view) => {
    let marks = null, mesh = null, shape = null, seen = {};
    const isSame = (a, b) => a?.length === b.length && a.every((value, k) => value === b[k]);
    const find = () => {
      let found = null;
      view.nodeRefFromName?.[name]?.traverse((part) => { if (part.matricesTexture && part.colorsTexture) found = part; });
      if (found === marks) return;
      mesh?.removeFromParent();
      mesh?.geometry.dispose();
      mesh?.material.dispose();
      [marks, mesh, seen] = [found, null, {}];
      if (!marks) return;
      const [Mesh, Geometry] = [Object.getPrototypeOf(marks.constructor), marks.geometry.constructor];
      mesh = new Mesh(new Geometry(), marks.material.clone());
      mesh.material.vertexColors = true;
      mesh.raycast = () => {};
      mesh.frustumCulled = false;
      marks.material.visible = false;
      marks.parent.add(mesh);
      mesh.updateMatrixWorld();
    };
    const shapeFor = (shown, matrices) => {
      const { projectionMatrix, matrixWorldInverse } = view.camera;
      const m = projectionMatrix.clone().multiply(matrixWorldInverse).multiply(marks.matrixWorld).elements;
      const inView = shown.filter((i) => {
        const x = matrices[16 * i + 12], y = matrices[16 * i + 13], z = matrices[16 * i + 14];
        const w = m[3] * x + m[7] * y + m[11] * z + m[15];
        return Math.abs(m[0] * x + m[4] * y + m[8] * z + m[12]) <= w && Math.abs(m[1] * x + m[5] * y + m[9] * z + m[13]) <= w;
      }).length;
      return shapes.find(({ corners }) => corners / 3 * inView <= most) ?? shapes.at(-1);
    };
    const resize = (count) => {
      const Attribute = marks.geometry.attributes.position.constructor, indices = new Uint32Array(count * shape.corners);
      const source = marks.geometry.index.array;
      for (let k = 0; k < count; k++)
        for (let c = 0; c < shape.corners; c++)
          indices[k * shape.corners + c] = source[shape.firstCorner + c] - shape.first + k * shape.vertices;
      mesh.geometry.dispose();
      mesh.geometry = new mesh.geometry.constructor();
      mesh.geometry.setIndex(new Attribute(indices, 1));
      for (const part of ["position", "normal", "color"])
        mesh.geometry.setAttribute(part, new Attribute(new Float32Array(3 * count * shape.vertices), 3));
    };
    const sizesOf = (shown, matrices) => {
      const { projectionMatrix, matrixWorldInverse } = view.camera;
      const m = matrixWorldInverse.clone().multiply(marks.matrixWorld).elements;
      const unit = 2 * largest / (projectionMatrix.elements[5] * view.canvas.clientHeight); // of the size at depth 1
      return shown.map((i) => {
        const depth = -(m[2] * matrices[16 * i + 12] + m[6] * matrices[16 * i + 13] + m[10] * matrices[16 * i + 14] + m[14]);
        return depth > 0 ? Math.min(matrices[16 * i], unit * depth) : matrices[16 * i];
      });
    };
    const fill = (shown, sizes, matrices, colors) => {
      const { position, normal } = marks.geometry.attributes, to = mesh.geometry.attributes;
      let at = 0;
      for (const [n, i] of shown.entries())
        for (let v = shape.first; v < shape.first + shape.vertices; v++)
          for (let k = 0; k < 3; k++, at++) {
            to.position.array[at] = matrices[16 * i + 12 + k] + sizes[n] * position.array[3 * v + k];
            to.normal.array[at] = normal.array[3 * v + k];
            to.color.array[at] = colors[4 * i + k];
          }
      for (const attribute of Object.values(to)) attribute.needsUpdate = true;
    };
    return () => {
      find();
      if (!marks) return;
      const matrices = marks.matricesTexture.image.data, colors = marks.colorsTexture.image.data;
      const isChanged = !isSame(seen.matrices, matrices) || !isSame(seen.colors, colors);
      const all = isChanged ? Array.from({ length: marks.instancesCount }, (_, i) => i) : [];
      const shown = isChanged ? all.filter((i) => matrices[16 * i] > 0) : seen.shown, before = shape;
      const sizes = sizesOf(shown, matrices);
      shape = shapeFor(shown, matrices);
      if (!isChanged && shape === before && isSame(seen.sizes, sizes)) return;
      if (shape !== before || shown.length !== seen.shown?.length) resize(shown.length);
      fill(shown, sizes, matrices, colors);
      seen = { matrices: matrices.slice(), colors: colors.slice(), shown, sizes };
    };
  });
}

"""Instances of one shape, of which some are shown, and which can be clicked."""

import json
from collections.abc import Callable, Sequence

import numpy as np
import viser

from app.viser_bridge.before_frame import call_before_frames
from app.viser_bridge.linear_colors import linear_from_srgb
from app.viser_bridge.node_events import on_node_click

Shape = tuple[np.ndarray, np.ndarray]

MOST_TRIANGLES = 20_000  # of the instances in view (ledger: vertex mark triangles)
LARGEST = 8.0  # screen px: radius of an instance from nearby, which else would cover what it marks

# Without a graphics card a browser draws every instance as slowly as a mesh of its own (ledger: vertex marks as one mesh). So
# the instances are only there to be clicked, and one mesh is drawn in their place. A matrix holds the size of an instance in
# its first element, and its position from the twelfth on.
_MAKE = """view => {
  const {name, shapes, most, largest} = %s;
  let marks = null, mesh = null, shape = null, seen = {};
  const isSame = (a, b) => a?.length === b.length && a.every((value, k) => value === b[k]);
  const find = () => {
    let found = null;
    view.nodeRefFromName?.[name]?.traverse(part => { if (part.matricesTexture && part.colorsTexture) found = part; });
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
    const {projectionMatrix, matrixWorldInverse} = view.camera;
    const m = projectionMatrix.clone().multiply(matrixWorldInverse).multiply(marks.matrixWorld).elements;
    const inView = shown.filter(i => {
      const x = matrices[16 * i + 12], y = matrices[16 * i + 13], z = matrices[16 * i + 14];
      const w = m[3] * x + m[7] * y + m[11] * z + m[15];
      return Math.abs(m[0] * x + m[4] * y + m[8] * z + m[12]) <= w && Math.abs(m[1] * x + m[5] * y + m[9] * z + m[13]) <= w;
    }).length;
    return shapes.find(({corners}) => corners / 3 * inView <= most) ?? shapes.at(-1);
  };
  const resize = count => {
    const Attribute = marks.geometry.attributes.position.constructor, indices = new Uint32Array(count * shape.corners);
    const source = marks.geometry.index.array;
    for (let k = 0; k < count; k++)
      for (let c = 0; c < shape.corners; c++)
        indices[k * shape.corners + c] = source[shape.firstCorner + c] - shape.first + k * shape.vertices;
    mesh.geometry.dispose();
    mesh.geometry = new mesh.geometry.constructor();
    mesh.geometry.setIndex(new Attribute(indices, 1));
    for (const part of ['position', 'normal', 'color'])
      mesh.geometry.setAttribute(part, new Attribute(new Float32Array(3 * count * shape.vertices), 3));
  };
  const sizesOf = (shown, matrices) => {
    const {projectionMatrix, matrixWorldInverse} = view.camera;
    const m = matrixWorldInverse.clone().multiply(marks.matrixWorld).elements;
    const unit = 2 * largest / (projectionMatrix.elements[5] * view.canvas.clientHeight);  // of the size at depth 1
    return shown.map(i => {
      const depth = -(m[2] * matrices[16 * i + 12] + m[6] * matrices[16 * i + 13] + m[10] * matrices[16 * i + 14] + m[14]);
      return depth > 0 ? Math.min(matrices[16 * i], unit * depth) : matrices[16 * i];
    });
  };
  const fill = (shown, sizes, matrices, colors) => {
    const {position, normal} = marks.geometry.attributes, to = mesh.geometry.attributes;
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
    const all = isChanged ? Array.from({length: marks.instancesCount}, (_, i) => i) : [];
    const shown = isChanged ? all.filter(i => matrices[16 * i] > 0) : seen.shown, before = shape;
    const sizes = sizesOf(shown, matrices);
    shape = shapeFor(shown, matrices);
    if (!isChanged && shape === before && isSame(seen.sizes, sizes)) return;
    if (shape !== before || shown.length !== seen.shown?.length) resize(shown.length);
    fill(shown, sizes, matrices, colors);
    seen = {matrices: matrices.slice(), colors: colors.slice(), shown, sizes};
  };
}"""


class InstanceMarks:
    """One node with an instance for every position; those that are hidden have zero size.

    The fewer instances are in view, the more triangles each has, as many in all as a browser without a graphics card draws
    without delay. Instances are not rotated. From nearby they are drawn no larger than `LARGEST`, but can be clicked where they
    would be.

    viser 1.1.1 makes a node anew when its number of instances changes, and a click on it before the browser has its
    bindings is lost, so the number never changes.

    Args:
        shapes: vertices (v, 3) float and faces (f, 3) of an instance, of which one is drawn; the finest first.
        positions: (n, 3) float, scene units, at first.
        on_click: called with the index of an instance and whether Shift was held.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        name: str,
        shapes: Sequence[Shape],
        positions: np.ndarray,
        on_click: Callable[[int, bool], None],
    ) -> None:
        count = len(positions)
        vertices, faces = _joined(shapes)
        self.node = client.scene.add_batched_meshes_simple(
            name,
            vertices,
            faces,
            np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
            positions,
            batched_scales=np.zeros(count, dtype=np.float32),
            batched_colors=np.zeros((count, 3), dtype=np.uint8),
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )

        def clicked(event: viser.SceneNodePointerEvent, with_shift: bool) -> None:
            if event.instance_index is not None and 0 <= event.instance_index < count:
                on_click(event.instance_index, with_shift)

        on_node_click(self.node, clicked)
        parameters = {"name": name, "shapes": _parts(shapes), "most": MOST_TRIANGLES, "largest": LARGEST}
        call_before_frames(client, name, _MAKE % json.dumps(parameters))

    def show(
        self, shown: np.ndarray, positions: np.ndarray, colors: np.ndarray, scales: np.ndarray, is_visible: bool
    ) -> None:
        """Draw the instances of `shown` (n,) bool; positions (n, 3) and scales (n,) in scene units, colors (n, 3) uint8."""
        is_visible = is_visible and bool(shown.any())
        if is_visible:
            self.node.batched_positions = positions
            self.node.batched_colors = linear_from_srgb(colors)
            self.node.batched_scales = np.where(shown, scales, np.float32(0))
        self.node.visible = is_visible


def _joined(shapes: Sequence[Shape]) -> Shape:
    """All shapes as one."""
    faces = [faces + part["first"] for part, (_, faces) in zip(_parts(shapes), shapes, strict=True)]
    return np.concatenate([vertices for vertices, _ in shapes]), np.concatenate(faces).astype(np.uint32)


def _parts(shapes: Sequence[Shape]) -> list[dict[str, int]]:
    """Where each shape is in all of them as one: its first vertex and corner, and how many it has."""
    parts, first, corner = [], 0, 0
    for vertices, faces in shapes:
        parts.append({"first": first, "vertices": len(vertices), "firstCorner": corner, "corners": faces.size})
        first, corner = first + len(vertices), corner + faces.size
    return parts

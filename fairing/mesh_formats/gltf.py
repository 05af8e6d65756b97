"""glTF 2.0 meshes: the triangles of all parts of the scene, placed by their nodes, and new positions for them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fairing.errors import InputError
from fairing.mesh_formats.document import Attributes, MovedMesh, as_bytes
from fairing.mesh_formats.gltf_file import GltfFile
from fairing.mesh_formats.gltf_json import GltfObject, item
from fairing.mesh_formats.gltf_part import Part
from fairing.mesh_formats.gltf_write import moved_glb
from fairing.mesh_formats.strips import fan_triangles, strip_triangles

_POINTS, _TRIANGLES, _STRIP, _FAN = 0, 4, 5, 6
_MULTIPLYING = "EXT_mesh_gpu_instancing"


@dataclass(frozen=True, eq=False)
class GltfDocument:
    """The meshes of a glTF's scene: all positions of the accessors that triangles use, in the order of the nodes.

    Without triangles its points are the vertices. Skins and morph targets are kept, but do not move vertices here.
    """

    file: GltfFile
    parts: list[Part]

    @cached_property
    def vertices(self) -> np.ndarray:
        """(n, 3) float, world units."""
        with np.errstate(invalid="ignore", over="ignore"):  # the check of the mesh refuses what is not finite
            placed = [
                part.positions @ part.world_from_part[:3, :3].T + part.world_from_part[:3, 3] for part in self.parts
            ]
        return np.concatenate([np.empty((0, 3)), *placed])

    @cached_property
    def faces(self) -> np.ndarray:
        """(m, 3) int. A part that its node mirrors is turned over, as glTF demands."""
        faces = [np.empty((0, 3), dtype=np.int64)]
        for part in self.parts:
            is_mirrored = np.linalg.det(part.world_from_part[:3, :3]) < 0
            faces.append((part.all_faces()[:, ::-1] if is_mirrored else part.all_faces()) + part.start)
        return np.concatenate(faces)

    def attributes(self) -> Attributes:
        """Colours and texture coordinates of the first set, where all parts have them; materials have no place."""
        colors, uv = self._values("COLOR_0"), self._values("TEXCOORD_0")
        alike = colors is not None and len({values.shape[1] for values in colors}) == 1
        return Attributes(
            colors=as_bytes(np.concatenate(colors)) if colors and alike else None,
            vertex_uv=np.concatenate(uv) * (1, -1) + (0, 1) if uv else None,
            has_normals=self._values("NORMAL") is not None,
        )

    def moved(self, vertices: np.ndarray) -> MovedMesh:
        """A GLB with vertices (n, 3) float, in single precision, and the names of its images in files."""
        return moved_glb(self.file, self.parts, np.asarray(vertices, dtype=np.float64))

    def _values(self, name: str) -> list[np.ndarray] | None:
        """An attribute of every part's vertices; None unless all have it."""
        found = []
        meshes = self.file.content.children("meshes")
        for part in self.parts:
            of = meshes[part.mesh].children("primitives")[part.primitives[0]].child("attributes")
            if name not in of:
                return None
            values = self.file.accessor(of.whole(name))
            if len(values) != len(part.positions):
                return None
            found.append(values)
        return found


def parse_gltf(data: bytes, resolve: Callable[[str], bytes]) -> GltfDocument:
    """The scene of a GLB, or of the JSON of a GLTF. `resolve` returns the bytes of a file by its URI.

    Raises:
        InputError: damaged, an unsupported extension, or more data made than the file's size allows.
    """
    file = GltfFile(data, resolve)
    meshes = file.content.children("meshes")
    modes = {p.whole("mode", _TRIANGLES) for mesh in meshes for p in mesh.children("primitives")}
    used = (_TRIANGLES, _STRIP, _FAN) if modes & {_TRIANGLES, _STRIP, _FAN} else (_POINTS,)
    parts: list[Part] = []
    for node, mesh_index, world_from_part in _placed_meshes(file.content):
        of_mesh: dict[int, Part] = {}
        for i, primitive in enumerate(item(meshes, mesh_index, "mesh").children("primitives")):
            mode, attributes = primitive.whole("mode", _TRIANGLES), primitive.child("attributes")
            if mode not in used or "POSITION" not in attributes:
                continue
            accessor = attributes.whole("POSITION")
            if accessor not in of_mesh:
                start = parts[-1].vertices.stop if parts else 0
                positions = file.accessor(accessor).astype(np.float64)
                if positions.shape[1] != 3:
                    raise InputError(f"{primitive.where}: expected positions of 3 numbers, found {positions.shape[1]}")
                parts.append(Part(node, mesh_index, [], start, world_from_part, positions))
                of_mesh[accessor] = parts[-1]
            of_mesh[accessor].primitives.append(i)
            if mode != _POINTS:
                of_mesh[accessor].faces.append(_triangles(file, primitive, mode, len(of_mesh[accessor].positions)))
    return GltfDocument(file, parts)


def _triangles(file: GltfFile, primitive: GltfObject, mode: int, n_vertices: int) -> np.ndarray:
    """(m, 3) int: the triangles of a primitive."""
    if "indices" in primitive:
        corners = file.accessor(primitive.whole("indices"))
        if corners.shape[1] != 1 or corners.dtype.kind != "i":
            raise InputError(
                f"{primitive.where}: expected whole numbers as indices, found another type; export it again"
            )
        corners = corners[:, 0]
    else:
        corners = np.arange(n_vertices)
    if corners.max(initial=-1) >= n_vertices or corners.min(initial=0) < 0:
        raise InputError(
            f"{primitive.where}: expected indices 0 to {n_vertices - 1}, found {corners.max()}; export it again"
        )
    if mode in (_STRIP, _FAN):
        file.budget.take(corners.size * 24)
    if mode == _STRIP:
        return strip_triangles(corners, np.array([len(corners)]))
    if mode == _FAN:
        return fan_triangles(corners)
    if len(corners) % 3:
        raise InputError(f"{primitive.where}: expected three indices for each triangle, found {len(corners)} indices")
    return corners.reshape(-1, 3)


def _placed_meshes(content: GltfObject) -> Iterator[tuple[int, int, np.ndarray]]:
    """Node, mesh and world_from_part (4, 4) of the scene's meshes, a node before its children.

    Raises:
        InputError: a node has two parents or is its own ancestor, or its instances are hidden in an extension.
    """
    nodes, scenes = content.children("nodes"), content.children("scenes")
    if not nodes:
        yield from ((-1, mesh, np.eye(4)) for mesh in range(len(content.children("meshes"))))
        return
    if scenes:
        roots = item(scenes, content.whole("scene", 0), "scene").wholes("nodes")
    else:
        below = {child for node in nodes for child in node.wholes("children")}
        roots = [i for i in range(len(nodes)) if i not in below]
    seen: set[int] = set()
    waiting = [(root, np.eye(4)) for root in reversed(roots)]
    while waiting:
        index, world_from_parent = waiting.pop()
        node = item(nodes, index, "node")
        if index in seen:
            raise InputError(f"{node.where}: expected one place in the scene, found two; export the mesh again")
        seen.add(index)
        if _MULTIPLYING in node.child("extensions"):
            raise InputError(f"uses the glTF extension {_MULTIPLYING}, which is not supported; export real copies")
        world_from_node = world_from_parent @ _parent_from_node(node)
        if "mesh" in node:
            yield index, node.whole("mesh"), world_from_node
        waiting += [(child, world_from_node) for child in reversed(node.wholes("children"))]


def _parent_from_node(node: GltfObject) -> np.ndarray:
    """(4, 4) float: a node's matrix (column by column), or its translation, rotation (x y z w) and scale."""
    if "matrix" in node:
        return np.array(node.numbers("matrix", [0.0] * 16)).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = np.array(node.numbers("rotation", [0.0, 0.0, 0.0, 1.0]))
    rotation = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    matrix[:3, :3] = rotation * node.numbers("scale", [1.0, 1.0, 1.0])
    matrix[:3, 3] = node.numbers("translation", [0.0, 0.0, 0.0])
    return matrix

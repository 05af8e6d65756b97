"""PLY: text and both binary orders, any elements and properties, polygons and triangle strips."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fairing.errors import InputError
from fairing.geometry.normals import unit_normals
from fairing.mesh_formats.document import Attributes, MovedMesh
from fairing.mesh_formats.ply_binary import BinaryItems
from fairing.mesh_formats.ply_header import Element, PlyHeader, Property, parse_header
from fairing.mesh_formats.ply_text import TextItems
from fairing.mesh_formats.polygons import Polygons, recut, triangulated
from fairing.mesh_formats.strips import strip_triangles
from fairing.mesh_formats.vertex_normals import at_unit_size, moved_normals

_CORNERS = ("vertex_indices", "vertex_index")
_NORMAL, _POSITION = ("nx", "ny", "nz"), ("x", "y", "z")
_TEXTURE = "TextureFile"
_FLOAT_NAMES = {"f4": "float", "f8": "double"}


@dataclass(frozen=True, eq=False)
class PlyDocument:
    """A PLY file: every element, property, comment and value as it is, with the vertices as numbers.

    `moved` changes the coordinates, in double precision, and normals that are floating-point numbers.
    """

    header: PlyHeader
    items: dict[str, TextItems | BinaryItems]

    @cached_property
    def vertices(self) -> np.ndarray:
        """(n, 3) float, world units."""
        element = self._element("vertex")
        properties = element.scalars(*_POSITION) if element else None
        if properties is None:
            raise InputError("expected an element vertex with properties x, y and z in the PLY header, found none")
        return self.items["vertex"].numbers(properties)

    @cached_property
    def faces(self) -> np.ndarray:
        """(m, 3) int: the faces, triangulated, then the triangles of strips."""
        faces = self._polygons.corners[self._triangles]
        strips = self._corner_lists("tristrips")
        return faces if strips is None else np.concatenate([faces, strip_triangles(*strips)])

    @cached_property
    def _triangles(self) -> np.ndarray:
        return triangulated(self.vertices, self._polygons)

    def attributes(self) -> Attributes:
        """Nothing: a PLY file is written as PLY, with everything that it has."""
        return Attributes()

    def moved(self, vertices: np.ndarray) -> MovedMesh:
        """The bytes with vertices (n, 3) float, and the images that comments name."""
        changes = {"vertex": dict(zip(_POSITION, np.asarray(vertices, dtype=np.float64).T, strict=True))}
        for name, normals in self._normals(vertices):
            changes.setdefault(name, {}).update(normals)
        items, n_faces = dict(self.items), None
        if pieces := recut(vertices, self._polygons, self._triangles):
            counts = np.ones(len(self._polygons.sizes), dtype=np.int64)
            counts[list(pieces)] = [len(triangles) for triangles in pieces.values()]
            corners = self._corners_property("face")
            assert corners is not None
            items["face"], n_faces = items["face"].cut(corners, pieces), int(counts.sum())
            changes["face"] = {name: np.repeat(column, counts) for name, column in changes.get("face", {}).items()}
        types: dict[int, str] = {}
        parts = []
        for element in self.header.elements:
            columns = {name: np.ascontiguousarray(column) for name, column in changes.get(element.name, {}).items()}
            for p in element.properties:
                if p.name in columns and p.type != columns[p.name].dtype.str[1:]:
                    types[p.line] = _FLOAT_NAMES[columns[p.name].dtype.str[1:]]
            of = items[element.name]
            line_break = self.header.line_break.encode()
            parts.append(of.replaced(columns, line_break) if isinstance(of, TextItems) else of.replaced(columns))
        comments = (line.split(maxsplit=2) for line in self.header.lines)
        textures = tuple(words[2].strip() for words in comments if words[:2] == ["comment", _TEXTURE])
        return MovedMesh(self.header.written(types, n_faces) + b"".join(parts), textures)

    def _element(self, name: str) -> Element | None:
        return next((element for element in self.header.elements if element.name == name), None)

    def _corners_property(self, name: str) -> Property | None:
        """The list of vertex indices of an element; None without items.

        Raises:
            InputError: it has items without such a list, or not of whole numbers.
        """
        element = self._element(name)
        if element is None or element.count == 0:
            return None
        corners = element.list_named(*_CORNERS)
        if corners is None:
            raise InputError(f"element {name}: expected a list {_CORNERS[0]}, found none; export the mesh again")
        if np.dtype(corners.type).kind == "f":
            raise InputError(
                f"element {name}: expected whole numbers {corners.name}, found type float; export it again"
            )
        return corners

    def _corner_lists(self, name: str) -> tuple[np.ndarray, np.ndarray] | None:
        """The vertex indices of an element's items, one after the other, and their numbers."""
        corners = self._corners_property(name)
        if corners is None:
            return None
        values, lengths = self.items[name].lists(corners)
        return values.astype(np.int64), lengths

    @cached_property
    def _polygons(self) -> Polygons:
        lists = self._corner_lists("face")
        if lists is None:
            return Polygons(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
        small = np.flatnonzero(lists[1] < 3)
        if len(small):
            raise InputError(
                f"face {small[0]}: expected at least 3 corners, found {lists[1][small[0]]}; repair the mesh"
            )
        return Polygons(*lists)

    def _normals(self, vertices: np.ndarray) -> list[tuple[str, dict[str, np.ndarray]]]:
        """The new normals of vertices and of faces, where the file has floating-point ones, by element and property."""
        found = []
        for name in ("vertex", "face"):
            element = self._element(name)
            properties = element.scalars(*_NORMAL) if element else None
            if properties is None or len(self.faces) == 0 or any(p.type[0] != "f" for p in properties):
                continue
            before = self.items[name].numbers(properties)
            if name == "vertex":
                after = moved_normals(self.vertices, vertices, self.faces, before)
            else:
                after = _polygon_normals(vertices, self._polygons, before)
            columns = zip(_NORMAL, after.T, properties, strict=True)
            found.append((name, {axis: column.astype(p.type) for axis, column, p in columns}))
        return found


def parse_ply(data: bytes) -> PlyDocument:
    """A PLY file.

    Raises:
        InputError: the header is damaged, or declares another number of items than the file holds.
    """
    header = parse_header(data)
    return PlyDocument(header, _binary_items(header, data) if header.order else _text_items(header, data))


def write_ply(vertices: np.ndarray, faces: np.ndarray, attributes: Attributes) -> bytes:
    """A binary PLY file of vertices (n, 3) float in double precision, triangles (m, 3) int and attributes."""
    vertices, faces = np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int64)
    columns: list[tuple[str, str, np.ndarray]] = [("double", axis, vertices[:, i]) for i, axis in enumerate(_POSITION)]
    if attributes.has_normals:
        normals = moved_normals(vertices, vertices, faces, np.zeros_like(vertices))
        columns += [("float", axis, normals[:, i]) for i, axis in enumerate(_NORMAL)]
    if attributes.vertex_uv is not None:
        columns += [("float", name, attributes.vertex_uv[:, i]) for i, name in enumerate(("texture_u", "texture_v"))]
    columns += _color_columns(attributes.colors)
    face_columns = _color_columns(attributes.face_colors)
    lists = [("vertex_indices", "int", "<i4", faces)]
    if attributes.corner_uv is not None:
        lists.append(("texcoord", "float", "<f4", attributes.corner_uv.reshape(len(faces), 6)))
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    lines += [f"property {type} {name}" for type, name, _ in columns]
    lines += [f"element face {len(faces)}", *(f"property list uchar {type} {name}" for name, type, _, _ in lists)]
    lines += [*(f"property {type} {name}" for type, name, _ in face_columns), "end_header", ""]
    fields: list[tuple] = []
    for name, _, type, values in lists:
        fields += [(f"length of {name}", "u1"), (name, type, values.shape[1])]
    triangles = np.empty(len(faces), dtype=[*fields, *_fields(face_columns)])
    for name, _, _, values in lists:
        triangles[f"length of {name}"], triangles[name] = values.shape[1], values
    return "\n".join(lines).encode() + _records(columns).tobytes() + _filled(triangles, face_columns).tobytes()


def _text_items(header: PlyHeader, data: bytes) -> dict[str, TextItems | BinaryItems]:
    first = len(header.lines) + 1
    numbered = [(n, line) for n, line in enumerate(data[header.size :].splitlines(), start=first) if line.strip()]
    declared = sum(element.count for element in header.elements)
    if declared != len(numbered):
        raise _other_number(header, f"{declared} lines", f"{len(numbered)}")
    items: dict[str, TextItems | BinaryItems] = {}
    at = 0
    for element in header.elements:
        own = numbered[at : at + element.count]
        items[element.name] = TextItems(element, [line for _, line in own], [n for n, _ in own])
        at += element.count
    return items


def _binary_items(header: PlyHeader, data: bytes) -> dict[str, TextItems | BinaryItems]:
    items: dict[str, TextItems | BinaryItems] = {}
    at = header.size
    for element in header.elements:
        found = BinaryItems(element, data, at, header.order)
        items[element.name] = found
        at = found.end
    if data[at:].strip():
        raise _other_number(header, f"the end of the file after {at} bytes", f"{len(data) - at} more")
    return items


def _other_number(header: PlyHeader, expected: str, found: str) -> InputError:
    declared = ", ".join(f"{element.count} {element.name}" for element in header.elements)
    return InputError(f"expected {expected} as declared ({declared}), found {found}; it is incomplete, export it again")


def _polygon_normals(vertices: np.ndarray, polygons: Polygons, normals: np.ndarray) -> np.ndarray:
    """Unit normals (p, 3) float of polygons; one without area keeps the given normal."""
    ids = triangulated(vertices, polygons)
    units, doubled = unit_normals(at_unit_size(vertices), polygons.corners[ids])
    polygon = np.repeat(np.arange(len(polygons.sizes)), polygons.sizes - 2)
    weighted = units * doubled[:, None]
    sums = np.stack([np.bincount(polygon, weighted[:, axis], len(polygons.sizes)) for axis in range(3)], axis=1)
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.where(length > 0, sums / np.maximum(length, 1e-300), normals)


def _color_columns(colors: np.ndarray | None) -> list[tuple[str, str, np.ndarray]]:
    channels = ("red", "green", "blue", "alpha")
    return [] if colors is None else [("uchar", name, column) for name, column in zip(channels, colors.T, strict=False)]


def _fields(columns: list[tuple[str, str, np.ndarray]]) -> list[tuple[str, str]]:
    types = {"double": "<f8", "float": "<f4", "uchar": "u1"}
    return [(name, types[type]) for type, name, _ in columns]


def _records(columns: list[tuple[str, str, np.ndarray]]) -> np.ndarray:
    return _filled(np.empty(len(columns[0][2]), dtype=_fields(columns)), columns)


def _filled(records: np.ndarray, columns: list[tuple[str, str, np.ndarray]]) -> np.ndarray:
    for _, name, column in columns:
        records[name] = column
    return records

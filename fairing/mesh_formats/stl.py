"""STL, binary and text. Every triangle has three vertices of its own.

Source: https://www.fabbers.com/tech/STL_Format.
"""

from dataclasses import dataclass

import numpy as np

from fairing.errors import InputError
from fairing.geometry.normals import unit_normals
from fairing.mesh_formats.document import Attributes, MovedMesh
from fairing.mesh_formats.numbers import float_texts, floats, shown
from fairing.mesh_formats.vertex_normals import at_unit_size

_HEADER = 84
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


@dataclass(frozen=True, eq=False)
class StlDocument:
    """An STL file.

    Attributes:
        content: the header's bytes and the triangles of a binary file, or the lines of a text.
        vertices: (3 m, 3) float, world units.
    """

    content: tuple[bytes, np.ndarray] | list[bytes]
    vertices: np.ndarray

    @property
    def faces(self) -> np.ndarray:
        """(m, 3) int: three vertices after the other."""
        return np.arange(len(self.vertices)).reshape(-1, 3)

    def attributes(self) -> Attributes:
        """None: an STL has none that other formats hold."""
        return Attributes()

    def moved(self, vertices: np.ndarray) -> MovedMesh:
        """The bytes with vertices (3 m, 3) float, in single precision if binary; all normals are computed anew."""
        vertices = np.asarray(vertices, dtype=np.float64)
        normals = unit_normals(at_unit_size(vertices), self.faces)[0]
        if isinstance(self.content, tuple):
            header, triangles = self.content
            triangles = triangles.copy()
            triangles["corners"], triangles["normal"] = vertices.reshape(-1, 3, 3), normals
            return MovedMesh(header + triangles.tobytes())
        positions, directions = iter(float_texts(vertices)), iter(float_texts(normals.astype(np.float32)))
        lines = []
        for line in self.content:
            words = line.lower().split()
            if words[:1] == [b"vertex"]:
                line = _with_numbers(line, next(positions))
            elif words[:2] == [b"facet", b"normal"]:
                line = _with_numbers(line, next(directions))
            lines.append(line)
        return MovedMesh(b"".join(lines))


def parse_stl(data: bytes) -> StlDocument:
    """An STL file: binary if its size is the one that a binary file declares, else text.

    Raises:
        InputError: it is neither, or it ends before its end.
    """
    declared = int.from_bytes(data[_HEADER - 4 : _HEADER], "little") if len(data) >= _HEADER else 0
    size = _HEADER + declared * _TRIANGLE.itemsize
    if len(data) == size and declared:
        triangles = np.frombuffer(data, _TRIANGLE, offset=_HEADER)
        with np.errstate(invalid="ignore"):  # a signalling NaN, which the check of the mesh refuses
            vertices = triangles["corners"].reshape(-1, 3).astype(np.float64)
        return StlDocument((data[:_HEADER], triangles), vertices)
    if data.lstrip()[:5].lower() == b"solid":
        return _parse_text(data)
    raise InputError(
        f"expected an STL of {declared} triangles ({size} bytes) as declared, found {len(data)} bytes; it is incomplete, "
        "export it again"
    )


def _parse_text(data: bytes) -> StlDocument:
    lines = data.splitlines(keepends=True)
    vertices: list[list[float]] = []
    opened = closed = n_facets = n_ends = 0
    for number, line in enumerate(lines, start=1):
        words = line.split()
        kind = words[0].lower() if words else b""
        opened, closed = opened + (kind == b"solid"), closed + (kind == b"endsolid")
        n_facets, n_ends = n_facets + (kind == b"facet"), n_ends + (kind == b"endfacet")
        if kind != b"vertex":
            continue
        try:
            x, y, z = floats(words[1:])
        except ValueError:
            raise InputError(f"line {number}: expected `vertex x y z`, found {shown(line.strip())}") from None
        vertices.append([x, y, z])
    if not len(vertices) == 3 * n_facets == 3 * n_ends or opened != closed:
        raise InputError(
            f"expected three vertices for each facet up to `endsolid`, found {len(vertices)} for {n_facets}; "
            "it is incomplete, export it again"
        )
    return StlDocument(lines, np.array(vertices).reshape(-1, 3))


def _with_numbers(line: bytes, numbers: list[bytes]) -> bytes:
    """A line whose last three words are these numbers."""
    words = line.split()
    indent = line[: len(line) - len(line.lstrip())]
    return indent + b" ".join([*words[:-3], *numbers]) + line[len(line.rstrip(b"\r\n")) :]

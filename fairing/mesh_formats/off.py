"""OFF text files, with colours, normals and texture coordinates (COFF, NOFF, STOFF and their combinations).

Source: Geomview, Object File Format, http://www.geomview.org/docs/html/OFF.html.
"""

import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fairing.errors import InputError
from fairing.mesh_formats.document import Attributes, MovedMesh, as_bytes
from fairing.mesh_formats.numbers import count, float_texts, floats, shown, whole
from fairing.mesh_formats.polygons import Polygons, recut, triangulated
from fairing.mesh_formats.vertex_normals import moved_normals

_HEADER = re.compile(rb"(?P<texture>ST)?(?P<color>C)?(?P<normal>N)?OFF")


@dataclass(frozen=True, eq=False)
class OffDocument:
    """An OFF file, line by line.

    Attributes:
        lines: all lines with their line breaks.
        count_line: index of the line with the numbers of vertices and faces.
        vertex_lines, face_lines: (n,) and (p,) indices of the lines of vertices and faces.
        vertices: (n, 3) float, world units.
        polygons: the faces.
        has_normals, has_colors: whether vertices have them, as the header declares.
    """

    lines: list[bytes]
    count_line: int
    vertex_lines: list[int]
    face_lines: list[int]
    vertices: np.ndarray
    polygons: Polygons
    has_normals: bool
    has_colors: bool

    @cached_property
    def faces(self) -> np.ndarray:
        """(m, 3) int: the faces, triangulated."""
        return self.polygons.corners[self._triangles]

    @cached_property
    def _triangles(self) -> np.ndarray:
        return triangulated(self.vertices, self.polygons)

    def attributes(self) -> Attributes:
        """Colours of vertices and of faces, where all have one."""
        start = 6 if self.has_normals else 3
        of_faces = self._colors(self.face_lines, (self.polygons.sizes + 1).tolist())
        return Attributes(
            colors=self._colors(self.vertex_lines, [start] * len(self.vertices)) if self.has_colors else None,
            face_colors=None if of_faces is None else np.repeat(of_faces, self.polygons.sizes - 2, axis=0),
            has_normals=self.has_normals,
        )

    def moved(self, vertices: np.ndarray) -> MovedMesh:
        """The bytes with vertices (n, 3) float."""
        vertices = np.asarray(vertices, dtype=np.float64)
        words = float_texts(vertices)
        if self.has_normals:
            before = np.array([floats(_words(self.lines[i])[3:6]) for i in self.vertex_lines]).reshape(-1, 3)
            normals = float_texts(moved_normals(self.vertices, vertices, self.faces, before).astype(np.float32))
            words = [position + normal for position, normal in zip(words, normals, strict=True)]
        lines = list(self.lines)
        for i, row in zip(self.vertex_lines, words, strict=True):
            old, end = _split(lines[i])
            lines[i] = b" ".join([*row, *old[len(row) :]]) + end
        pieces = recut(vertices, self.polygons, self._triangles)
        for face, triangles in pieces.items():
            size, (words, end) = int(self.polygons.sizes[face]), _split(lines[self.face_lines[face]])
            rows = [
                [b"3", *(words[1 + corner] for corner in piece), *words[1 + size :]] for piece in triangles.tolist()
            ]
            lines[self.face_lines[face]] = b"".join(b" ".join(row) + end for row in rows)
        if pieces:
            words, end = _split(lines[self.count_line])
            place = next(i for i, word in enumerate(words) if word.isdigit()) + 1
            words[place] = b"%d" % (int(words[place]) + sum(len(triangles) - 1 for triangles in pieces.values()))
            lines[self.count_line] = b" ".join(words) + end
        return MovedMesh(b"".join(lines))

    def _colors(self, lines: list[int], starts: list[int]) -> np.ndarray | None:
        """RGB or RGBA from the given words of lines on; None unless every line has one."""
        rows = [_words(self.lines[i])[start : start + 4] for i, start in zip(lines, starts, strict=True)]
        if not rows or len(rows[0]) < 3 or len({len(row) for row in rows}) > 1:
            return None
        try:
            colors = np.array([floats(row) for row in rows])
        except ValueError:
            return None
        is_whole = all(word.isdigit() for row in rows for word in row)
        return as_bytes(np.clip(colors, 0, 255).astype(np.int64) if is_whole else colors)


def parse_off(data: bytes) -> OffDocument:
    """An OFF file: one line for each vertex and each face.

    Raises:
        InputError: another kind of OFF, a malformed line, or another number of lines than declared.
    """
    lines = data.splitlines(keepends=True)
    content = [i for i, line in enumerate(lines) if _words(line)]
    header = _words(lines[content[0]]) if content else []
    kind = _HEADER.fullmatch(header[0]) if header else None
    if kind is None or header[1:] == [b"BINARY"]:
        found = shown(b" ".join(header)) if header else "an empty file"
        raise InputError(f"expected OFF as text (OFF, or with ST, C or N before it), found {found}; export it as PLY")
    counts = header[1:]
    begin = 1
    if not counts and len(content) > 1:
        counts, begin = _words(lines[content[1]]), 2
    try:
        n_vertices, n_faces, *_ = [count(word) for word in counts]
    except ValueError:
        raise InputError(f"expected the numbers of vertices and faces, found {shown(b' '.join(counts))}") from None
    if len(content) - begin != n_vertices + n_faces:
        raise InputError(
            f"expected {n_vertices} vertices and {n_faces} faces as declared, one line each, found "
            f"{len(content) - begin} lines; it is incomplete, export it again"
        )
    vertex_lines, face_lines = content[begin : begin + n_vertices], content[begin + n_vertices :]
    n_numbers = 6 if kind["normal"] else 3
    vertices = [_vertex(lines[i], i, n_numbers) for i in vertex_lines]
    polygons = [_polygon(lines[i], i) for i in face_lines]
    return OffDocument(
        lines,
        content[begin - 1],
        vertex_lines,
        face_lines,
        np.array(vertices).reshape(-1, 3),
        Polygons(
            np.array([corner for polygon in polygons for corner in polygon], dtype=np.int64),
            np.array([len(polygon) for polygon in polygons], dtype=np.int64),
        ),
        kind["normal"] is not None,
        kind["color"] is not None,
    )


def _words(line: bytes) -> list[bytes]:
    return line.partition(b"#")[0].split()


def _split(line: bytes) -> tuple[list[bytes], bytes]:
    """The words of a line, with its comment, and its line break."""
    return line.split(), line[len(line.rstrip(b"\r\n")) :] or b"\n"


def _vertex(line: bytes, index: int, n_numbers: int) -> list[float]:
    try:
        numbers = floats(_words(line)[:n_numbers])
        if len(numbers) < n_numbers:
            raise ValueError("too few")
    except ValueError:
        raise InputError(f"line {index + 1}: expected {n_numbers} numbers of a vertex, found {shown(line)}") from None
    return numbers[:3]


def _polygon(line: bytes, index: int) -> list[int]:
    words = _words(line)
    try:
        size = count(words[0])
        corners = whole(words[1 : size + 1])
        if size < 3 or len(corners) < size:
            raise ValueError("not a polygon")
    except ValueError:
        raise InputError(f"line {index + 1}: expected a face `n a b c ...`, found {shown(line)}") from None
    return corners

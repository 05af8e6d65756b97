"""Wavefront OBJ: faces with texture coordinates, normals, groups and materials; every other line is kept as it is.

Source: Wavefront, Advanced Visualizer manual, appendix B1, https://paulbourke.net/dataformats/obj/.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fairing.errors import InputError
from fairing.mesh_formats.document import Attributes, MovedMesh, as_bytes
from fairing.mesh_formats.numbers import float_texts, floats, shown, whole
from fairing.mesh_formats.polygons import Polygons, recut, triangulated
from fairing.mesh_formats.vertex_normals import group_normals
from fairing.weld import merged_if_equal

_BOM = b"\xef\xbb\xbf"
_LARGEST_INDEX = 1 << 40
_NONE = -1
"""A corner without a texture coordinate or normal."""
_ABSENT = 1 << 62
_FACE = (b"f", b"fo")
_VERTEX, _UV, _NORMAL, _FACE_CODE = 1, 2, 3, 4
_CODES = {b"v": _VERTEX, b"vt": _UV, b"vn": _NORMAL, **dict.fromkeys(_FACE, _FACE_CODE)}
_FORMS = {0: [0], 1: [0, 1], 2: [0, 1, 2], 4: [0, 2]}
"""The numbers of a corner, by its slashes, and two more where they stand together: `a`, `a/b`, `a/b/c`, `a//c`."""
_KEPT_DIGITS = 7
"""Decimals to which normals must agree to be written once."""


@dataclass(frozen=True, eq=False)
class ObjDocument:
    """An OBJ file: its statements in order, and the numbers of vertices and corners.

    Attributes:
        statements: bytes of each statement, with its line breaks and continuations.
        vertices: (n, 3) float, world units.
        uv: (t, 2) float, the statements `vt`.
        normals: (k, 3) float, the statements `vn`.
        corners: (c, 3) int: vertex, texture coordinate and normal of each face's corners, one face after the other.
        sizes: (p,) int: number of corners of each face.
    """

    statements: list[bytes]
    vertices: np.ndarray
    uv: np.ndarray
    normals: np.ndarray
    corners: np.ndarray
    sizes: np.ndarray

    @cached_property
    def faces(self) -> np.ndarray:
        """(m, 3) int: the faces, triangulated."""
        return self.corners[self._triangles, 0]

    @cached_property
    def _triangles(self) -> np.ndarray:
        return triangulated(self.vertices, self._polygons)

    @cached_property
    def _polygons(self) -> Polygons:
        return Polygons(self.corners[:, 0], self.sizes)

    def attributes(self) -> Attributes:
        """Colours and texture coordinates if every vertex or corner has them; groups and materials have no place."""
        uv_ids = self.corners[self._triangles, 1]
        has_uv = len(uv_ids) > 0 and uv_ids.min() >= 0 and uv_ids.max() < len(self.uv)
        has_normals = bool((self.corners[:, 2] >= 0).any())
        return Attributes(self._colors(), corner_uv=self.uv[uv_ids] if has_uv else None, has_normals=has_normals)

    def moved(self, vertices: np.ndarray) -> MovedMesh:
        """The bytes with vertices (n, 3) float, and the names of its material files.

        A normal that corners at several vertices share becomes one for each, and faces refer to the new ones.
        """
        positions = iter(float_texts(np.asarray(vertices, dtype=np.float64)))
        normals, normal_of_corner, counts = self._new_normals(vertices)
        normal_texts, of_normal = iter(float_texts(normals.astype(np.float32))), iter(counts.tolist())
        pieces = recut(vertices, self._polygons, self._triangles)
        at, face, written, libraries = 0, 0, [], []
        for statement in self.statements:
            words = _words(statement)
            kind = words[0] if words else b""
            if kind == b"v":
                statement = _line([b"v", *next(positions), *words[4:]], statement)
            elif kind == b"vn":
                statement = b"".join(_line([b"vn", *next(normal_texts)], statement) for _ in range(next(of_normal)))
            elif kind in _FACE:
                size = len(words) - 1
                if len(normals) != len(self.normals):
                    words = [kind, *_renumbered(words[1:], normal_of_corner[at : at + size])]
                    statement = _line(words, statement)
                if face in pieces:
                    triangles = [[kind, *(words[1 + corner] for corner in piece)] for piece in pieces[face].tolist()]
                    statement = b"".join(_line(triangle, statement) for triangle in triangles)
                at, face = at + size, face + 1
            elif kind == b"mtllib":
                libraries += _file_names(words, statement)
            written.append(statement)
        return MovedMesh(b"".join(written), tuple(libraries))

    def _colors(self) -> np.ndarray | None:
        rows = [words[4:7] for words in map(_words, self.statements) if words[:1] == [b"v"]]
        try:
            return as_bytes(np.array([floats(row) for row in rows]).reshape(len(rows), 3)) if rows else None
        except ValueError:  # some have no colour
            return None

    def _new_normals(self, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The statements `vn` (k', 3) float anew, the one of each corner (c,) int, and how many each old one becomes (k,)."""
        n_normals, of_corner = len(self.normals), self.corners[:, 2]
        if n_normals == 0:
            return self.normals, np.full(len(of_corner), _NONE), np.zeros(0, dtype=np.int64)
        is_used = (of_corner >= 0) & (of_corner < n_normals)
        place = merged_if_equal(self.vertices)[1]
        pair = np.full(len(of_corner), -1)
        in_range = np.clip(self.corners[:, 0], 0, max(len(place) - 1, 0))
        keys, pair[is_used] = np.unique(of_corner[is_used] * len(place) + place[in_range[is_used]], return_inverse=True)
        old = keys // max(len(place), 1)
        new = group_normals(np.asarray(vertices, dtype=np.float64), self.faces, pair[self._triangles], len(keys))
        new = np.where((new != 0).any(axis=1, keepdims=True), new, self.normals[old])
        # One statement for the pairs of an old normal that agree, and one for an old normal that no corner uses.
        unused = np.setdiff1d(np.arange(n_normals), old)
        rows = np.column_stack([np.concatenate([old, unused]), np.concatenate([new, self.normals[unused]])])
        _, first, entry = np.unique(rows.round(_KEPT_DIGITS), axis=0, return_index=True, return_inverse=True)
        of_old = rows[first, 0].astype(np.int64)
        entry_of_corner = np.where(is_used, entry.reshape(-1)[pair] if len(entry) else 0, _NONE)
        return rows[first, 1:], entry_of_corner, np.bincount(of_old, minlength=n_normals)


def parse_obj(data: bytes) -> ObjDocument:
    """An OBJ file in any encoding that contains ASCII. Of the faces' indices, those of vertices are not checked.

    Raises:
        InputError: a malformed vertex, texture coordinate, normal or face.
    """
    statements, numbers = _statements(data)
    kinds = np.array(
        [_CODES.get(words[0], 0) if (words := _words(line, 1)) else 0 for line in statements], dtype=np.int8
    )

    def rows(kind: int) -> tuple[np.ndarray, list[list[bytes]]]:
        """Indices of the statements of a kind, and their words."""
        at = np.flatnonzero(kinds == kind)
        return at, [_words(statements[i])[1:] for i in at.tolist()]

    def refused(at: Any) -> InputError:
        found = shown(statements[at].strip())
        return InputError(f"line {numbers[at]}: expected `v x y z` or `f a b c`, found {found}")

    def table(kind: int, columns: int) -> np.ndarray:
        at, words = rows(kind)
        if kind == _UV:  # the second coordinate of a curve's texture may be missing
            words = [[*row, b"0"] for row in words]
        short = next((i for i, row in enumerate(words) if len(row) < columns), None)
        try:
            if short is not None:
                raise refused(at[short])
            return np.array(floats([word for row in words for word in row[:columns]])).reshape(-1, columns)
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            raise refused(at[_first_malformed(words, lambda row: floats(row[:columns]))]) from None

    vertices, uv, normals = table(_VERTEX, 3), table(_UV, 2), table(_NORMAL, 3)
    at, words = rows(_FACE_CODE)
    sizes = np.array([len(row) for row in words], dtype=np.int64)
    if (sizes < 3).any():
        raise refused(at[np.flatnonzero(sizes < 3)[0]])
    try:
        corners = _corners([word for row in words for word in row])
    except ValueError:
        raise refused(at[_first_malformed(words, _corners)]) from None
    for column, kind in enumerate((_VERTEX, _UV, _NORMAL)):
        before = np.repeat(np.cumsum(kinds == kind)[at], sizes)
        indices = corners[:, column].copy()
        is_relative = (indices < 0) & (indices != _ABSENT)
        corners[:, column] = np.where(is_relative, indices + before, indices - 1)
        if column and (is_relative & (corners[:, column] < 0)).any():
            raise refused(at[np.repeat(np.arange(len(at)), sizes)[is_relative & (corners[:, column] < 0)][0]])
        corners[indices == _ABSENT, column] = _NONE
    return ObjDocument(statements, vertices, uv, normals, corners, sizes)


def write_obj(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    """An OBJ file of vertices (n, 3) float and triangles (m, 3) int, without loss."""
    lines = [b"v " + b" ".join(row) for row in float_texts(np.asarray(vertices, dtype=np.float64))]
    lines += [b"f %d %d %d" % (a, b, c) for a, b, c in (np.asarray(faces) + 1).tolist()]
    return b"\n".join(lines) + b"\n"


def _statements(data: bytes) -> tuple[list[bytes], Sequence[int]]:
    """The statements and the numbers of their first lines; a line that ends in a backslash goes on in the next one."""
    lines = data.splitlines(keepends=True)
    if b"\\" not in data:
        return lines, range(1, len(lines) + 1)
    statements, numbers = [], []
    begun = False
    for number, line in enumerate(lines, start=1):
        if begun:
            statements[-1] += line
        else:
            statements.append(line)
            numbers.append(number)
        begun = line.rstrip(b"\r\n").endswith(b"\\") and not statements[-1].lstrip().startswith(b"#")
    return statements, numbers


def _words(statement: bytes, most: int = -1) -> list[bytes]:
    """The words of a statement, of faces without a comment; the rest in one piece after the given number of words."""
    if b"\\" in statement:
        for line_break in (b"\\\r\n", b"\\\n", b"\\\r"):
            statement = statement.replace(line_break, b" ")
    words = statement.removeprefix(_BOM).split(None, most)
    if b"#" in statement and words[0] in _FACE:
        words = words[: next((i for i, word in enumerate(words) if word.startswith(b"#")), len(words))]
    return words


def _corners(words: list[bytes]) -> np.ndarray:
    """(c, 3) int: vertex, texture coordinate and normal of corners `a`, `a/b`, `a//c` or `a/b/c` as they are written.

    `_ABSENT` where there is none. Raises ValueError.
    """
    words = [word.rstrip(b"/") for word in words]
    corners = np.full((len(words), 3), _ABSENT)
    forms = np.array([word.count(b"/") + 2 * (b"//" in word) for word in words], dtype=np.int64)
    for form in np.unique(forms).tolist():
        if form not in _FORMS:
            raise ValueError("not a corner")
        of_form = np.flatnonzero(forms == form)
        chosen = [words[i] for i in of_form.tolist()] if len(of_form) < len(words) else words
        parts = whole(b"/".join(chosen).replace(b"//", b"/").split(b"/"))
        corners[of_form[:, None], _FORMS[form]] = np.array(parts).reshape(len(of_form), len(_FORMS[form]))
    is_wrong = (corners == 0) | (np.abs(corners) > _LARGEST_INDEX)
    if (is_wrong & (corners != _ABSENT)).any():
        raise ValueError("no index")
    return corners


def _first_malformed(rows: list[list[bytes]], check: Callable[[list[bytes]], object]) -> int:
    """Index of the first row for which a check raises ValueError."""
    for i, row in enumerate(rows):
        try:
            check(row)
        except ValueError:
            return i
    raise AssertionError("no row is malformed")


def _renumbered(words: list[bytes], normals: np.ndarray) -> list[bytes]:
    """The corners of a face with other normals, (k,) int from 0, where they are not negative."""
    return [
        word if normal < 0 else b"%b/%d" % (word.rpartition(b"/")[0], normal + 1)
        for word, normal in zip(words, normals.tolist(), strict=True)
    ]


def _line(words: list[bytes], statement: bytes) -> bytes:
    """A statement of these words, with the line break of another one."""
    return b" ".join(words) + statement[len(statement.rstrip(b"\r\n")) :]


def _file_names(words: list[bytes], statement: bytes) -> list[str]:
    """The files of a statement `mtllib`: several words, or one name with spaces."""
    whole_name = statement.strip().partition(words[0])[2].strip()
    return [name.decode("utf-8", "replace") for name in dict.fromkeys([whole_name, *words[1:]])]

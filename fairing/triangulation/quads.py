"""Quads: interior edges of a mesh with their two faces, and whether the other diagonal may replace an edge."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from fairing.geometry.normals import face_normals, face_quality, unit_normals

MIN_QUALITY = 0.05
"""Least height over longest edge of a new face; thinner faces are made only in place of still thinner ones."""
SHARPEST = np.cos(np.deg2rad(150))
"""Cosine of the largest angle between the normals of neighbours; more is a fold, unless it existed before."""


class Verdict(IntEnum):
    """Result for an edge in a search for edges to flip."""

    FLIPPED = 0
    NO_GAIN = 1
    BOUNDARY = 2
    TWICE = 3
    THIN = 4
    FOLD = 5
    TURNED_AWAY = 6
    TOO_FEW_PHOTOS = 7
    TAKEN_BACK = 8

    @property
    def text(self) -> str:
        return _TEXTS[self]


_TEXTS = {
    Verdict.FLIPPED: "flipped: the photos that see all four faces agree better with the other diagonal",
    Verdict.NO_GAIN: "kept: the other diagonal is not better",
    Verdict.BOUNDARY: "kept: the edge does not have two consistently oriented faces",
    Verdict.TWICE: "kept: the other diagonal is already an edge",
    Verdict.THIN: "kept: a face would have collapsed",
    Verdict.FOLD: "kept: a face would have folded over",
    Verdict.TURNED_AWAY: "kept: a face would have turned away from a photo that sees the quad",
    Verdict.TOO_FEW_PHOTOS: "kept: fewer than three photos see all four faces",
    Verdict.TAKEN_BACK: "kept: with the new visibility the energy of the mesh would have risen",
}


@dataclass(frozen=True, eq=False)
class Quads:
    """Q interior edges. The faces at edge (a, b) are (a, b, c) and (b, a, d), consistently oriented; a < b.

    Attributes:
        edge: (Q, 2) int: a, b.
        opposite: (Q, 2) int: c, d.
        faces: (Q, 2) int: ids of the face with c and of the face with d.
        n_other: number of other edges, which cannot be flipped: boundary, non-manifold, or inconsistently oriented.
    """

    edge: np.ndarray
    opposite: np.ndarray
    faces: np.ndarray
    n_other: int

    def of(self, rows: np.ndarray) -> "Quads":
        """A subset, by index (k,) int."""
        return Quads(self.edge[rows], self.opposite[rows], self.faces[rows], self.n_other)

    def flipped(self) -> tuple[np.ndarray, np.ndarray]:
        """(Q, 3) and (Q, 3) int: the faces that replace those with c and d, consistently oriented."""
        (a, b), (c, d) = self.edge.T, self.opposite.T
        return np.column_stack([a, d, c]), np.column_stack([d, b, c])


def find_quads(faces: np.ndarray) -> Quads:
    """The edges with exactly two faces that run along them in opposite directions, sorted by (a, b).

    Args:
        faces: (m, 3) int.
    """
    start, end = faces[:, [0, 1, 2]].ravel(), faces[:, [1, 2, 0]].ravel()
    third = faces[:, [2, 0, 1]].ravel()
    size = int(faces.max()) + 1
    keys = np.minimum(start, end) * size + np.maximum(start, end)
    order = np.lexsort((start > end, keys))  # along an edge the face that runs from low to high comes first
    sorted_keys = keys[order]
    first = np.flatnonzero(np.concatenate([[True], sorted_keys[1:] != sorted_keys[:-1]]))
    count = np.diff(np.concatenate([first, [len(order)]]))
    pair = first[count == 2]
    one, two = order[pair], order[pair + 1]
    good = (start[one] < end[one]) & (start[two] > end[two]) & (third[one] != third[two])
    one, two = one[good], two[good]
    return Quads(
        np.column_stack([start[one], end[one]]),
        np.column_stack([third[one], third[two]]),
        np.column_stack([one // 3, two // 3]),
        len(first) - len(one),
    )


def edge_keys(edges: np.ndarray) -> set[tuple[int, int]]:
    """Edges (e, 2) int as pairs, lower vertex first."""
    return {(min(a, b), max(a, b)) for a, b in edges.tolist()}


def judge_shapes(quads: Quads, faces: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Test flips by shape alone.

    The two new faces span the same vector area as the old ones. Both must face its direction: otherwise the quad is not
    convex seen from there, and one of them is folded over. They must not fold against the four neighbours (angles between
    normals up to 150 degrees), unless an old face did.

    Args:
        faces: (m, 3) int: the mesh.
        vertices: (n, 3) float, world units.

    Returns:
        (Q,) int8: the `Verdict` that forbids a flip; `FLIPPED` where none does.
    """
    verdict = np.full(len(quads.edge), Verdict.FLIPPED, dtype=np.int8)
    one, two = quads.flipped()
    old = [faces[quads.faces[:, 0]], faces[quads.faces[:, 1]]]
    old_quality = np.minimum(*(face_quality(vertices, f) for f in old))
    new_quality = np.minimum(*(face_quality(vertices, f) for f in (one, two)))
    n_one, n_two = face_normals(vertices, one), face_normals(vertices, two)
    total = n_one + n_two
    folds = ((n_one * total).sum(axis=1) <= 0) | ((n_two * total).sum(axis=1) <= 0)
    sharpest_old, sharpest_new = _sharpest(quads, faces, vertices, (n_one, n_two))
    folds |= (sharpest_new < SHARPEST) & (sharpest_new < sharpest_old)
    verdict[folds] = Verdict.FOLD
    verdict[(new_quality < MIN_QUALITY) & (new_quality <= old_quality)] = Verdict.THIN
    existing = edge_keys(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2))
    twice = np.array([(min(c, d), max(c, d)) in existing for c, d in quads.opposite.tolist()], dtype=bool)
    verdict[twice] = Verdict.TWICE
    return verdict


def _sharpest(
    quads: Quads, faces: np.ndarray, vertices: np.ndarray, new: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """(Q,) and (Q,) float: smallest cosine between normals across the five edges of a quad, before and after."""
    normals, _ = unit_normals(vertices, faces)
    new_one, new_two = (n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300) for n in new)
    # The neighbour across a directed edge contains the reversed edge; -1 where there is none.
    size = int(faces.max()) + 1
    directed = faces[:, [0, 1, 2]].ravel() * size + faces[:, [1, 2, 0]].ravel()
    order = np.argsort(directed, kind="stable")

    def beyond(start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Ids of the faces with the directed edges from `end` to `start`."""
        wanted = end * size + start
        at = np.minimum(np.searchsorted(directed[order], wanted), len(order) - 1)
        return np.where(directed[order][at] == wanted, order[at] // 3, -1)

    (a, b), (c, d) = quads.edge.T, quads.opposite.T
    old_c, old_d = normals[quads.faces[:, 0]], normals[quads.faces[:, 1]]
    sharpest_old, sharpest_new = (old_c * old_d).sum(axis=1), (new_one * new_two).sum(axis=1)
    # Outer edges of the quads, with the old and the new face on the inner side.
    for start, end, old_inside, new_inside in (
        (b, c, old_c, new_two), (c, a, old_c, new_one), (a, d, old_d, new_one), (d, b, old_d, new_two),
    ):  # fmt: skip
        neighbour = beyond(start, end)
        exists = neighbour >= 0
        outside = normals[neighbour]
        sharpest_old = np.where(exists, np.minimum(sharpest_old, (old_inside * outside).sum(axis=1)), sharpest_old)
        sharpest_new = np.where(exists, np.minimum(sharpest_new, (new_inside * outside).sum(axis=1)), sharpest_new)
    return sharpest_old, sharpest_new

"""Tetrahedra as triangles to be drawn and picked, each with its tetrahedron."""

from dataclasses import dataclass

import numpy as np

from fairing.triangulation import Carving
from fairing.triangulation.tetrahedra import CORNERS

SHRUNK = 0.92  # size of cross sections: gaps tell neighbors apart
_CROSSED = {
    1: ((0, 1), (0, 2), (0, 3)),
    2: ((0, 2), (0, 3), (1, 3), (1, 2)),
    3: ((3, 0), (3, 1), (3, 2)),
}
"""The edges that the outline of a cross section goes along, by the number of corners above the plane, which come first."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles to be drawn.

    Attributes:
        corners: (m, 3, 3) float32, page units.
        tetrahedra: (m,) int: the tetrahedron of each.
    """

    corners: np.ndarray
    tetrahedra: np.ndarray

    def of(self, chosen: np.ndarray) -> np.ndarray:
        """(k, 3, 3) float32: those triangles (m,) bool."""
        return self.corners[chosen]


def hull_of(carving: Carving, shown: np.ndarray, places: np.ndarray) -> Triangles:
    """The outer facets of the shown tetrahedra (T,) bool; `places` (n + 8, 3) float32, page units."""
    mesh = carving.mesh
    outer = shown[:, None] & ~(shown[mesh.neighbours] & (mesh.neighbours >= 0))
    tetrahedron, facet = np.nonzero(outer)
    return Triangles(places[mesh.corners[tetrahedron[:, None], CORNERS[facet]]], tetrahedron)


def cross_sections(corners: np.ndarray, heights: np.ndarray, ids: np.ndarray, normal: np.ndarray) -> Triangles:
    """Where a plane crosses tetrahedra: triangles and halves of quads in the plane, drawn apart from each other.

    Args:
        corners: (k, 4, 3) float, page units.
        heights: (k, 4) float: of the corners over the plane, none of them 0, on both sides for each tetrahedron.
        ids: (k,) int: the tetrahedra.
        normal: (3,) float: unit vector; the triangles are counter-clockwise seen from where it points.
    """
    order = np.argsort(-heights, axis=1)
    corners, heights = np.take_along_axis(corners, order[:, :, None], 1), np.take_along_axis(heights, order, 1)
    n_above = (heights > 0).sum(axis=1)
    found, owners = [], []
    for above, pairs in _CROSSED.items():
        chosen = n_above == above
        a, b = np.array(pairs).T
        h = heights[chosen]
        along = h[:, a] / (h[:, a] - h[:, b])
        outline = corners[chosen][:, a] + along[:, :, None] * (corners[chosen][:, b] - corners[chosen][:, a])
        middle = outline.mean(axis=1, keepdims=True)
        outline = middle + SHRUNK * (outline - middle)
        for k in range(1, len(pairs) - 1):
            found.append(outline[:, [0, k, k + 1]])
            owners.append(ids[chosen])
    triangles = np.concatenate(found)
    turned = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) @ normal < 0
    triangles[turned] = triangles[turned][:, ::-1]
    return Triangles(triangles.astype(np.float32), np.concatenate(owners))


def sunk(corners: np.ndarray, depth: float) -> np.ndarray:
    """Triangles (m, 3, 3) moved against their normals, so that their sides can be drawn before them."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return (corners - depth * normals[:, None]).astype(np.float32)


def edges_of(corners: np.ndarray) -> np.ndarray:
    """(6, 2, 3): the edges of a tetrahedron with corners (4, 3)."""
    return corners[[[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]]

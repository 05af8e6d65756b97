"""Tetrahedra as triangles to be drawn and picked, each with its tetrahedron."""

from dataclasses import dataclass

import numpy as np

from fairing.triangulation import Carving
from fairing.triangulation.tetrahedra import CORNERS

SHRUNK = 0.72  # size of tetrahedra that are drawn one by one


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


def shrunken(carving: Carving, ids: np.ndarray, places: np.ndarray) -> tuple[Triangles, np.ndarray]:
    """The facets of tetrahedra (k,) int, each shrunken towards its middle, and their edges (6 k, 2, 3) float32."""
    corners = places[carving.mesh.corners[ids]]
    middle = corners.mean(axis=1, keepdims=True)
    corners = (middle + SHRUNK * (corners - middle)).astype(np.float32)
    return Triangles(corners[:, CORNERS].reshape(-1, 3, 3), np.repeat(ids, 4)), edges_of(corners)


def edges_of(corners: np.ndarray) -> np.ndarray:
    """(6 k, 2, 3): the edges of tetrahedra with corners (k, 4, 3)."""
    return corners[:, [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]].reshape(-1, 2, 3)

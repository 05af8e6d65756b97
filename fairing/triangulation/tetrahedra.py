"""Delaunay tetrahedra of points, inside a box that holds the cameras too: every line of sight stays within them."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay

BOX = 10.0
"""Half the box's width, in units of the largest distance of a point or camera from the centre."""
NUDGE = 1e-7
"""Points are moved at random by this fraction of the points' extent, so that no five of them lie on a sphere (grids do)."""
CORNERS = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
"""Corners of the facet opposite each vertex, counter-clockwise seen from outside the tetrahedron."""


@dataclass(frozen=True, eq=False)
class Tetrahedra:
    """T Delaunay tetrahedra of n points and the 8 corners of a box around them.

    Attributes:
        places: (n + 8, 3) float: positions, shifted and scaled to an extent of about 1; the last 8 are the box.
        center: (3,) float, world units: the origin of `places`.
        unit: length of 1 in world units.
        corners: (T, 4) int: vertices, oriented such that `CORNERS` holds.
        neighbours: (T, 4) int: the tetrahedron beyond the facet opposite each vertex, -1 beyond the box.
        of_cameras: (V,) int: the tetrahedron of each camera.
        cameras: (V, 3) float: positions of the cameras, as `places`.
    """

    places: np.ndarray
    center: np.ndarray
    unit: float
    corners: np.ndarray
    neighbours: np.ndarray
    of_cameras: np.ndarray
    cameras: np.ndarray

    @property
    def n_points(self) -> int:
        """Number of points without the box."""
        return len(self.places) - 8

    def edge_lengths(self) -> np.ndarray:
        """(e,) float: lengths of the edges between points, once for each tetrahedron."""
        ends = self.corners[:, [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]].reshape(-1, 2)
        ends = ends[(ends < self.n_points).all(axis=1)]
        return np.linalg.norm(self.places[ends[:, 0]] - self.places[ends[:, 1]], axis=1)

    def facet_quality(self) -> np.ndarray:
        """(T, 4) float: cost of each facet as surface, 0 to 2: 1 - min(cos a, cos b) (Labatut, Pons, Keriven 2009).

        a and b are the angles at which the circumspheres of its two tetrahedra meet the facet's plane. It is small
        where both spheres are large on their own side, as they are at the surface of a dense sample.
        """
        a, b, c, d = (self.places[self.corners[:, k]] for k in range(4))
        u, v, w = b - a, c - a, d - a
        volume = 2 * (u * np.cross(v, w)).sum(axis=1, keepdims=True)
        squares = [(x**2).sum(axis=1, keepdims=True) for x in (u, v, w)]
        offset = (squares[0] * np.cross(v, w) + squares[1] * np.cross(w, u) + squares[2] * np.cross(u, v)) / np.where(
            volume == 0, 1e-300, volume
        )
        radius = np.maximum(np.linalg.norm(offset, axis=1), 1e-300)
        center = a + offset
        cosine = np.empty(self.corners.shape)
        for k, facet in enumerate(CORNERS):
            p, q, r = (self.places[self.corners[:, i]] for i in facet)
            outward = np.cross(q - p, r - p)
            outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-300)
            # The centre's height over the facet, on the tetrahedron's side, over the radius.
            cosine[:, k] = ((p - center) * outward).sum(axis=1) / radius
        beyond = self.across(cosine, np.ones(self.corners.shape))
        return 1 - np.clip(np.minimum(cosine, beyond), -1, 1)

    def across(self, values: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
        """(T, 4): for each facet the value (T, 4) of the same facet as part of its other tetrahedron."""
        t, k = np.nonzero(self.neighbours >= 0)
        other = self.neighbours[t, k]
        back = np.argmax(self.neighbours[other] == t[:, None], axis=1)
        result = otherwise.copy()
        result[t, k] = values[other, back]
        return result


def tetrahedra(points: np.ndarray, cameras: np.ndarray) -> Tetrahedra:
    """Delaunay tetrahedra of points (n, 3) float, world units, and a box around them and the cameras (V, 3)."""
    low, high = points.min(axis=0), points.max(axis=0)
    center, unit = (low + high) / 2, max(float((high - low).max()), 1e-300)
    places = (points - center) / unit
    places += NUDGE * np.random.default_rng(0).uniform(-1, 1, places.shape)
    eyes = (cameras - center) / unit
    half = BOX * max(1.0, float(np.abs(eyes).max()))
    # Not a cube: its corners lie on a sphere.
    box = half * np.array(
        [[x, 1.1 * y + 0.05 * x, 1.2 * z + 0.03 * y] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    )
    places = np.vstack([places, box])
    found = Delaunay(places)
    corners, neighbours = found.simplices.astype(np.int64), found.neighbors.astype(np.int64)
    a, b, c, d = (places[corners[:, k]] for k in range(4))
    inverted = ((b - a) * np.cross(c - a, d - a)).sum(axis=1) < 0
    corners[inverted] = corners[inverted][:, [0, 1, 3, 2]]
    neighbours[inverted] = neighbours[inverted][:, [0, 1, 3, 2]]
    of_cameras = found.find_simplex(eyes).astype(np.int64)
    return Tetrahedra(places, center, unit, corners, neighbours, of_cameras, eyes)


def facet_neighbours(corners: np.ndarray) -> np.ndarray:
    """(T, 4) int: the tetrahedron beyond the facet opposite each corner (T, 4), -1 where there is none.

    Raises:
        ValueError: more than two tetrahedra share a facet.
    """
    facets = np.sort(corners[:, CORNERS], axis=2).reshape(-1, 3)
    _, facet, count = np.unique(facets, axis=0, return_inverse=True, return_counts=True)
    if (count > 2).any():
        raise ValueError("expected a facet of at most two tetrahedra, found more")
    order = np.argsort(facet.ravel(), kind="stable")
    order = order[count[facet.ravel()[order]] == 2]
    one, two = order[::2], order[1::2]
    neighbours = np.full(corners.size, -1)
    neighbours[one], neighbours[two] = two // 4, one // 4
    return neighbours.reshape(-1, 4)

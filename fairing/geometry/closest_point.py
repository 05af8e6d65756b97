"""Closest point: exact distances from points to a triangle mesh, by a bounding volume hierarchy."""

import numpy as np
from numba import njit

from fairing.mesh import Mesh
from fairing.util.compiled_only import COMPILED_ONLY

_LEAF = 4
"""Triangles per leaf."""
_TIE = 1e-12
"""Relative: squared distances that differ by less are equal."""


class SurfaceTree:
    """Bounding volume hierarchy of a mesh for many closest-point queries.

    Triangles are sorted along a space-filling curve; every `_LEAF` of them share a box, and boxes are merged in pairs up to
    one root.
    """

    def __init__(self, mesh: Mesh) -> None:
        triangles = mesh.vertices[mesh.faces]
        self._order = np.argsort(_morton(triangles.mean(axis=1)), kind="stable")
        leaves = 1 << max(0, int(np.ceil(np.log2(len(triangles) / _LEAF))))
        self._triangles = triangles[self._order]
        low, high = np.full((2 * leaves, 3), np.inf), np.full((2 * leaves, 3), -np.inf)
        leaf_of = leaves + np.arange(len(triangles)) // _LEAF
        np.minimum.at(low, leaf_of, self._triangles.min(axis=1))
        np.maximum.at(high, leaf_of, self._triangles.max(axis=1))
        level = leaves
        while level > 1:
            children, level = slice(level, 2 * level), level // 2
            low[level : 2 * level] = low[children].reshape(level, 2, 3).min(axis=1)
            high[level : 2 * level] = high[children].reshape(level, 2, 3).max(axis=1)
        self._low, self._high = low, high

    def distance(self, points: np.ndarray) -> np.ndarray:
        """(p,) float, world units: distances of points (p, 3), world units, to the surface."""
        return self.closest(points)[0]

    def closest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances (p,) float, world units, of points (p, 3), world units, and the faces (p,) int of the closest points.

        Of faces that meet at the closest point it is the one whose plane is farthest from the point: the one that faces it most.
        """
        points = np.array(points, dtype=np.float64, order="C")  # a copy: numba compiles again for one that is read-only
        distance, face = np.empty(len(points)), np.empty(len(points), dtype=np.int64)
        _search(points, self._triangles, self._low, self._high, distance, face)
        return distance, self._order[face]


def _morton(points: np.ndarray) -> np.ndarray:
    """(p,) uint64: position of points (p, 3) along a Z-order curve, 20 bits per axis."""
    low = points.min(axis=0)
    cells = ((points - low) / max(float(np.ptp(points, axis=0).max()), 1e-300) * (2**20 - 1)).astype(np.uint64)
    code = np.zeros(len(points), dtype=np.uint64)
    for bit in range(20):
        for axis in range(3):
            code |= ((cells[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return code


@njit(cache=True, nogil=True)
def _search(points, triangles, low, high, distance, face):
    """Closest triangle of each point, into `distance` and `face` (p,); low, high (2 * leaves, 3): the boxes, root at 1."""
    leaves = low.shape[0] // 2
    stack, to_box = np.empty(64, dtype=np.int64), np.empty(64)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        best, best_face, best_height = np.inf, 0, 0.0
        stack[0], to_box[0], size = 1, 0.0, 1
        while size > 0:
            size -= 1
            node = stack[size]
            if to_box[size] > best * (1 + _TIE):
                continue
            if node < leaves:
                left, right = 2 * node, 2 * node + 1
                to_left = _squared_to_box(x, y, z, low, high, left)
                to_right = _squared_to_box(x, y, z, low, high, right)
                # The nearer child is pushed last, so that it is visited first.
                if to_left < to_right:
                    left, right, to_left, to_right = right, left, to_right, to_left
                stack[size], to_box[size] = left, to_left
                stack[size + 1], to_box[size + 1] = right, to_right
                size += 2
                continue
            start = (node - leaves) * _LEAF
            for t in range(start, min(start + _LEAF, triangles.shape[0])):
                squared = _squared_to_triangle(x, y, z, triangles, t)
                if squared > best * (1 + _TIE):
                    continue
                height = _squared_to_plane(x, y, z, triangles, t)
                if squared < best * (1 - _TIE) or height > best_height:
                    best_face, best_height = t, height
                best = min(best, squared)
        distance[i] = np.sqrt(best)
        face[i] = best_face


@njit(nogil=True, **COMPILED_ONLY)
def _squared_to_box(x, y, z, low, high, box):
    """Squared distance of a point to an axis-aligned box; 0 inside."""
    dx = max(low[box, 0] - x, x - high[box, 0], 0.0)
    dy = max(low[box, 1] - y, y - high[box, 1], 0.0)
    dz = max(low[box, 2] - z, z - high[box, 2], 0.0)
    return dx * dx + dy * dy + dz * dz


@njit(nogil=True, **COMPILED_ONLY)
def _squared_to_plane(x, y, z, triangles, t):
    """Squared distance of a point to the plane of triangle t; 0 if it has no area."""
    ax, ay, az = triangles[t, 0, 0], triangles[t, 0, 1], triangles[t, 0, 2]
    ux, uy, uz = triangles[t, 1, 0] - ax, triangles[t, 1, 1] - ay, triangles[t, 1, 2] - az
    vx, vy, vz = triangles[t, 2, 0] - ax, triangles[t, 2, 1] - ay, triangles[t, 2, 2] - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    height = (x - ax) * nx + (y - ay) * ny + (z - az) * nz
    squared_normal = nx * nx + ny * ny + nz * nz
    return height * height / squared_normal if squared_normal > 0 else 0.0


@njit(nogil=True, **COMPILED_ONLY)
def _squared_to_segment(px, py, pz, dx, dy, dz):
    """Squared distance of the point p to the segment from the origin to d."""
    length = dx * dx + dy * dy + dz * dz
    t = min(max((px * dx + py * dy + pz * dz) / length, 0.0), 1.0) if length > 0 else 0.0
    x, y, z = px - t * dx, py - t * dy, pz - t * dz
    return x * x + y * y + z * z


@njit(nogil=True, **COMPILED_ONLY)
def _squared_to_triangle(px, py, pz, triangles, t):
    """Squared distance of a point to triangle t: to its plane if the foot of the perpendicular lies inside, else to an edge.

    In scalars: views of arrays count their references (ledger: closest points).
    """
    ax, ay, az = triangles[t, 0, 0], triangles[t, 0, 1], triangles[t, 0, 2]
    ux, uy, uz = triangles[t, 1, 0] - ax, triangles[t, 1, 1] - ay, triangles[t, 1, 2] - az
    vx, vy, vz = triangles[t, 2, 0] - ax, triangles[t, 2, 1] - ay, triangles[t, 2, 2] - az
    wx, wy, wz = px - ax, py - ay, pz - az
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    wu, wv = wx * ux + wy * uy + wz * uz, wx * vx + wy * vy + wz * vz
    determinant = uu * vv - uv * uv
    if determinant > 1e-14 * uu * vv:
        s, t = (vv * wu - uv * wv) / determinant, (uu * wv - uv * wu) / determinant
        if s >= 0 and t >= 0 and s + t <= 1:
            x, y, z = wx - s * ux - t * vx, wy - s * uy - t * vy, wz - s * uz - t * vz
            return x * x + y * y + z * z
    return min(
        _squared_to_segment(wx, wy, wz, ux, uy, uz),
        _squared_to_segment(wx, wy, wz, vx, vy, vz),
        _squared_to_segment(wx - ux, wy - uy, wz - uz, vx - ux, vy - uy, vz - uz),
    )

"""Polygons and their triangulation: a fan where it is valid, ear clipping where a polygon is concave."""

from typing import NamedTuple

import numpy as np

from fairing.errors import InputError
from fairing.geometry.normals import face_normals

MOST_CORNERS = 4096
"""Of a concave polygon: ear clipping takes time with the square of the number of corners."""


class Polygons(NamedTuple):
    """Polygons of any number of corners.

    Attributes:
        corners: (c,) int: the vertices of all polygons, one polygon after the other.
        sizes: (p,) int: number of corners of each polygon, at least 3.
    """

    corners: np.ndarray
    sizes: np.ndarray

    @classmethod
    def triangles(cls, faces: np.ndarray) -> "Polygons":
        """Of triangles (m, 3) int."""
        return cls(faces.reshape(-1), np.full(len(faces), 3))

    @property
    def starts(self) -> np.ndarray:
        """(p,) int: where each polygon's corners begin."""
        return np.cumsum(self.sizes) - self.sizes


def triangulated(vertices: np.ndarray, polygons: Polygons) -> np.ndarray:
    """The triangles of polygons, as (m, 3) int indices into `polygons.corners`, in the order of the polygons.

    A polygon of n corners becomes n - 2 triangles. Where all triangles from its first corner face as the polygon does, they
    are taken; other polygons are cut by ear clipping. Corners that are no vertices are left to the check of the mesh.

    Raises:
        InputError: a concave polygon has more than `MOST_CORNERS` corners.
    """
    counts = polygons.sizes - 2
    firsts = np.cumsum(counts) - counts
    polygon = np.repeat(np.arange(len(counts)), counts)
    k = np.arange(len(polygon)) - firsts[polygon]
    ids = polygons.starts[polygon][:, None] + np.column_stack([np.zeros_like(k), k + 1, k + 2])
    for p in _concave(vertices, polygons, ids, polygon):
        size, start = int(polygons.sizes[p]), int(polygons.starts[p])
        if size > MOST_CORNERS:
            raise InputError(
                f"face {p}: expected a concave polygon of at most {MOST_CORNERS} corners, found {size}; triangulate the mesh"
            )
        corners = vertices[polygons.corners[start : start + size]]
        ids[firsts[p] : firsts[p] + size - 2] = start + _clip_ears(_flattened(corners))
    return ids


def recut(vertices: np.ndarray, polygons: Polygons, ids: np.ndarray) -> dict[int, np.ndarray]:
    """The polygons that other vertices (n, 3) float would cut into other triangles than `ids`, as `triangulated` returns them.

    Such a polygon is written as its triangles, so that reading gives the faces of the mesh that was refined.

    Returns:
        By index of the polygon its triangles (t, 3) int, as places among its corners.
    """
    differs = (triangulated(vertices, polygons) != ids).any(axis=1)
    polygon = np.repeat(np.arange(len(polygons.sizes)), polygons.sizes - 2)
    starts = polygons.starts
    return {p: ids[polygon == p] - starts[p] for p in np.unique(polygon[differs]).tolist()}


def _concave(vertices: np.ndarray, polygons: Polygons, ids: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """Indices of the polygons with an area whose fan of triangles `ids` has one that is turned over or has no area."""
    corners = polygons.corners
    is_larger = (polygons.sizes > 3)[polygon]
    if not is_larger.any() or corners.min() < 0 or corners.max() >= len(vertices):
        return np.empty(0, dtype=np.int64)
    ids, polygon = ids[is_larger], polygon[is_larger]
    largest = np.abs(vertices).max()
    with np.errstate(invalid="ignore", over="ignore"):
        normals = face_normals(vertices / (largest or 1.0), corners[ids])
        whole = np.stack([np.bincount(polygon, normals[:, axis], len(polygons.sizes)) for axis in range(3)], axis=1)
        is_bad = ~((normals * whole[polygon]).sum(1) > 0)
        has_area = np.isfinite(whole).all(1) & (whole != 0).any(1)
    return np.unique(polygon[is_bad & has_area[polygon]])


def _flattened(corners: np.ndarray) -> np.ndarray:
    """(n, 2) float: corners (n, 3) along the polygon's normal, counter-clockwise, scaled to unit size."""
    corners = corners - corners[0]
    corners = corners / np.abs(corners).max()
    normal = np.cross(corners[1:-1], corners[2:]).sum(0)
    axis = int(np.abs(normal).argmax())
    first, second = (axis + 1) % 3, (axis + 2) % 3
    return corners[:, [first, second] if normal[axis] > 0 else [second, first]]


def _clip_ears(points: np.ndarray) -> np.ndarray:
    """(n - 2, 3) int: triangles of a counter-clockwise polygon (n, 2) float.

    Source: Meisters, Polygons have ears, American Mathematical Monthly 82, 1975.
    """
    left, triangles = np.arange(len(points)), []
    while len(left) > 3:
        ear = _ear(points[left])
        triangles.append(np.take(left, [ear - 1, ear, ear + 1], mode="wrap"))
        left = np.delete(left, ear)
    return np.array([*triangles, left])


def _ear(points: np.ndarray) -> int:
    """The first convex corner whose triangle holds no reflex corner; of a polygon that cuts itself, the most convex one."""
    before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
    doubled = _cross(points - before, after - points)
    reflex = points[doubled <= 0]
    for corner in np.flatnonzero(doubled > 0).tolist():
        triangle = np.stack([before[corner], points[corner], after[corner]])
        others = reflex[~(reflex[:, None] == triangle).all(2).any(1)]
        sides = _cross(np.roll(triangle, -1, axis=0) - triangle, others[:, None] - triangle)
        if not (sides >= 0).all(1).any():
            return corner
    return int(doubled.argmax())


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]

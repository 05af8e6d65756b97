"""A folded terrain: points on a true surface of many folds, its photos, and sparse points with observations."""

import numpy as np
from scipy.spatial import Delaunay

from fairing.camera import Camera
from fairing.photo import ArrayPhoto
from fairing.scene import SparsePoints, View
from tests.roof_scene import counter_clockwise, photo, plane_photos, plane_vertices, views_of


def pinhole(eye, target, up=(0, 1, 0)) -> Camera:
    z = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    x = np.cross(z, up) / np.linalg.norm(np.cross(z, up))
    R = np.stack([x, np.cross(z, x), z])
    K = np.array([[600, 0, 319.5], [0, 600, 239.5], [0, 0, 1]])
    return Camera.from_krt(K, R, -R @ np.asarray(eye, float), 640, 480)


BLANK = ArrayPhoto(np.zeros((480, 640, 3), np.uint8))
CAMERAS = [pinhole([x, y, 6], [0, 0, 0]) for x, y in ((0.1, 0), (-2, 1), (2, 1), (-2, -1), (2, -1))]
VIEWS = tuple(View(f"p{i}", camera, BLANK) for i, camera in enumerate(CAMERAS))


def terrain() -> tuple[np.ndarray, tuple[View, ...]]:
    """Points on a true surface of many folds, and its photos."""
    vertices = plane_vertices()
    vertices[:, 2] = 0.25 * np.abs(np.sin(3 * vertices[:, 0] + 1.3 * vertices[:, 1]))
    truth = counter_clockwise(Delaunay(vertices[:, :2] @ np.array([[1, 0.9], [0.2, 1]])).simplices, vertices)
    return vertices, views_of(tuple(photo(view.camera, vertices, truth, 2) for view in views_of(plane_photos())))


def seen_points(positions: np.ndarray, sees: np.ndarray | None = None, views=VIEWS) -> SparsePoints:
    """Points with exact pixels; `sees` (V, n) bool, default: everybody sees everything."""
    sees = np.ones((len(views), len(positions)), bool) if sees is None else sees
    view_id, point_id = np.nonzero(sees)
    pixels = np.stack([views[v].camera.project(positions[p])[0] for v, p in zip(view_id, point_id, strict=True)])
    colors = np.zeros((len(positions), 3), np.uint8)
    return SparsePoints(positions, colors, np.column_stack([point_id, view_id]), pixels)

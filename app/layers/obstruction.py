"""Obstruction: which camera frusta lie between the eye and the mesh."""

import cv2
import numpy as np


def covering(eye: np.ndarray, points: np.ndarray, centers: np.ndarray, radius: float) -> np.ndarray:
    """(V,) bool: the spheres that cover a part of the mesh's outline from the eye and do not lie wholly behind it.

    Args:
        eye: (3,) float, page units.
        points: (n, 3) float, page units: vertices of the mesh; its outline is their convex hull.
        centers: (V, 3) float, page units: centres of the spheres.
        radius: page units.
    """
    ahead = points.mean(axis=0) - eye
    distance = float(np.linalg.norm(ahead))
    if distance < 1e-9:
        return np.full(len(centers), False)
    ahead = ahead / distance
    side = np.cross(ahead, np.eye(3)[np.argmin(np.abs(ahead))])
    axes = np.stack([side / np.linalg.norm(side), np.cross(ahead, side / np.linalg.norm(side)), ahead])
    mesh, spheres = (points - eye) @ axes.T, (centers - eye) @ axes.T
    mesh = mesh[mesh[:, 2] > 1e-3 * distance]
    found = (spheres[:, 2] > -radius) & (spheres[:, 2] - radius < mesh[:, 2].max(initial=0.0))
    if len(mesh) < 3:
        return np.full(len(centers), False)
    hull = cv2.convexHull((mesh[:, :2] / mesh[:, 2:]).astype(np.float32))
    for k in np.flatnonzero(found):
        x, y, depth = spheres[k]
        depth = max(float(depth), 0.5 * radius)
        inside = cv2.pointPolygonTest(hull, (float(x) / depth, float(y) / depth), True)
        found[k] = inside > -radius / depth
    return found

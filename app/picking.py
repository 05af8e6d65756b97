"""Picking: the vertices within a rectangle of the 3D view, and the one nearest to a ray."""

import numpy as np

from fairing.camera import Camera
from fairing.geometry.rasterize import rasterize
from fairing.mesh import Mesh

VISIBLE_WITHIN = 0.01  # relative depth: a vertex this close to the rendered surface counts as visible


def vertices_within(
    vertices: np.ndarray,
    mesh: Mesh,
    camera: Camera,
    low: tuple[float, float],
    high: tuple[float, float],
    see_through: bool,
) -> np.ndarray:
    """(u,) int: ids of the vertices in the rectangle.

    Args:
        vertices: (n, 3) float, in the camera's units.
        low, high: corners of the rectangle, as fractions of the image from its top left.
        see_through: also return vertices that the surface hides.
    """
    uv, depth = camera.project(vertices)
    size = np.array([camera.width, camera.height])
    place = (uv + 0.5) / size
    inside = (depth > 0) & ((place >= low) & (place <= high)).all(axis=1)
    ids = np.flatnonzero(inside)
    if see_through or len(ids) == 0:
        return ids
    face_id, seen_depth = rasterize(vertices, mesh.faces, camera)
    pixel = np.clip(np.rint(uv[ids]).astype(int), 0, size - 1)
    x, y = pixel[:, 0], pixel[:, 1]
    seen = depth[ids] <= seen_depth[y, x] * (1 + VISIBLE_WITHIN)
    # A vertex on the silhouette: its own faces may begin one pixel beside it.
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            near = face_id[np.clip(y + dy, 0, size[1] - 1), np.clip(x + dx, 0, size[0] - 1)]
            seen |= (near >= 0) & (mesh.faces[near] == ids[:, None]).any(axis=1)
    return ids[seen]


def nearest_to_ray(points: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> int:
    """Index of the point of (n, 3) with the smallest angle to a ray; origin and direction (3,), in the same unit."""
    offset = points - origin
    along = offset @ direction
    return int(np.argmax(along / np.maximum(np.linalg.norm(offset, axis=1), 1e-12)))

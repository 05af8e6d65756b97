"""Picking: the vertices within a rectangle of the 3D view, and the point nearest to a ray."""

import numpy as np

from fairing.camera import Camera
from fairing.geometry.rasterize import rasterize
from fairing.mesh import Mesh

DEPTH_TOLERANCE = 0.01  # relative: a vertex at most this much behind the surface counts as visible


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
        low, high: corners of the rectangle, as fractions (x, y) of the image from its top left.
        see_through: include vertices hidden by the surface.
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
    seen = depth[ids] <= seen_depth[y, x] * (1 + DEPTH_TOLERANCE)
    # A vertex lies on the boundary of its faces: after rasterization they may begin one pixel beside it.
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            near = face_id[np.clip(y + dy, 0, size[1] - 1), np.clip(x + dx, 0, size[0] - 1)]
            seen |= (near >= 0) & (mesh.faces[near] == ids[:, None]).any(axis=1)
    return ids[seen]


def point_under_pointer(points: np.ndarray, origin: np.ndarray, direction: np.ndarray, angle: float) -> int | None:
    """Index of the point nearest to the eye among those within an angle of a ray; None if there is none.

    Args:
        points: (n, 3) float, any unit.
        origin, direction: (3,) float, the ray in the same unit; `direction` is a unit vector.
        angle: radians.
    """
    offset = points - origin
    distance = np.linalg.norm(offset, axis=1)
    near = np.flatnonzero(offset @ direction > np.cos(angle) * distance)
    return int(near[np.argmin(distance[near])]) if len(near) else None


def nearest_to_ray(points: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> int:
    """Index of the point nearest to a ray, measured by angle.

    Args:
        points: (n, 3) float, any unit.
        origin, direction: (3,) float, the ray in the same unit.
    """
    offset = points - origin
    along = offset @ direction
    return int(np.argmax(along / np.maximum(np.linalg.norm(offset, axis=1), 1e-12)))


def first_hit(triangles: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> int | None:
    """Index of the first triangle that a ray meets, from either side; None if it meets none (Moeller and Trumbore 1997).

    Args:
        triangles: (m, 3, 3) float, any unit.
        origin, direction: (3,) float, the ray in the same unit.
    """
    corners = triangles.astype(np.float64)
    u, v, offset = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], origin - corners[:, 0]
    across = np.cross(direction, v)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / (u * across).sum(axis=1)
        a = (offset * across).sum(axis=1) * inverse
        turned = np.cross(offset, u)
        b, at = (turned @ direction) * inverse, (turned * v).sum(axis=1) * inverse
        hits = np.flatnonzero((a >= 0) & (b >= 0) & (a + b <= 1) & (at > 0))
    return int(hits[np.argmin(at[hits])]) if len(hits) else None

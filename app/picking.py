"""Which vertices lie within a rectangle of the 3D view, or on a line of sight."""

import numpy as np
import viser
import viser.transforms

from fairing.camera import Camera
from fairing.geometry.rasterize import rasterize
from fairing.mesh import Mesh

HEIGHT = 540  # px: of the picture that decides what is hidden
NEARER = 0.01  # relative depth: nearer than this to what is seen at its place, a vertex is seen


def camera_of(client: viser.ClientHandle) -> Camera:
    """The browser's camera, in page units, for a picture of moderate size."""
    camera = client.camera
    height = min(HEIGHT, int(camera.image_height))
    width = max(1, round(height * camera.aspect))
    focal = height / 2 / np.tan(camera.fov / 2)
    K = np.array([[focal, 0, width / 2 - 0.5], [0, focal, height / 2 - 0.5], [0, 0, 1]])
    camera_from_world = viser.transforms.SO3(np.asarray(camera.wxyz)).as_matrix().T
    return Camera.from_krt(K, camera_from_world, -camera_from_world @ np.asarray(camera.position), width, height)


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
        low, high: corners of the rectangle, fractions of the picture from its top left.
        see_through: also those that the surface hides.
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
    seen = depth[ids] <= seen_depth[y, x] * (1 + NEARER)
    # A vertex lies on an edge of what is drawn: faces of its own may begin a pixel beside it.
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            near = face_id[np.clip(y + dy, 0, size[1] - 1), np.clip(x + dx, 0, size[0] - 1)]
            seen |= (near >= 0) & (mesh.faces[near] == ids[:, None]).any(axis=1)
    return ids[seen]


def nearest_to_ray(points: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> int:
    """The point of (n, 3) that lies nearest to a line of sight, as an angle."""
    offset = points - origin
    along = offset @ direction
    return int(np.argmax(along / np.maximum(np.linalg.norm(offset, axis=1), 1e-12)))

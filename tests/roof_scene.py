"""Four points over a square that two surfaces fit: a roof whose ridge joins A and B, or one folded from C to D.

Photos are ray cast with numpy alone, 3 x 3 points a pixel.
"""

from functools import cache

import numpy as np

from fairing.camera import Camera
from fairing.photo import ArrayPhoto
from fairing.scene import Scene, View
from tests.small_scene import texture

WIDTH, HEIGHT, FOCAL = 240, 180, 380.0
VERTICES = np.array([[0, -1, 0.35], [0, 1, 0.35], [-1, 0, 0], [1, 0, 0]], float)  # A, B, C, D
RIDGE_AB = np.array([[0, 1, 2], [0, 1, 3]])
RIDGE_CD = np.array([[2, 3, 0], [2, 3, 1]])


def counter_clockwise(faces: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Faces turned so that they are counter-clockwise seen from above."""
    p = vertices[faces]
    down = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2] < 0
    return np.where(down[:, None], faces[:, [0, 2, 1]], faces)


@cache
def cameras() -> tuple[Camera, ...]:
    """Seven cameras on a ring above, and one at its middle."""
    result = []
    for i in range(8):
        turn, tilt = 2 * np.pi * i / 7 + 0.2, 0.0 if i == 7 else 0.3
        eye = 3.6 * np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
        z = -eye / np.linalg.norm(eye)
        x = np.cross(z, [0.1, 1, 0])
        x /= np.linalg.norm(x)
        R = np.stack([x, np.cross(z, x), z])
        K = np.array([[FOCAL, 0, 119.4], [0, FOCAL, 90.3], [0, 0, 1]])
        result.append(Camera.from_krt(K, R, -R @ eye, WIDTH, HEIGHT))
    return tuple(result)


def photo(camera: Camera, vertices: np.ndarray, faces: np.ndarray, oversampling: int = 3) -> np.ndarray:
    """(HEIGHT, WIDTH, 3) uint8: the surface of triangles, its texture painted from above."""
    offsets = (np.arange(oversampling) + 0.5) / oversampling - 0.5
    y, x = np.meshgrid(
        (np.arange(HEIGHT)[:, None] + offsets).ravel(), (np.arange(WIDTH)[:, None] + offsets).ravel(), indexing="ij"
    )
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(camera.image_from_world[:, :3]).T
    value, nearest = np.full(x.shape, 40.0), np.full(x.shape, np.inf)
    for a, b, c in vertices[faces]:
        # center + t ray = a + u (b - a) + v (c - a), by Cramer's rule
        one, two, sight = a - b, a - c, a - camera.center
        determinant = rays @ np.cross(one, two)
        t = sight @ np.cross(one, two) / determinant
        u, v = rays @ np.cross(sight, two) / determinant, rays @ np.cross(one, sight) / determinant
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < nearest)
        point = camera.center + t[..., None] * rays
        value[hit], nearest[hit] = texture(1, point[hit, 0] / 2, point[hit, 1] / 2), t[hit]
    grey = value.reshape(HEIGHT, oversampling, WIDTH, oversampling).mean(axis=(1, 3))
    return np.repeat(np.clip(np.round(grey), 0, 255).astype(np.uint8)[..., None], 3, axis=2)


@cache
def _photos(truth: str) -> tuple[np.ndarray, ...]:
    faces = {"AB": RIDGE_AB, "CD": RIDGE_CD}[truth]
    return tuple(photo(camera, VERTICES, faces) for camera in cameras())


def views_of(photos: tuple[np.ndarray, ...]) -> tuple[View, ...]:
    return tuple(View(f"photo{i}", c, ArrayPhoto(p)) for i, (c, p) in enumerate(zip(cameras(), photos, strict=True)))


def roof_scene(truth: str, start: str) -> Scene:
    """The roof as it is (`truth`, "AB" or "CD": where its ridge runs), with the mesh folded along `start`."""
    faces = counter_clockwise({"AB": RIDGE_AB, "CD": RIDGE_CD}[start], VERTICES)
    return Scene.build("roof", VERTICES, faces, views_of(_photos(truth)), points_choice="given")


PLANE_SIDE = 5


def plane_vertices() -> np.ndarray:
    """A grid in the plane z = 0, its inner points moved about."""
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(np.linspace(-0.9, 0.9, PLANE_SIDE), np.linspace(-0.7, 0.7, PLANE_SIDE))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    inner = (np.abs(points[:, 0]) < 0.8) & (np.abs(points[:, 1]) < 0.6)
    points[inner, :2] += rng.uniform(-0.06, 0.06, (int(inner.sum()), 2))
    return points


@cache
def plane_photos() -> tuple[np.ndarray, ...]:
    corners = np.array([[-1.2, -1, 0], [1.2, -1, 0], [1.2, 1, 0], [-1.2, 1, 0]])
    return tuple(photo(camera, corners, np.array([[0, 1, 2], [0, 2, 3]])) for camera in cameras())

"""A cube's corner under fine speckle, in photos made with numpy alone: many keypoints on an exactly known surface."""

from functools import cache

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from fairing.camera import Camera
from fairing.photo import ArrayPhoto
from fairing.scene import View

WIDTH, HEIGHT, FOCAL = 320, 240, 520.0
COUNT = 6
SPECKLES = 220  # samples along an edge of the cube, about 130 px


@cache
def cameras() -> tuple[Camera, ...]:
    """Around the cube's diagonal, four edges from the corner (1, 1, 1), up to 15 degrees from it."""
    axis, side = np.ones(3) / np.sqrt(3), np.array([1, -1, 0]) / np.sqrt(2)
    up = np.cross(axis, side)
    result = []
    for i in range(COUNT):
        turn, tilt = 2 * np.pi * i / COUNT + 0.2, (0.14, 0.26)[i % 2]
        eye = np.ones(3) + 4 * (
            np.cos(tilt) * axis + np.sin(tilt) * (np.cos(turn) * side + np.sin(turn) * up)
        )  # fmt: skip
        z = (np.full(3, 0.66) - eye) / np.linalg.norm(np.full(3, 0.66) - eye)
        x = np.cross(z, up) / np.linalg.norm(np.cross(z, up))
        R = np.stack([x, np.cross(z, x), z])
        K = np.array([[FOCAL, 0, 158.2], [0, FOCAL, 121.4], [0, 0, 1]])
        result.append(Camera.from_krt(K, R, -R @ eye, WIDTH, HEIGHT))
    return tuple(result)


def camera_at(eye: tuple[float, float, float], target: tuple[float, float, float] = (0, 0, 0)) -> Camera:
    """A camera for photos of 320x240 px, anywhere."""
    z = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    x = np.cross([0.1, 1, 0], z) / np.linalg.norm(np.cross([0.1, 1, 0], z))
    R = np.stack([x, np.cross(z, x), z])
    K = np.array([[400, 0, 160], [0, 410, 120], [0, 0, 1.0]])
    return Camera.from_krt(K, R, -R @ np.array(eye), WIDTH, HEIGHT)


@cache
def views() -> tuple[View, ...]:
    return tuple(View(f"photo{i}.png", camera, ArrayPhoto(_photo(camera))) for i, camera in enumerate(cameras()))


def distance_to_surface(points: np.ndarray) -> np.ndarray:
    """(p,) distance of points (p, 3) in front of the cube's sides x = 1, y = 1 and z = 1, in edges."""
    return np.abs(points.max(axis=1) - 1)


def _photo(camera: Camera, oversampling: int = 3) -> np.ndarray:
    offsets = (np.arange(oversampling) + 0.5) / oversampling - 0.5
    rows, columns = ((np.arange(n)[:, None] + offsets).ravel() for n in (HEIGHT, WIDTH))
    y, x = np.meshgrid(rows, columns, indexing="ij")
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(camera.image_from_world[:, :3]).T
    value, nearest = np.full(x.shape, 90.0), np.full(x.shape, np.inf)
    for side in range(3):
        distance = (1 - camera.center[side]) / rays[..., side]
        point = camera.center + distance[..., None] * rays
        u, v = (point[..., a] for a in range(3) if a != side)
        hit = (distance > 0) & (distance < nearest) & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
        value[hit], nearest[hit] = _speckle(side, u[hit], v[hit]), distance[hit]
    grey = value.reshape(HEIGHT, oversampling, WIDTH, oversampling).mean(axis=(1, 3))
    return np.repeat(np.clip(np.round(grey), 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def _speckle(side: int, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return map_coordinates(_field(side), [v * (SPECKLES - 1), u * (SPECKLES - 1)], order=3, mode="nearest")


@cache
def _field(side: int) -> np.ndarray:
    noise = np.random.default_rng(side).standard_normal((2, SPECKLES, SPECKLES))
    fine, coarse = gaussian_filter(noise[0], 2.5), gaussian_filter(noise[1], 6)
    return 128 + 30 * fine / fine.std() + 18 * coarse / coarse.std()

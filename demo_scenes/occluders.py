"""Occluders between the cameras and a building: a pole, leaves, passers-by."""

from collections.abc import Sequence

import numpy as np

from demo_scenes.materials import planks, plaster
from demo_scenes.noise import seeded
from demo_scenes.surface import PaintedSurface, painted
from fairing.camera import Camera

LEAVES = 60


def pole_and_leaves(points: np.ndarray, cameras: Sequence[Camera], up: np.ndarray, seed: int) -> PaintedSurface:
    """A wooden pole and the end of a branch, about half-way between the scene's points (n, 3) and its cameras."""
    rng = seeded(seed, 41)
    middle, size = _middle_and_size(points)
    away = np.mean([camera.center for camera in cameras], axis=0) - middle
    side = np.cross(up, away)
    side /= np.linalg.norm(side)
    out = away / np.linalg.norm(away)
    foot = middle + 0.38 * away + 0.04 * size * side
    radius = 0.009 * size
    corners = [radius * (np.cos(t) * side + np.sin(t) * out) for t in 2 * np.pi * np.arange(8) / 8]
    pole = [foot + corner + (-0.55 * size + 0.22 * size * step) * up for step in range(6) for corner in corners]
    faces = []
    for step in range(5):
        for k in range(8):
            a, b = 8 * step + k, 8 * step + (k + 1) % 8
            faces += [[a, b, b + 8], [a, b + 8, a + 8]]
    wood = _unmapped(np.array(pole), np.array(faces), painted(planks(256, 1.0, seed=42)), 256 / (0.3 * size), side, up)

    branch = middle + 0.45 * away - 0.16 * size * side + 0.1 * size * up
    vertices = []
    for _ in range(LEAVES):
        center = branch + 0.05 * size * rng.standard_normal(3)
        long = rng.standard_normal(3)
        long *= 0.013 * size / np.linalg.norm(long)
        wide = np.cross(long, rng.standard_normal(3))
        wide *= 0.006 * size / np.linalg.norm(wide)
        vertices += [center - long, center - wide, center + long, center + wide]
    quads = 4 * np.arange(LEAVES)[:, None]
    leaf_faces = np.vstack([quads + np.array([0, 1, 2]), quads + np.array([0, 2, 3])])
    green = painted(plaster(256, 2.0, seed=43, tint=(84, 112, 52), contrast=2.0))
    leaves = _unmapped(np.array(vertices), leaf_faces, green, 256 / (0.1 * size), side, up)
    return wood.joined(leaves)


def passer_by(points: np.ndarray, camera: Camera, up: np.ndarray, rng: np.random.Generator) -> PaintedSurface:
    """A standing person, for one camera only, on the ground in front of a random low one of the points (n, 3)."""
    _, size = _middle_and_size(points)
    tall = 0.055 * size
    height = points @ up
    low = np.flatnonzero(height <= height.min() + 0.35 * np.ptp(height))
    target = points[rng.choice(low)]
    sight = camera.center - target
    # Where the line of sight passes at half a person's height, kept between the target and the camera.
    away = np.clip((height.min() + tall - target @ up) / (sight @ up), 0.12, 0.6)
    center = target + away * sight
    center += (height.min() + tall - center @ up) * up
    side = np.cross(up, sight)
    side /= np.linalg.norm(side)
    turn = 2 * np.pi * np.arange(14) / 14
    body = [center + tall * (0.36 * np.cos(t) * side + np.sin(t) * up) for t in turn]
    head = [center + tall * (0.21 * np.cos(t) * side + (1.17 + 0.25 * np.sin(t)) * up) for t in turn]
    fan = np.array([[0, k, k + 1] for k in range(1, 13)])
    tint = tuple(rng.uniform(40, 170, 3))
    cloth = painted(plaster(128, 1.0, seed=int(rng.integers(1000)), tint=(tint[0], tint[1], tint[2]), contrast=2.0))
    return _unmapped(np.array(body + head), np.vstack([fan, fan + 14]), cloth, 128 / tall, side, up)


def _middle_and_size(points: np.ndarray) -> tuple[np.ndarray, float]:
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2, float(np.linalg.norm(high - low))


def _unmapped(
    vertices: np.ndarray, faces: np.ndarray, texture: np.ndarray, density: float, right: np.ndarray, up: np.ndarray
) -> PaintedSurface:
    """A surface with texture coordinates along two directions, regardless of the planes of its faces."""
    texel = density * np.stack([vertices @ right, -(vertices @ up)], axis=-1)[faces]
    return PaintedSurface.flat(vertices, faces, np.zeros(len(faces), int), texel, [texture])

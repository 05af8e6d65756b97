"""Photo pairs: which photos are matched with each other."""

from collections.abc import Sequence

import numpy as np

from fairing.camera import Camera
from fairing.features.options import FeatureOptions


def nearest_photos(cameras: Sequence[Camera], count: int, axis_angle: float) -> list[list[int]]:
    """For each photo its nearest ones that look in a similar direction, the nearest first.

    Args:
        count: most photos of each.
        axis_angle: largest angle of the optical axes, degrees.
    """
    centers = np.array([camera.center for camera in cameras])
    axes = np.array([camera.image_from_world[2, :3] for camera in cameras])  # of length 1, see `Camera`
    distance = np.linalg.norm(centers[:, None] - centers[None], axis=2)
    # Closer ones have no epipolar lines, or are at one place but for the rounding of their coordinates.
    apart = distance > max(1e-6 * distance.max(), 1e-9 * np.abs(centers).max())
    usable = apart & (axes @ axes.T >= np.cos(np.radians(axis_angle)))
    order = np.argsort(distance, axis=1, kind="stable")
    return [order[photo][usable[photo, order[photo]]][:count].tolist() for photo in range(len(cameras))]


def photo_pairs(cameras: Sequence[Camera], options: FeatureOptions) -> np.ndarray:
    """(q, 2) int: pairs of photos, the lower first: each with its nearest ones that look in a similar direction."""
    nearest = nearest_photos(cameras, options.neighbors, options.axis_angle)
    pairs = {(min(a, b), max(a, b)) for a, others in enumerate(nearest) for b in others}
    return np.array(sorted(pairs), dtype=np.int64).reshape(-1, 2)

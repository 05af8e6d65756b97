"""Pixel size: how large a pixel of the photos is at points in space."""

from collections.abc import Sequence

import numpy as np

from fairing.camera import Camera


def pixel_size(cameras: Sequence[Camera], points: np.ndarray) -> np.ndarray:
    """(p,) float: width of what a pixel covers at the depth of points (p, 3), world units; NaN behind all cameras.

    The median over the cameras that a point is in front of.
    """
    rows = np.array([camera.image_from_world[2] for camera in cameras])  # their third rows give depths
    depth = rows[:, :3] @ points.T + rows[:, 3:]
    size = np.sort(np.where(depth > 0, depth, np.inf) / np.array([[camera.K[0, 0]] for camera in cameras]), axis=0)
    count = (depth > 0).sum(axis=0)
    middle = np.take_along_axis(size, np.stack([np.maximum(count - 1, 0) // 2, count // 2]), axis=0)
    return np.where(count > 0, middle.mean(axis=0), np.nan)

"""Pixel size: how large a pixel of the photos is at points in space."""

from collections.abc import Sequence

import numpy as np

from fairing.camera import Camera


def pixel_size(cameras: Sequence[Camera], points: np.ndarray) -> np.ndarray:
    """(p,) float: width of what a pixel covers at the depth of points (p, 3), world units; NaN behind all cameras.

    The median over the cameras that a point is in front of.
    """
    depth = np.array([camera.project(points)[1] for camera in cameras])
    focal = np.array([camera.K[0, 0] for camera in cameras])
    size = np.where(depth > 0, depth / focal[:, None], np.nan)
    in_front = (depth > 0).any(axis=0)
    result = np.full(len(points), np.nan)
    result[in_front] = np.nanmedian(size[:, in_front], axis=0)
    return result

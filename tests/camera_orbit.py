"""Cameras that look at a point."""

import numpy as np


def looking_at(eye: np.ndarray, target: np.ndarray, up: np.ndarray | tuple[int, int, int] = (0, 0, 1)) -> np.ndarray:
    """(3, 3) camera from world, with a level horizon: x right, y down, z forward."""
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(ahead, right), ahead])

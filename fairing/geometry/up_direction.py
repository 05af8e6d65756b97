"""The up direction of a scene, estimated from the rotations of its cameras."""

import numpy as np

MIN_SPREAD_RATIO = 3.0
"""Of the x axes within and across the ground plane, for the plane to define the up direction."""


def up_direction(rotations: np.ndarray) -> np.ndarray:
    """(3,) float: the up direction, a unit vector, from camera-from-world rotations (V, 3, 3), y down.

    Photos usually have a level horizon: their x axes then span the ground plane, whose normal is up. If all cameras look
    in the same direction, the x axes do not span it; the mean up direction of the photos is used instead.
    """
    mean_up = -rotations[:, 1].mean(axis=0)
    length = float(np.linalg.norm(mean_up))
    mean_up = mean_up / length if length > 1e-6 else np.array([0.0, 0.0, 1.0])
    values, vectors = np.linalg.eigh(rotations[:, 0].T @ rotations[:, 0] / len(rotations))
    normal = vectors[:, 0] * np.sign(vectors[:, 0] @ mean_up or 1.0)
    return normal if values[1] > MIN_SPREAD_RATIO * max(values[0], 1e-3) and normal @ mean_up > 0.5 else mean_up

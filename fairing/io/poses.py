"""Poses as files write them: rotations, centres and matrices."""

import numpy as np

from fairing.errors import InputError

_ROUNDING = 1e-5
"""Largest deviation of the last row of a pose: files of six digits."""


def pose_of_center(R: np.ndarray, C: np.ndarray) -> np.ndarray:
    """t (3,), world units, of a camera with rotation R (3, 3) and centre C (3,), so that x = R X + t.

    The result may be infinite; `Camera` refuses it.
    """
    with np.errstate(all="ignore"):
        return -R @ C


def rotation_of_quaternion(quaternion: np.ndarray) -> np.ndarray:
    """(3, 3) rotation of a quaternion (4,) w x y z, of any length but zero.

    Raises:
        InputError: it is zero or not finite.
    """
    largest = np.abs(quaternion).max()
    if not np.isfinite(largest) or largest == 0:
        raise InputError(f"expected a rotation as quaternion, found {quaternion.tolist()}")
    quaternion = quaternion / largest  # so that no square overflows
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def rotation_of_axis_angle(axis_angle: np.ndarray) -> np.ndarray:
    """(3, 3) rotation by the length of the vector (3,), radians, about its direction (Rodrigues).

    Raises:
        InputError: it is not finite.
    """
    with np.errstate(over="ignore"):
        angle = np.linalg.norm(axis_angle)
    if not np.isfinite(angle):
        raise InputError(f"expected a rotation as axis times angle, found {axis_angle.tolist()}")
    if angle == 0:
        return np.eye(3)
    half = angle / 2
    return rotation_of_quaternion(np.array([np.cos(half), *(np.sin(half) * axis_angle / angle)]))


def check_last_row(pose: np.ndarray, what: str) -> None:
    """Refuse a matrix (4, 4) that is no rigid or affine transform.

    Raises:
        InputError: its last row is not 0 0 0 1 within rounding.
    """
    if not (np.abs(pose[3] - (0, 0, 0, 1)) <= _ROUNDING).all():
        found = " ".join(f"{number:g}" for number in pose[3])
        raise InputError(f"{what}: expected 0 0 0 1 as the last row of a pose, found {found}")

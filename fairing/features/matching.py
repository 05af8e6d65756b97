"""Guided matching: keypoints of two photos matched along epipolar lines.

A keypoint and the line through both cameras' centres (the baseline) span an epipolar plane. Two keypoints that show the
same point share their plane, so only keypoints whose planes are at nearly the same angle about the baseline are compared:
with the keypoints of one photo sorted by that angle, the candidates of a keypoint of the other are neighbours in the list.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from fairing.camera import Camera
from fairing.features.keypoints import DESCRIPTOR_LENGTH, Keypoints
from fairing.features.options import FeatureOptions


class Matches(NamedTuple):
    """Attributes:
    indices: (m, 2) int: keypoints of the first and of the second photo.
    distance: (m,) float: squared distance of their descriptors, for descriptors of length 1.
    """

    indices: np.ndarray
    distance: np.ndarray


class _Planes(NamedTuple):
    """Keypoints of a photo as seen from the baseline.

    Attributes:
        angle: (n,) float, radians: of the epipolar plane about the baseline.
        slope: (n,) float, radians / px: largest change of the angle with the keypoint's position.
        along: (n,) float: cosine of the ray with the baseline.
    """

    angle: np.ndarray
    slope: np.ndarray
    along: np.ndarray


class _Nearest(NamedTuple):
    """Attributes:
    best, second: (n,) float: squared descriptor distances of a keypoint's nearest two candidates.
    partner: (n,) int: the nearest candidate; -1 for none.
    """

    best: np.ndarray
    second: np.ndarray
    partner: np.ndarray

    @classmethod
    def of(cls, n: int) -> "_Nearest":
        return cls(np.full(n, np.inf), np.full(n, np.inf), np.full(n, -1))


def match_pair(a: Keypoints, b: Keypoints, camera_a: Camera, camera_b: Camera, options: FeatureOptions) -> Matches:
    """Keypoints of photos a and b that are each other's best candidate, clearly better than the second best of both.

    Candidates lie within `epipolar_distance` of each other's epipolar line, and their rays meet in front of both cameras.
    Exchanging the photos does not change the matches.
    """
    if len(a.pixels) == 0 or len(b.pixels) == 0:
        return Matches(np.zeros((0, 2), np.int64), np.zeros(0))
    frame = _baseline_frame(camera_a.center, camera_b.center)
    planes_a, planes_b = _planes(camera_a, a.pixels, frame), _planes(camera_b, b.pixels, frame)
    order_a, order_b = np.argsort(planes_a.angle, kind="stable"), np.argsort(planes_b.angle, kind="stable")
    angle_a, angle_b = planes_a.angle[order_a], planes_b.angle[order_b]
    # A fifth more, because it is linearised; the distance from the line in px is then judged exactly.
    tolerance = 1.2 * options.epipolar_distance * planes_b.slope[order_b]
    turns = np.concatenate([angle_a - 2 * np.pi, angle_a, angle_a + 2 * np.pi])
    first = np.searchsorted(turns, angle_b - tolerance, side="left")
    last = np.minimum(np.searchsorted(turns, angle_b + tolerance, side="right"), first + len(angle_a))
    points_a, points_b = _homogeneous(a.pixels[order_a]), _homogeneous(b.pixels[order_b])
    F = _fundamental(camera_a, camera_b)
    of_a, of_b = _Nearest.of(len(order_a)), _Nearest.of(len(order_b))
    _compare(
        a.descriptors[order_a].astype(np.float32), b.descriptors[order_b].astype(np.float32), first, last,
        points_a, points_b, _unit_lines(np.einsum("ni,ij->nj", points_b, F)),
        _unit_lines(np.einsum("ni,ji->nj", points_a, F)), planes_a.along[order_a], planes_b.along[order_b],
        options.epipolar_distance, *of_a, *of_b,
    )  # fmt: skip
    i, j = of_b.partner, np.arange(len(order_b))
    found = (i >= 0) & (of_a.partner[i] == j)
    found &= of_b.best <= options.ratio**2 * np.minimum(of_b.second, of_a.second[i])
    indices = np.stack([order_a[i[found]], order_b[found]], axis=1)
    order = np.argsort(indices[:, 0], kind="stable")
    return Matches(indices[order], of_b.best[found][order] / DESCRIPTOR_LENGTH**2)


# Descriptors hold whole numbers and their sums are exact in single precision, so the order of a sum is free.
@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _compare(
    descriptors_a, descriptors_b, first, last, points_a, points_b, lines_a, lines_b, along_a, along_b, limit,
    best_a, second_a, partner_a, best_b, second_b, partner_b,
):  # fmt: skip
    """Each keypoint j of b with the keypoints of a from `first[j]` to `last[j]`, in three turns of a's list."""
    n = len(descriptors_a)
    for j in range(len(descriptors_b)):
        u, v = points_b[j, 0], points_b[j, 1]
        for turned in range(first[j], last[j]):
            i = turned % n
            if along_a[i] <= along_b[j]:  # the rays part
                continue
            if abs(lines_b[i, 0] * u + lines_b[i, 1] * v + lines_b[i, 2]) > limit:
                continue
            if abs(lines_a[j, 0] * points_a[i, 0] + lines_a[j, 1] * points_a[i, 1] + lines_a[j, 2]) > limit:
                continue
            total = np.float32(0)
            for k in range(128):
                difference = descriptors_a[i, k] - descriptors_b[j, k]
                total += difference * difference
            if total < best_a[i]:
                second_a[i], best_a[i], partner_a[i] = best_a[i], total, j
            elif total < second_a[i]:
                second_a[i] = total
            if total < best_b[j]:
                second_b[j], best_b[j], partner_b[j] = best_b[j], total, i
            elif total < second_b[j]:
                second_b[j] = total


def _baseline_frame(center_a: np.ndarray, center_b: np.ndarray) -> np.ndarray:
    """(3, 3): rows are unit vectors, the baseline from a to b and two perpendicular to it."""
    along = (center_b - center_a) / np.linalg.norm(center_b - center_a)
    across = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    across /= np.linalg.norm(across)
    return np.stack([along, across, np.cross(along, across)])


def _planes(camera: Camera, pixels: np.ndarray, frame: np.ndarray) -> _Planes:
    """Rays in the baseline's frame: (x along the baseline, y and z across) = frame M^-1 (u, v, 1)."""
    from_pixel = frame @ np.linalg.inv(camera.image_from_world[:, :3])
    rays = np.einsum("ni,ji->nj", _homogeneous(pixels), from_pixel)
    y, z = rays[:, 1], rays[:, 2]
    squared = np.maximum(y**2 + z**2, 1e-300)
    gradient = (y[:, None] * from_pixel[2, :2] - z[:, None] * from_pixel[1, :2]) / squared[:, None]
    slope = np.minimum(np.linalg.norm(gradient, axis=1), np.pi)
    return _Planes(np.arctan2(z, y), slope, rays[:, 0] / np.linalg.norm(rays, axis=1))


def _fundamental(a: Camera, b: Camera) -> np.ndarray:
    """F (3, 3) with (u_b, v_b, 1) F (u_a, v_a, 1)^T = 0: F = [e]_x M_b M_a^-1, e the image of a's centre in b."""
    M_a, M_b = a.image_from_world[:, :3], b.image_from_world[:, :3]
    e = M_b @ (a.center - b.center)
    cross = np.array([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])
    F = cross @ M_b @ np.linalg.inv(M_a)
    return F / np.abs(F).max()


def _unit_lines(lines: np.ndarray) -> np.ndarray:
    """Lines (n, 3) scaled so that their product with (u, v, 1) is a distance in px."""
    return lines / np.maximum(np.linalg.norm(lines[:, :2], axis=1, keepdims=True), 1e-300)


def _homogeneous(pixels: np.ndarray) -> np.ndarray:
    return np.column_stack([pixels, np.ones(len(pixels))])

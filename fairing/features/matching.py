"""Guided matching: keypoints of two photos matched along epipolar lines.

A keypoint and the line through both cameras' centres (the baseline) span an epipolar plane. Two keypoints that show the
same point share their plane, so only keypoints whose planes are at nearly the same angle are compared. Both photos are
sorted by that angle and compared in blocks of neighbours: one small matrix product a block.
"""

from typing import NamedTuple

import numpy as np

from fairing.camera import Camera
from fairing.features.keypoints import DESCRIPTOR_LENGTH, Keypoints
from fairing.features.options import FeatureOptions

BLOCK = 128
"""Keypoints compared at once."""
ANGLE_MARGIN = 1.2
"""Of the tolerance in angle, which is linearised; the distance from the line in px is then judged exactly."""


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


def match_pair(a: Keypoints, b: Keypoints, camera_a: Camera, camera_b: Camera, options: FeatureOptions) -> Matches:
    """Keypoints of photos a and b that are each other's best candidate, clearly better than the second best.

    Candidates lie within `epipolar_distance` of each other's epipolar line, and their rays meet in front of both cameras.
    """
    if len(a.pixels) == 0 or len(b.pixels) == 0:
        return Matches(np.zeros((0, 2), np.int64), np.zeros(0))
    frame = _baseline_frame(camera_a.center, camera_b.center)
    planes_a, planes_b = _planes(camera_a, a.pixels, frame), _planes(camera_b, b.pixels, frame)
    order_a, order_b = np.argsort(planes_a.angle, kind="stable"), np.argsort(planes_b.angle, kind="stable")
    compared = _Comparison(a, b, planes_a, planes_b, order_a, order_b, camera_a, camera_b, options)
    angle_a, angle_b = planes_a.angle[order_a], planes_b.angle[order_b]
    tolerance = ANGLE_MARGIN * options.epipolar_distance * planes_b.slope[order_b]
    turns = np.concatenate([angle_a - 2 * np.pi, angle_a, angle_a + 2 * np.pi])
    first = np.searchsorted(turns, angle_b - tolerance, side="left")
    last = np.searchsorted(turns, angle_b + tolerance, side="right")
    for start in range(0, len(angle_b), BLOCK):
        rows = slice(start, start + BLOCK)
        low, high = int(first[rows].min()), int(last[rows].max())
        if high > low:
            compared.add(rows, np.arange(low, min(high, low + len(angle_a))) % len(angle_a))
    return compared.matches()


class _Comparison:
    """The best and second best candidates so far, of the keypoints of both photos in the order of their angles."""

    def __init__(
        self, a: Keypoints, b: Keypoints, planes_a: _Planes, planes_b: _Planes, order_a: np.ndarray, order_b: np.ndarray,
        camera_a: Camera, camera_b: Camera, options: FeatureOptions,
    ) -> None:  # fmt: skip
        self._order_a, self._order_b, self._options = order_a, order_b, options
        self._descriptors_a = a.descriptors[order_a].astype(np.float32)
        self._descriptors_b = b.descriptors[order_b].astype(np.float32)
        self._squared_a = (self._descriptors_a**2).sum(axis=1)
        self._squared_b = (self._descriptors_b**2).sum(axis=1)
        self._along_a, self._along_b = planes_a.along[order_a], planes_b.along[order_b]
        self._points_a, self._points_b = _homogeneous(a.pixels[order_a]), _homogeneous(b.pixels[order_b])
        F = _fundamental(camera_a, camera_b)  # b^T F a = 0
        self._lines_a, self._lines_b = _unit_lines(self._points_b @ F), _unit_lines(self._points_a @ F.T)
        self._of_a, self._of_b = _Best(len(order_a)), _Best(len(order_b))

    def add(self, rows: slice, columns: np.ndarray) -> None:
        """Compare a block of keypoints of b with keypoints of a."""
        d = (
            self._squared_b[rows, None] + self._squared_a[columns]
            - 2 * (self._descriptors_b[rows] @ self._descriptors_a[columns].T)
        )  # fmt: skip
        limit = self._options.epipolar_distance
        apart = np.abs(self._points_b[rows] @ self._lines_b[columns].T) > limit
        apart |= np.abs(self._lines_a[rows] @ self._points_a[columns].T) > limit
        apart |= self._along_a[columns] <= self._along_b[rows, None]  # the rays part
        d[apart] = np.inf
        self._of_b.add(np.arange(rows.start, rows.start + len(d)), columns, d)
        self._of_a.add(columns, np.arange(rows.start, rows.start + len(d)), d.T)

    def matches(self) -> Matches:
        limit = (self._options.descriptor_distance * DESCRIPTOR_LENGTH) ** 2
        j = np.arange(len(self._order_b))
        i = self._of_b.partner
        found = i >= 0
        found &= self._of_a.partner[i] == j
        found &= (self._of_b.best <= limit) & self._of_b.is_clear(self._options.ratio)
        found &= self._of_a.is_clear(self._options.ratio)[i]
        indices = np.stack([self._order_a[i[found]], self._order_b[found]], axis=1)
        order = np.argsort(indices[:, 0], kind="stable")
        return Matches(indices[order], self._of_b.best[found][order] / DESCRIPTOR_LENGTH**2)


class _Best:
    """For each keypoint the nearest candidate and the squared distances of the nearest two."""

    def __init__(self, n: int) -> None:
        self.best = np.full(n, np.inf)
        self.second = np.full(n, np.inf)
        self.partner = np.full(n, -1)

    def add(self, keypoints: np.ndarray, others: np.ndarray, distance: np.ndarray) -> None:
        """Squared distances (k, o) of keypoints (k,) to others (o,) none of them was compared with before."""
        nearest = distance.argmin(axis=1)
        each = np.arange(len(keypoints))
        new = distance[each, nearest].astype(float)
        if distance.shape[1] > 1:
            second = np.partition(distance, 1, axis=1)[:, 1]
        else:
            second = np.full(len(keypoints), np.inf)
        old = self.best[keypoints]
        self.second[keypoints] = np.minimum(np.maximum(old, new), np.minimum(self.second[keypoints], second))
        nearer = new < old
        self.best[keypoints[nearer]] = new[nearer]
        self.partner[keypoints[nearer]] = others[nearest[nearer]]

    def is_clear(self, ratio: float) -> np.ndarray:
        """(n,) bool: the nearest is clearly nearer than the second."""
        return self.best <= ratio**2 * self.second


def _baseline_frame(center_a: np.ndarray, center_b: np.ndarray) -> np.ndarray:
    """(3, 3): rows are unit vectors, the baseline from a to b and two perpendicular to it."""
    along = (center_b - center_a) / np.linalg.norm(center_b - center_a)
    across = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    across /= np.linalg.norm(across)
    return np.stack([along, across, np.cross(along, across)])


def _planes(camera: Camera, pixels: np.ndarray, frame: np.ndarray) -> _Planes:
    """Rays in the baseline's frame: (x along the baseline, y and z across) = frame M^-1 (u, v, 1)."""
    from_pixel = frame @ np.linalg.inv(camera.image_from_world[:, :3])
    rays = _homogeneous(pixels) @ from_pixel.T
    y, z = rays[:, 1], rays[:, 2]
    squared = np.maximum(y**2 + z**2, 1e-300)
    gradient = (y[:, None] * from_pixel[2, :2] - z[:, None] * from_pixel[1, :2]) / squared[:, None]
    slope = np.minimum(np.linalg.norm(gradient, axis=1), np.pi)
    return _Planes(np.arctan2(z, y), slope, rays[:, 0] / np.linalg.norm(rays, axis=1))


def _fundamental(a: Camera, b: Camera) -> np.ndarray:
    """F (3, 3) with (u_b, 1) F (u_a, 1)^T = 0: F = [e_b]_x M_b M_a^-1, with e_b the image of a's centre in b."""
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

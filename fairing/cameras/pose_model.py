"""Cameras near given ones: poses and optionally intrinsics, and the derivatives of pixels by them and by the point.

A pose has six parameters in px, (a, b): with f the focal length and d the median depth of the points that the photo shows,
the rotation from world to camera is exp([a / f]x) R_given and the centre c_given + b d / f. A parameter of 1 px moves
the image of a point at that depth by about 1 px, whatever the unit of the world.

Intrinsics have five further parameters in px, e: with r half the diagonal of the photo, the focal lengths are
(1 + e_1 / r) f_given, the principal point is c_given + (e_2, e_3), and e_4, e_5 move the image of a corner along its radius by
the first two coefficients of radial distortion, k_1 = e_4 f^2 / r^3 and k_2 = e_5 f^4 / r^5 in OpenCV's notation. Photos with
the same given intrinsics and size share them: they were taken by one camera. Where the distortion is given, photos come
undistorted, and e_4 = e_5 = 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from fairing.camera import Camera
from fairing.cameras import compiled
from fairing.cameras.observed_points import ObservedPoints
from fairing.lens import Lens

PARAMETERS = 6
"""Of a pose: rotation vector (0 to 2), then centre (3 to 5)."""
INTRINSICS = 5
"""Further parameters: focal length, principal point (1, 2), radial distortion (3, 4)."""
_DISTORTION = slice(PARAMETERS + 3, PARAMETERS + INTRINSICS)


@dataclass(frozen=True, eq=False)
class Projected:
    """Images of points, each in its own photo.

    Attributes:
        pixels: (o, 2) float, px.
        depth: (o,) float, world units; pixels have no meaning where it is not positive.
        J_pixel_wrt_pose: (o, 2, n) float, px / px, n the parameters of a photo.
        J_pixel_wrt_point: (o, 2, 3) float, px / world unit.
    """

    pixels: np.ndarray
    depth: np.ndarray
    J_pixel_wrt_pose: np.ndarray
    J_pixel_wrt_point: np.ndarray


@dataclass(frozen=True, eq=False)
class PoseModel:
    """The given cameras and the units of their parameters.

    Attributes:
        K: (v, 3, 3) float, px: given intrinsics.
        rotations: (v, 3, 3) float: given rotations from world to camera axes.
        centers: (v, 3) float, world units: given centres.
        angle_unit: (v,) float, radians / px: 1 / f.
        length_unit: (v,) float, world units / px: d / f.
        trust: (v,) float: weight of each given pose in the prior of an adjustment.
        radius: (v,) float, px: half the diagonal of the photo.
        lens: (v,) int: the camera that took each photo, from 0.
        bending: (v, 2) float, 1 / px: k_1 / e_4 and k_2 / e_5; 0 where the distortion is given.
        adjusts_lens: whether intrinsics are unknown, too. The parameters of all photos are then (v, 11) instead of (v, 6).
    """

    K: np.ndarray
    rotations: np.ndarray
    centers: np.ndarray
    angle_unit: np.ndarray
    length_unit: np.ndarray
    trust: np.ndarray
    radius: np.ndarray
    lens: np.ndarray
    bending: np.ndarray
    adjusts_lens: bool = False

    @classmethod
    def of(
        cls,
        cameras: Sequence[Camera],
        observed: ObservedPoints,
        adjusts_lens: bool = False,
        is_bent: Sequence[bool] | None = None,
    ) -> "PoseModel":
        """The model of given cameras; a photo without observations has the median depth of all.

        Args:
            is_bent: whether the distortion of each photo is unknown; default: of all.
        """
        K = np.array([camera.K for camera in cameras])
        rotations = np.array([camera.camera_from_world[:, :3] for camera in cameras])
        centers = np.array([camera.center for camera in cameras])
        offset = observed.positions[observed.point] - centers[observed.photo]
        depth = np.einsum("oi,oi->o", rotations[observed.photo, 2], offset)
        of_photo = [depth[(observed.photo == v) & (depth > 0)] for v in range(len(cameras))]
        common = np.median(depth[depth > 0])
        median = np.array([np.median(found) if len(found) else common for found in of_photo])
        focal = np.sqrt(K[:, 0, 0] * K[:, 1, 1])
        sizes = np.array([(camera.width, camera.height) for camera in cameras])
        is_unknown = np.ones(len(K), bool) if is_bent is None else np.asarray(is_bent)
        alike = np.column_stack([K.reshape(-1, 9), sizes, is_unknown])
        _, lens = np.unique(np.round(alike, 6), axis=0, return_inverse=True)
        radius = np.linalg.norm(sizes, axis=1) / 2
        bending = is_unknown[:, None] * np.column_stack([focal**2 / radius**3, focal**4 / radius**5])
        return cls(
            K,
            rotations,
            centers,
            1 / focal,
            median / focal,
            np.ones(len(K)),
            radius,
            lens.ravel(),
            bending,
            adjusts_lens,
        )

    def __len__(self) -> int:
        return len(self.K)

    @property
    def given(self) -> np.ndarray:
        """(v, n) float, px: the parameters of the given cameras, all 0."""
        return np.zeros((len(self), PARAMETERS + INTRINSICS * self.adjusts_lens))

    @property
    def photos_of_lens(self) -> np.ndarray:
        """(v,) int: how many photos each photo's camera took."""
        return np.bincount(self.lens)[self.lens]

    @cached_property
    def sharing(self) -> csr_array:
        """(v n, u) sparse: the parameters of all photos from the unknowns, in which shared intrinsics come once."""
        v, n = self.given.shape
        poses = n * np.repeat(np.arange(v), PARAMETERS) + np.tile(np.arange(PARAMETERS), v)
        rows, columns = poses, np.arange(len(poses))
        if self.adjusts_lens:
            of_lens = n * np.repeat(np.arange(v), INTRINSICS) + np.tile(PARAMETERS + np.arange(INTRINSICS), v)
            shared = len(poses) + INTRINSICS * self.lens[:, None] + np.arange(INTRINSICS)
            rows, columns = np.concatenate([rows, of_lens]), np.concatenate([columns, shared.ravel()])
        return csr_array((np.ones(len(rows)), (rows, columns)), shape=(v * n, int(columns.max()) + 1))

    def intrinsics_at(self, poses: np.ndarray) -> np.ndarray:
        """(v, 3, 3) float, px: intrinsics at parameters (v, n), px."""
        if not self.adjusts_lens:
            return self.K
        K = self.K.copy()
        K[:, :2, :2] *= (1 + poses[:, PARAMETERS] / self.radius)[:, None, None]
        K[:, :2, 2] += poses[:, PARAMETERS + 1 : _DISTORTION.start]
        return K

    def distortion_at(self, poses: np.ndarray) -> np.ndarray:
        """(v, 2) float: k_1 and k_2 at parameters (v, n), px."""
        return poses[:, _DISTORTION] * self.bending if self.adjusts_lens else np.zeros((len(self), 2))

    def displacements(self, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotation vectors (v, 3), radians, and shifts of the centres (v, 3), world units, at poses (v, n), px."""
        return poses[:, :3] * self.angle_unit[:, None], poses[:, 3:PARAMETERS] * self.length_unit[:, None]

    def rotations_at(self, poses: np.ndarray) -> np.ndarray:
        """(v, 3, 3) float: rotations from world to camera axes at poses (v, n), px."""
        return Rotation.from_rotvec(self.displacements(poses)[0]).as_matrix() @ self.rotations

    def centers_at(self, poses: np.ndarray) -> np.ndarray:
        """(v, 3) float, world units: centres at poses (v, n), px."""
        return self.centers + self.displacements(poses)[1]

    def lenses_at(self, poses: np.ndarray, given: Sequence[Camera]) -> list[Lens]:
        """The lenses at parameters (v, n), px, of the photos of the given cameras.

        Raises:
            InputError: a lens folds its photo over itself.
        """
        return [
            Lens(K, distortion, camera.width, camera.height)
            for K, distortion, camera in zip(self.intrinsics_at(poses), self.distortion_at(poses), given, strict=True)
        ]

    def cameras_at(self, poses: np.ndarray, given: Sequence[Camera]) -> list[Camera]:
        """The pinhole cameras at poses (v, n), px, of the photos of the given ones, undistorted by `lenses_at`.

        Raises:
            InputError: a lens folds its photo over itself.
        """
        R, c = self.rotations_at(poses), self.centers_at(poses)
        return [
            Camera(lens.pinhole_K @ np.column_stack([R[v], -R[v] @ c[v]]), lens.width, lens.height)
            for v, lens in enumerate(self.lenses_at(poses, given))
        ]

    def project(self, poses: np.ndarray, observed: ObservedPoints) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (o, 2) and depths (o,), world units, of observed points in their photos, at poses (v, n), px."""
        return compiled.project(
            self.intrinsics_at(poses), self.distortion_at(poses), self.rotations_at(poses), self.centers_at(poses),
            observed.positions, observed.point, observed.photo,
        )  # fmt: skip

    def linearise(self, poses: np.ndarray, observed: ObservedPoints) -> Projected:
        """Images and derivatives of observed points in their photos, at poses (v, n), px.

        With x = R (X - c), phi = a / f and the left Jacobian J_l of the rotation group (Sola et al., A micro Lie theory,
        2018, equation 145), J_l(phi) = I + (1 - cos t) / t^2 [phi]x + (t - sin t) / t^3 [phi]x^2 with t = |phi|:

            d pixel / d x = K_12 M [I | -u] / x_3     u = (x_1, x_2) / x_3, M = s I + 2 (k_1 + 2 k_2 |u|^2) u u^T,
                                                      s = 1 + k_1 |u|^2 + k_2 |u|^4, pixel = K_12 s u + c
            d x / d a     = -[x]x J_l(phi) / f
            d x / d b     = -R d / f
            d x / d X     = R
            d pixel / d e = ((pixel - c) / (r + e_1), I, K_12 u |u|^2 k_1 / e_4, K_12 u |u|^4 k_2 / e_5)
        """
        turns = left_jacobians(poses[:, :3] * self.angle_unit[:, None]) * self.angle_unit[:, None, None]
        radius = self.radius + (poses[:, PARAMETERS] if self.adjusts_lens else 0)
        return Projected(
            *compiled.linearise(
                self.intrinsics_at(poses), self.distortion_at(poses), self.rotations_at(poses), self.centers_at(poses),
                turns, self.length_unit, radius, self.bending, self.given.shape[1], observed.positions, observed.point,
                observed.photo,
            )
        )  # fmt: skip


def cross_matrices(vectors: np.ndarray) -> np.ndarray:
    """(n, 3, 3) float: [u]x with [u]x w = u x w, of vectors (n, 3)."""
    result = np.zeros((len(vectors), 3, 3))
    for row, column, axis, sign in (
        (0, 1, 2, -1),
        (0, 2, 1, 1),
        (1, 0, 2, 1),
        (1, 2, 0, -1),
        (2, 0, 1, -1),
        (2, 1, 0, 1),
    ):
        result[:, row, column] = sign * vectors[:, axis]
    return result


def left_jacobians(phi: np.ndarray) -> np.ndarray:
    """(n, 3, 3) float: J_l of rotation vectors (n, 3), radians, see `PoseModel.linearise`."""
    t = np.linalg.norm(phi, axis=1)[:, None, None]
    is_small = t < 1e-4  # the series' next terms are below 1e-9
    safe = np.where(is_small, 1, t)
    first = np.where(is_small, 0.5, (1 - np.cos(safe)) / safe**2)
    second = np.where(is_small, 1 / 6, (safe - np.sin(safe)) / safe**3)
    X = cross_matrices(phi)
    return np.eye(3) + first * X + second * (X @ X)

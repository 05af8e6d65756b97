"""Calibrated, undistorted pinhole cameras.

Conventions: OpenCV axes (x right, y down, z forward), pixel centres at integers (the top-left pixel's
centre is (0, 0)), no lens distortion. Transforms read right to left: `image_from_world` maps world points to pixels.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fairing.errors import InputError
from fairing.util.guards import check_coordinates, check_focal_lengths, check_size


def resizing(before: tuple[int, int], after: tuple[int, int]) -> np.ndarray:
    """(3, 3): pixels of a photo of size (width, height) `after` from pixels of the same photo of size `before`.

    The photo's outer borders, half a pixel beyond the centres of the outer pixels, are the same.
    """
    sx, sy = after[0] / before[0], after[1] / before[1]
    return np.array([[sx, 0, (sx - 1) / 2], [0, sy, (sy - 1) / 2], [0, 0, 1]])


@dataclass(frozen=True, eq=False)
class Camera:
    """A 3x4 projection matrix and the size of its photo.

    Attributes:
        image_from_world: (3, 4) float, pixels from world units. Normalised on construction, so that its third row gives
            the depth in world units, positive in front.
        width, height: size of the photo in pixels.

    Raises:
        InputError: the matrix is not 3x4, not finite or singular, or the size, the focal lengths or the centre are
            implausible.
    """

    image_from_world: np.ndarray
    width: int
    height: int

    def __post_init__(self) -> None:
        P = np.asarray(self.image_from_world, dtype=np.float64)
        if P.shape != (3, 4):
            raise InputError(f"camera matrix: expected 3x4 numbers, found shape {P.shape}")
        if not np.isfinite(P).all():
            raise InputError("camera matrix: expected finite numbers, found NaN or infinity")
        check_size(self.width, self.height, "camera")
        P = P / (np.abs(P).max() or 1)  # so that no square overflows
        M = P[:, :3]
        row_norms = np.linalg.norm(M, axis=1)
        determinant = np.linalg.det(M / np.where(row_norms > 0, row_norms, 1)[:, None])
        if row_norms.min() == 0 or abs(determinant) < 1e-12:
            raise InputError(
                "camera matrix: its left 3x3 part is singular, so it has no centre; "
                "give a perspective projection (orthographic cameras are not supported)"
            )
        # P and -P are the same camera; depth is positive in front of the one with a positive determinant.
        with np.errstate(over="ignore", invalid="ignore"):
            P = P * (np.sign(determinant) / row_norms[2])
            # |m1 x m3| and |m2 x m3|: Hartley and Zisserman, section 6.2.4, without a decomposition.
            focal_lengths = np.linalg.norm(np.cross(P[:2, :3], P[2, :3]), axis=1)
        check_focal_lengths(focal_lengths, self.width, self.height, "camera")
        check_coordinates(np.linalg.solve(P[:, :3], P[:, 3]), "camera centre")
        P.setflags(write=False)
        object.__setattr__(self, "image_from_world", P)

    @classmethod
    def recorded(cls, image_from_world: np.ndarray, width: int, height: int) -> "Camera":
        """The camera whose matrix (3, 4) was recorded, to the bit: normalising it again would round it.

        Raises:
            InputError: as of the constructor.
        """
        camera = cls(image_from_world, width, height)
        exact = np.array(image_from_world, dtype=np.float64)
        if not np.allclose(exact, camera.image_from_world, rtol=1e-12, atol=0):
            return camera
        exact.setflags(write=False)
        object.__setattr__(camera, "image_from_world", exact)
        return camera

    @classmethod
    def from_krt(cls, K: np.ndarray, R: np.ndarray, t: np.ndarray, width: int, height: int) -> "Camera":
        """Camera from intrinsics K (3, 3), world-to-camera rotation R (3, 3) and translation t (3,): P = K [R | t].

        Raises:
            InputError: K is not upper triangular with positive focal lengths, or R is not a proper rotation.
        """
        K, R, t = np.asarray(K, float), np.asarray(R, float), np.asarray(t, float).reshape(-1)
        if K.shape != (3, 3) or R.shape != (3, 3) or t.shape != (3,):
            raise InputError(f"camera: expected K 3x3, R 3x3, t 3, found {K.shape}, {R.shape}, {t.shape}")
        if not (np.isfinite(K).all() and np.isfinite(R).all() and np.isfinite(t).all()):
            raise InputError("camera: expected finite K, R and t, found NaN or infinity")
        if K[0, 0] <= 0 or K[1, 1] <= 0 or K[2, 2] <= 0:
            raise InputError(
                f"camera: expected positive focal lengths, found fx={K[0, 0]:g}, fy={K[1, 1]:g}; "
                "flip the camera's axes to x right, y down, z forward"
            )
        with np.errstate(over="ignore"):
            check_focal_lengths(np.diag(K)[:2] / K[2, 2], width, height, "camera")
        if np.abs(R).max() > 1.01 or np.abs(R @ R.T - np.eye(3)).max() > 1e-4:
            raise InputError("camera: R is not a rotation (its rows are not orthonormal)")
        if np.linalg.det(R) < 0:
            raise InputError(
                "camera: R is mirrored (determinant -1); flip an axis so that x is right, y down, z forward"
            )
        with np.errstate(over="ignore"):
            P = K @ np.column_stack([R, t])
        return cls(P, width, height)

    def resized(self, width: int, height: int) -> "Camera":
        """The camera of the same photo at another size (width, height) in pixels, with the same outer borders."""
        return Camera(resizing((self.width, self.height), (width, height)) @ self.image_from_world, width, height)

    @cached_property
    def center(self) -> np.ndarray:
        """(3,) float, world units: the centre of projection."""
        return -np.linalg.solve(self.image_from_world[:, :3], self.image_from_world[:, 3])

    @cached_property
    def K(self) -> np.ndarray:
        """(3, 3) float, pixels: intrinsics with positive focal lengths and K[2, 2] = 1."""
        return self._decomposed[0]

    @cached_property
    def camera_from_world(self) -> np.ndarray:
        """(3, 4) float: rigid transform [R | t] to camera axes (x right, y down, z forward)."""
        R = self._decomposed[1]
        return np.column_stack([R, -R @ self.center])

    @cached_property
    def _decomposed(self) -> tuple[np.ndarray, np.ndarray]:
        from scipy.linalg import rq  # imported on first use: it takes 0.1 s

        K, R = rq(self.image_from_world[:, :3])
        signs = np.sign(np.diag(K))
        return K * signs / (K[2, 2] * signs[2]), R * signs[:, None]

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (..., 2) float and depths (...,) float, world units, of world points (..., 3).

        Points behind the camera have depth <= 0; their pixels have no meaning and may be infinite.
        """
        homogeneous = points @ self.image_from_world[:, :3].T + self.image_from_world[:, 3]
        depth = homogeneous[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            return homogeneous[..., :2] / depth[..., None], depth

    def J_image_wrt_point(self, points: np.ndarray) -> np.ndarray:
        """(..., 2, 3) float: d pixel / d point at world points (..., 3); the paper's delta u_iv without its eta.

        Row r (r = 1, 2): ((r_3 x + t_3) r_r - (r_r x + t_r) r_3) / (r_3 x + t_3)^2, with [r_p | t_p] the rows of P.
        """
        uv, depth = self.project(points)
        M = self.image_from_world[:, :3]
        return (M[:2] - uv[..., :, None] * M[2]) / depth[..., None, None]

"""Lens distortion: the polynomial model, and the undistortion of photos and pixels.

Downstream of `Lens` every camera is a pinhole: photos are resampled when they are loaded, observed pixels when they are
read.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from fairing.camera import resizing
from fairing.errors import InputError
from fairing.util.guards import check_focal_lengths, check_size

# Iterations of cv2.undistortPoints; OpenCV's default of 5 is too few (ledger: iterations of undistortion).
_CONVERGED = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-13)
DISTORTION = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
"""The parameters of `Lens.distortion`, in OpenCV's order."""
_MISSED = 1e-3
"""Pixels: a ray whose distorted pixel misses the given one by more than this is not a solution."""


@dataclass(frozen=True, eq=False)
class Lens:
    """A pinhole camera with polynomial distortion (Brown 1966), in OpenCV's notation.

    A ray (x, y, 1) with r^2 = x^2 + y^2 meets the photo at K [x', y', 1] with

        x' = x s + 2 p1 x y + p2 (r^2 + 2 x^2)
        y' = y s + 2 p2 x y + p1 (r^2 + 2 y^2)
        s = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)

    Attributes:
        K: (3, 3) float, pixels: intrinsics of the distorted photo.
        distortion: (8,) float: k1, k2, p1, p2, k3, k4, k5, k6; a shorter array is padded with zeros.
        width, height: size of the photo in pixels.

    Raises:
        InputError: the parameters are not finite or implausible, the principal point lies outside a distorted photo, or
            the distortion is so strong that the photo folds over itself.
    """

    K: np.ndarray
    distortion: np.ndarray
    width: int
    height: int

    def __post_init__(self) -> None:
        given = np.asarray(self.distortion, dtype=np.float64)
        object.__setattr__(self, "distortion", np.pad(given, (0, 8 - len(given))))
        if not (np.isfinite(self.K).all() and np.isfinite(self.distortion).all() and np.diag(self.K).min() > 0):
            raise InputError(
                "lens: expected finite parameters and positive focal lengths, "
                f"found {', '.join(f'{p:g}' for p in (*self.K[:2].ravel()[[0, 4, 2, 5]], *self.distortion))}"
            )
        check_size(self.width, self.height, "lens")
        check_focal_lengths(np.diag(self.K)[:2], self.width, self.height, "lens")
        if not self.is_distorted:
            return
        cx, cy = self.K[:2, 2]
        if not (0 < cx < self.width - 1 and 0 < cy < self.height - 1):
            raise InputError(
                f"lens: the principal point ({cx:g}, {cy:g}) lies outside the {self.width}x{self.height} photo; "
                "use the photos the cameras were calibrated with"
            )
        columns, rows = np.meshgrid(np.linspace(0, self.width - 1, 65), np.linspace(0, self.height - 1, 65))
        rays = (np.stack([columns, rows], axis=-1) - (cx, cy)) / np.diag(self.K)[:2]
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            distorted = self._distort(rays)
            along_row = np.diff(distorted, axis=1)[:-1]
            along_column = np.diff(distorted, axis=0)[:, :-1]
            area = along_row[..., 0] * along_column[..., 1] - along_row[..., 1] * along_column[..., 0]
        if not (area > 0).all():
            raise InputError(
                f"lens: the distortion k1, k2, p1, p2, k3 to k6 = {', '.join(f'{d:g}' for d in self.distortion)} folds "
                "the photo over itself; undistort the photos with the program that calibrated them"
            )

    @property
    def is_distorted(self) -> bool:
        return bool(self.distortion.any())

    @cached_property
    def pinhole_K(self) -> np.ndarray:
        """(3, 3) float, pixels: intrinsics of the undistorted photo, which has the same size and principal point.

        It is K for barrel distortion. For pincushion distortion the focal lengths are increased just enough that every
        pixel of the undistorted photo has content.
        """
        if not self.is_distorted:
            return self.K
        zoom = 1.0
        for axis, (length, across) in enumerate([(self.width - 1, self.height - 1), (self.height - 1, self.width - 1)]):
            for border in (0, length):
                pixels = np.empty((101, 2))
                pixels[:, axis] = border
                pixels[:, 1 - axis] = np.linspace(0, across, 101)
                needed = abs(border - self.K[axis, 2]) / self.K[axis, axis]
                zoom = max(zoom, needed / np.nanmin(np.abs(self._rays(pixels)[:, axis]), initial=np.inf))
        return self.K * np.array([[zoom, zoom, 1], [zoom, zoom, 1], [1, 1, 1]])

    def resized(self, width: int, height: int) -> "Lens":
        """The lens of the same photo at another size (width, height) in pixels, with the same outer borders."""
        return Lens(resizing((self.width, self.height), (width, height)) @ self.K, self.distortion, width, height)

    def undistort(self, pixels: np.ndarray) -> np.ndarray:
        """Pixels (n, 2) float of the undistorted photo from pixels (n, 2) float of the distorted photo.

        NaN where no ray meets the pixel: a barrel polynomial may not reach the photo's corners.
        """
        if not self.is_distorted:
            return pixels
        return self._rays(pixels) * self.pinhole_K[[0, 1], [0, 1]] + self.pinhole_K[:2, 2]

    def undistort_photo(self, photo: np.ndarray) -> np.ndarray:
        """The undistorted photo of a photo (h, w, 3), by Lanczos interpolation (ledger: interpolation of undistortion)."""
        return self._remap(photo, cv2.INTER_LANCZOS4)

    def undistort_mask(self, mask: np.ndarray) -> np.ndarray:
        """The mask (height, width) of the undistorted photo from that of the distorted one, by the nearest pixel."""
        return self._remap(mask, cv2.INTER_NEAREST)

    def _remap(self, image: np.ndarray, interpolation: int) -> np.ndarray:
        size = (self.width, self.height)
        maps = cv2.initUndistortRectifyMap(self.K, self.distortion, np.eye(3), self.pinhole_K, size, cv2.CV_32FC1)
        return cv2.remap(image, *maps, interpolation, borderMode=cv2.BORDER_REPLICATE)

    def _rays(self, pixels: np.ndarray) -> np.ndarray:
        """Undistorted rays (n, 2) from pixels (n, 2) of the distorted photo; NaN where there is none."""
        if len(pixels) == 0:
            return np.zeros((0, 2))
        points = np.ascontiguousarray(pixels, dtype=np.float64)[:, None]
        rays = cv2.undistortPoints(points, self.K, self.distortion, criteria=_CONVERGED)[:, 0]
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            missed = (self._distort(rays) * np.diag(self.K)[:2] + self.K[:2, 2] - points[:, 0]) ** 2
        rays[~(missed.sum(axis=1) < _MISSED**2)] = np.nan
        return rays

    def _distort(self, rays: np.ndarray) -> np.ndarray:
        """Distorted rays (..., 2) from undistorted rays (..., 2), by the class's formula."""
        k1, k2, p1, p2, k3, k4, k5, k6 = self.distortion
        x, y = rays[..., 0], rays[..., 1]
        r2 = x * x + y * y
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        return np.stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
            ],
            axis=-1,
        )

"""Lenses: a pinhole camera with distortion, and the undistortion of photos and pixels.

Downstream of `Lens` every camera is a pinhole: photos are resampled when they are loaded, observed pixels when they are
read.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from fairing.camera import resizing
from fairing.distortion import MODELS
from fairing.errors import InputError
from fairing.util.guards import check_focal_lengths, check_size

DISTORTION = MODELS["polynomial"].names
"""The parameters of the polynomial model, in OpenCV's order."""
_MISSED = 1e-3
"""Pixels: a ray whose distorted pixel misses the given one by more than this is not a solution."""
_BAND = 1 << 20
"""Pixels whose map is computed at once, so that large photos need no large arrays of doubles."""


@dataclass(frozen=True, eq=False)
class Lens:
    """A pinhole camera with a model of distortion: a ray (x, y, 1) meets the photo at K [x', y', 1].

    Attributes:
        K: (3, 3) float, pixels: intrinsics of the distorted photo, upper triangular.
        distortion: parameters of the model; a shorter array is padded with zeros.
        width, height: size of the photo in pixels.
        model: one of `fairing.distortion.MODELS`, which gives x', y'.

    Raises:
        InputError: the parameters are not finite or implausible, the principal point lies outside a distorted photo, or
            the distortion is so strong that the photo folds over itself.
    """

    K: np.ndarray
    distortion: np.ndarray
    width: int
    height: int
    model: str = "polynomial"

    def __post_init__(self) -> None:
        given = np.asarray(self.distortion, dtype=np.float64)
        names = MODELS[self.model].names
        object.__setattr__(self, "distortion", np.pad(given, (0, len(names) - len(given))))
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
                f"lens: the distortion {', '.join(names)} = {', '.join(f'{d:g}' for d in self.distortion)} folds "
                "the photo over itself; undistort the photos with the program that calibrated them"
            )

    @property
    def is_distorted(self) -> bool:
        return self.model == "fisheye" or bool(self.distortion.any())

    @cached_property
    def pinhole_K(self) -> np.ndarray:
        """(3, 3) float, pixels: intrinsics of the undistorted photo, which has the same size and principal point.

        It is K without skew for barrel distortion. For pincushion distortion the focal lengths are increased just enough that every
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
        return self.K * np.array([[zoom, 0, 1], [0, zoom, 1], [1, 1, 1]])

    def resized(self, width: int, height: int) -> "Lens":
        """The lens of the same photo at another size (width, height) in pixels, with the same outer borders."""
        if (width, height) == (self.width, self.height):
            return self
        K = resizing((self.width, self.height), (width, height)) @ self.K
        return Lens(K, self.distortion, width, height, self.model)

    def undistort(self, pixels: np.ndarray) -> np.ndarray:
        """Pixels (n, 2) float of the undistorted photo from pixels (n, 2) float of the distorted photo.

        NaN where no ray meets the pixel (a barrel polynomial may not reach the photo's corners), and for a fisheye where
        the undistorted photo does not reach: near 90 degrees from the axis its pixels lie arbitrarily far outside.
        """
        if not self.is_distorted:
            return pixels
        straight = self._rays(pixels) * self.pinhole_K[[0, 1], [0, 1]] + self.pinhole_K[:2, 2]
        if self.model == "fisheye":
            inside = (straight > -0.5) & (straight < (self.width - 0.5, self.height - 0.5))
            straight[~inside.all(axis=1)] = np.nan
        return straight

    def distort(self, pixels: np.ndarray) -> np.ndarray:
        """The inverse of `undistort`: pixels (n, 2) of the distorted photo from pixels (n, 2) of the undistorted one."""
        if not self.is_distorted:
            return pixels
        rays = (pixels - self.pinhole_K[:2, 2]) / self.pinhole_K[[0, 1], [0, 1]]
        return self._distort(rays) @ self.K[:2, :2].T + self.K[:2, 2]

    def undistort_photo(self, photo: np.ndarray) -> np.ndarray:
        """The undistorted photo of a photo (h, w, 3), by Lanczos interpolation (ledger: interpolation of undistortion)."""
        return self._remap(photo, cv2.INTER_LANCZOS4)

    def undistort_mask(self, mask: np.ndarray) -> np.ndarray:
        """The mask (height, width) of the undistorted photo from that of the distorted one, by the nearest pixel."""
        return self._remap(mask, cv2.INTER_NEAREST)

    def _remap(self, image: np.ndarray, interpolation: int) -> np.ndarray:
        return cv2.remap(image, *self._maps(), interpolation, borderMode=cv2.BORDER_REPLICATE)

    def _maps(self) -> tuple[np.ndarray, np.ndarray]:
        """x and y (height, width) float32: the distorted pixel of each pixel of the undistorted photo."""
        size, K = (self.width, self.height), self.K * np.array([[1, 0, 1], [0, 1, 1], [1, 1, 1]])
        if self.model == "polynomial":
            x, y = cv2.initUndistortRectifyMap(K, self.distortion, np.eye(3), self.pinhole_K, size, cv2.CV_32FC1)
        elif self.model == "fisheye":
            x, y = cv2.fisheye.initUndistortRectifyMap(
                K, self.distortion, np.eye(3), self.pinhole_K, size, cv2.CV_32FC1
            )
        else:
            x, y = (np.empty((self.height, self.width), dtype=np.float32) for _ in range(2))
            step = max(1, _BAND // self.width)
            for first in range(0, self.height, step):
                rows, columns = np.mgrid[first : min(first + step, self.height), : self.width].astype(np.float64)
                rays = (np.stack([columns, rows], axis=-1) - self.pinhole_K[:2, 2]) / np.diag(self.pinhole_K)[:2]
                with np.errstate(over="ignore"):
                    pixels = self._distort(rays) * np.diag(K)[:2] + K[:2, 2]
                    x[first : first + step], y[first : first + step] = pixels[..., 0], pixels[..., 1]
        skew = self.K[0, 1] / self.K[1, 1]
        return (x + np.float32(skew) * (y - np.float32(self.K[1, 2])), y) if skew else (x, y)

    def _rays(self, pixels: np.ndarray) -> np.ndarray:
        """Undistorted rays (n, 2) from pixels (n, 2) of the distorted photo; NaN where there is none."""
        distorted = np.empty((len(pixels), 2))
        distorted[:, 1] = (pixels[:, 1] - self.K[1, 2]) / self.K[1, 1]
        distorted[:, 0] = (pixels[:, 0] - self.K[0, 2] - self.K[0, 1] * distorted[:, 1]) / self.K[0, 0]
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            rays = MODELS[self.model].undistort(distorted, self.distortion)
            missed = ((self._distort(rays) - distorted) * np.diag(self.K)[:2]) ** 2
        rays[~(missed.sum(axis=1) < _MISSED**2)] = np.nan
        return rays

    def _distort(self, rays: np.ndarray) -> np.ndarray:
        """Distorted rays (..., 2) from undistorted rays (..., 2)."""
        return MODELS[self.model].distort(rays, self.distortion)

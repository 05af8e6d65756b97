"""The photos at the blurs the levels ask for."""

import cv2
import numpy as np
from scipy.ndimage import spline_filter

from fairing.scene import Scene


class ScaleSpace:
    """Gaussian-blurred photos of a scene, decoded once, one blur kept at a time per interpolation.

    Memory: the photos as uint8 and, per blur in use, as float32.
    """

    def __init__(self, scene: Scene, color: bool) -> None:
        self._views = scene.views
        self._color = color
        self._photos: list[np.ndarray] | None = None
        self._planes: dict[tuple[tuple[float, ...], bool], np.ndarray] = {}
        self._masks: dict[tuple[int, int], np.ndarray] = {}

    @property
    def channels(self) -> int:
        return 3 if self._color else 1

    @property
    def offsets(self) -> np.ndarray:
        """(V,) int64: where each photo starts in the flat array `planes` gives."""
        sizes = [self.channels * view.camera.width * view.camera.height for view in self._views]
        return np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)

    def planes(self, blurs: tuple[float, ...], cubic: bool) -> np.ndarray:
        """All photos at each of the blurs in turn, flat float32, planes (channels, height, width), in grey levels.

        Args:
            blurs: sigmas of Gaussians, pixels; 0 for none.
            cubic: give cubic B-spline coefficients instead of pixels.
        """
        key = (blurs, cubic)
        if key not in self._planes:
            self._planes[key] = np.concatenate(
                [self._filtered(photo, blur, cubic).ravel() for blur in blurs for photo in self._load()]
            )
        return self._planes[key]

    def mask(self, view: int, reduction: int) -> np.ndarray | None:
        """(h, w) bool at 1 / `reduction` of the photo's size: True where all its pixels count; None without a mask."""
        mask = self._views[view].mask
        if mask is None:
            return None
        if (view, reduction) not in self._masks:
            counts = mask.load()
            padding = [(0, -size % reduction) for size in counts.shape]
            padded = np.pad(counts, padding, mode="edge")
            h, w = (size // reduction for size in padded.shape)
            self._masks[view, reduction] = padded.reshape(h, reduction, w, reduction).min(axis=(1, 3))
        return self._masks[view, reduction]

    def forget_all_but(self, blur: float) -> None:
        """Free the planes made for other levels: those whose finest blur is another."""
        self._planes = {key: planes for key, planes in self._planes.items() if key[0][0] == blur}

    def _load(self) -> list[np.ndarray]:
        if self._photos is None:
            self._photos = [self._decode(view) for view in self._views]
        return self._photos

    def _decode(self, view) -> np.ndarray:
        pixels = view.photo.load()
        if self._color:
            return np.ascontiguousarray(pixels.transpose(2, 0, 1))
        # Rec. 601 luma, kept in eighths of a grey level: rounding to whole levels would triple the quantisation noise.
        luma = pixels.astype(np.float32) @ np.array([0.299, 0.587, 0.114], dtype=np.float32)
        return np.round(luma * 8)[None].astype(np.uint16)

    def _filtered(self, photo: np.ndarray, blur: float, cubic: bool) -> np.ndarray:
        scale = 1.0 if self._color else 1 / 8
        planes = photo.astype(np.float32) * np.float32(scale)
        if blur > 0:
            radius = int(np.ceil(4 * blur))
            size = (2 * radius + 1, 2 * radius + 1)
            planes = np.stack(
                [cv2.GaussianBlur(plane, size, blur, borderType=cv2.BORDER_REFLECT_101) for plane in planes]
            )
        if cubic:
            planes = np.stack([spline_filter(plane, 3, np.float32, "mirror") for plane in planes])  # pyright: ignore[reportArgumentType]
        return planes

"""Scale space: Gaussian-blurred photos, computed on demand for the blurs of a level."""

import math
import threading
import time
from collections.abc import Callable, Collection, Iterable
from concurrent.futures import Executor
from typing import NamedTuple

import cv2
import numpy as np
from scipy.ndimage import spline_filter

from fairing.photo import grey_levels
from fairing.scene import Scene

LUMA = np.array([0.299, 0.587, 0.114])
"""Weights of red, green and blue in the luma (Rec. 601)."""
MEMORY = 2_000_000_000
"""Bytes: limit of decoded photos, others are decoded again for every blur; and of photos or patches of a level, see `exceeds`."""
MAX_CONCURRENT_PHOTOS = 4
"""Photos decoded and blurred at a time; each takes 28 bytes per pixel."""
KEPT_BYTES = 1 << 29
"""Blurred photos kept for later levels: the preparation reads them before the first one begins."""
MIN_REDUCED_SIZE = 64
"""px: least width and height of a reduced photo."""


def exceeds(pixels: float) -> bool:
    """Whether so many pixels of a level take more than `MEMORY`: then photos are stored at reduced resolution, and patches around
    the faces are not made. (ledger: reduced photos, patch memory)"""
    return 4 * pixels > MEMORY


def reduction(size: tuple[int, int], sigma: float, blur: float, is_large: bool) -> int:
    """Reduction factor at which a photo is stored: a power of 2, at most sigma / 2, or sigma in a large scene.

    The blur leaves less than 1 % (exp(-pi^2 / 2)) of the frequencies that a photo reduced by sigma cannot represent, but
    reduced photos are interpolated less accurately. So those of the level's own blur are stored whole, unless the scene is
    large. (ledger: reduced photos)

    Args:
        size: (width, height) of the photo, px.
        sigma: standard deviation of the photo's Gaussian blur, px.
        blur: of the level, px.
        is_large: whether the photos together exceed `MEMORY`.
    """
    largest = sigma if is_large else 1.0 if sigma == blur else sigma / 2
    factor = 2 ** max(0, math.frexp(largest)[1] - 1)
    while factor > 1 and min(size) < MIN_REDUCED_SIZE * factor:
        factor //= 2
    return factor


class _Layout(NamedTuple):
    """Blurred photos in one array, and where each starts; `pixels` is the used front part of `reserved`."""

    reserved: np.ndarray
    pixels: np.ndarray
    starts: dict[tuple[int, float], int]


class ScaleSpace:
    """Gaussian-blurred photos of a scene at the blurs of its levels and their octaves, per interpolation.

    Memory: 4 bytes per pixel of blurred photos as they are stored, see `reduction`, and decoded photos (2 bytes per pixel,
    3 in colour; of photos with 16 bits 4 and 12) up to `MEMORY`.

    Args:
        color: use all three channels instead of the luma.
        on_photo: progress callback (photos done, photos in all), called from the pool's threads.

    Attributes:
        seconds: time spent on decoding and blurring photos.
    """

    def __init__(
        self, scene: Scene, color: bool, on_photo: Callable[[int, int], None] = lambda done, count: None
    ) -> None:
        self._views = scene.views
        self._color = color
        self._is_large = exceeds(sum(view.camera.width * view.camera.height for view in scene.views))
        self._photos: dict[int, np.ndarray] = {}
        self._layouts: dict[tuple[float, bool], _Layout] = {}
        self._masks: dict[tuple[int, int], np.ndarray] = {}
        self._in_work = threading.Semaphore(MAX_CONCURRENT_PHOTOS)
        self._laying_out = threading.Lock()
        self.seconds = 0.0
        self._on_photo = on_photo

    @property
    def channels(self) -> int:
        """Planes of a photo: 1 (luma) or 3."""
        return 3 if self._color else 1

    @property
    def grey_levels(self) -> np.float32:
        """Grey levels per unit of the decoded photos (`for_each`)."""
        return np.float32(1.0 if self._color else 1 / 8)

    def lay_out(
        self, blur: float, cubic: bool, requested: Iterable[tuple[int, float]], pool: Executor
    ) -> tuple[np.ndarray, dict[tuple[int, float], int]]:
        """Blurred photos in one flat array.

        Args:
            blur: of the level, px; the array of a level is kept until `begin_level`.
            cubic: store cubic B-spline coefficients instead of pixels.
            requested: view ids, each with the sigma of a Gaussian, px; 0 for none.
            pool: executes several photos at a time.

        Returns:
            The array, flat float32, grey levels: planes (channels, height, width) of each photo at `size_at`; and the index at
            which each requested photo starts in it.
        """
        with self._laying_out:
            return self._laid_out(blur, cubic, requested, pool)

    def _laid_out(
        self, blur: float, cubic: bool, requested: Iterable[tuple[int, float]], pool: Executor
    ) -> tuple[np.ndarray, dict[tuple[int, float], int]]:
        nothing = np.zeros(0, np.float32)
        reserved, pixels, starts = self._layouts.get((blur, cubic), _Layout(nothing, nothing, {}))
        missing: dict[int, list[float]] = {}
        for view, sigma in requested:
            if (view, sigma) not in starts:
                missing.setdefault(view, []).append(sigma)
        if missing:
            starts, at = dict(starts), len(pixels)
            for view, sigmas in missing.items():
                for sigma in sigmas:
                    starts[view, sigma] = at
                    at += self._pixels_at(view, sigma, blur)
            if at > len(reserved):
                # More, for photos that later sweeps add, saves copying; untouched pages are free.
                reserved = np.empty(at + at // 8, dtype=np.float32)
                reserved[: len(pixels)] = pixels
            pixels = reserved[:at]

            def fill(view: int, photo: np.ndarray) -> None:
                planes, blurred = photo.astype(np.float32) * self.grey_levels, {}
                for sigma in missing[view]:
                    start = starts[view, sigma]
                    kept = self._blurred(view, planes, sigma, blur, blurred)
                    if cubic:
                        kept = np.stack([spline_filter(plane, 3, np.float32, "mirror") for plane in kept])  # pyright: ignore[reportArgumentType]
                    pixels[start : start + kept.size] = kept.ravel()

            self.for_each(missing, fill, pool)
            self._layouts[blur, cubic] = _Layout(reserved, pixels, starts)
        return pixels, starts

    def reduction(self, view: int, sigma: float, blur: float) -> int:
        """Reduction factor f of a view at a blur sigma, px, for a level's blur, px.

        Pixel (x, y) of the stored photo is pixel (f x, f y) of the blurred one.
        """
        camera = self._views[view].camera
        return reduction((camera.width, camera.height), sigma, blur, self._is_large)

    def size_at(self, view: int, sigma: float, blur: float) -> tuple[int, int]:
        """(width, height), px, of the stored photo of a view at a blur sigma, px, for a level's blur, px."""
        camera, factor = self._views[view].camera, self.reduction(view, sigma, blur)
        return -(-camera.width // factor), -(-camera.height // factor)

    def for_each(self, views: Collection[int], process: Callable[[int, np.ndarray], None], pool: Executor) -> None:
        """Call `process(view, photo)` with photos as taken, (channels, height, width) in units of `grey_levels`.

        Raises:
            InputError: a photo cannot be decoded.
        """
        began, done = time.perf_counter(), iter(range(1, len(views) + 1))

        def work(view: int) -> None:
            with self._in_work:
                process(view, self._photo(view))
            self._on_photo(next(done), len(views))

        list(pool.map(work, views))
        self.seconds += time.perf_counter() - began

    def mask(self, view: int, reduction: int) -> np.ndarray | None:
        """(h, w) bool at 1 / `reduction` of the photo's size: True where none of its pixels is masked; None without a mask."""
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

    def begin_level(self, blur: float) -> None:
        """Free the photos of stronger blurs, which earlier levels read, and those of weaker ones beyond `KEPT_BYTES`."""
        self._layouts = {key: layout for key, layout in self._layouts.items() if key[0] <= blur}
        weaker = [key for key in self._layouts if key[0] < blur]
        while weaker and sum(self._layouts[key].reserved.nbytes for key in weaker) > KEPT_BYTES:
            del self._layouts[weaker.pop(0)]

    def _pixels_at(self, view: int, sigma: float, blur: float) -> int:
        width, height = self.size_at(view, sigma, blur)
        return self.channels * width * height

    def _photo(self, view: int) -> np.ndarray:
        if view in self._photos:
            return self._photos[view]
        photo = self._decode(view)
        if photo.nbytes + sum(kept.nbytes for kept in list(self._photos.values())) <= MEMORY:
            self._photos[view] = photo
        return photo

    def _decode(self, view: int) -> np.ndarray:
        pixels = self._views[view].photo.full_depth()
        if self._color:
            return np.ascontiguousarray(grey_levels(pixels).transpose(2, 0, 1))
        # Luma in eighths of a grey level: rounding to whole levels would triple the quantisation noise. That of photos
        # with 16 bits is not rounded.
        eighths = grey_levels(pixels).astype(np.float32)[None] @ LUMA.astype(np.float32) * 8
        return np.round(eighths).astype(np.uint16) if pixels.dtype == np.uint8 else eighths

    def _blurred(
        self, view: int, planes: np.ndarray, sigma: float, blur: float, blurred: dict[float, np.ndarray]
    ) -> np.ndarray:
        """A photo's planes (channels, height, width) at a blur sigma, px, for a level's blur; `blurred` holds finished ones.

        A strong blur is computed from the photo at half of it, which has fewer pixels or is needed as well.
        """
        if sigma not in blurred:
            factor, weaker, at = self.reduction(view, sigma, blur), 0.0, 1
            if factor > 2:
                weaker, at = sigma / 2, self.reduction(view, sigma / 2, blur)
                planes = self._blurred(view, planes, weaker, blur, blurred)
            added = math.sqrt(sigma**2 - weaker**2) / at
            kept = planes
            if added > 0:
                size = (2 * math.ceil(4 * added) + 1,) * 2
                kept = np.stack(
                    [cv2.GaussianBlur(plane, size, added, borderType=cv2.BORDER_REFLECT_101) for plane in planes]
                )
            blurred[sigma] = kept[:, :: factor // at, :: factor // at]
        return blurred[sigma]

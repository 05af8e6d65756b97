"""The photos at the blurs the levels ask for."""

import math
import threading
import time
from collections.abc import Callable, Collection, Iterable
from concurrent.futures import Executor
from typing import NamedTuple

import cv2
import numpy as np
from scipy.ndimage import spline_filter

from fairing.scene import Scene

KEPT_PHOTOS = 1_500_000_000  # bytes of decoded photos; what goes beyond is decoded anew for every blur
AT_ONCE = 4  # photos in work: each takes 28 bytes a pixel
ROWS = 1024  # of a photo converted to grey at a time
LARGE = 500_000_000
"""Pixels of all photos together. With more, blurred photos are kept smaller: of 200 photos of 20 Mpx and faces of 280 px the
level of blur 2 would take 41 GB, for most photos are wanted at several blurs; so it takes 5."""
SMALLEST = 64  # px: no photo is kept smaller
ROOM = 8  # a part of what is laid out is reserved for what later sweeps add, without copying all; it costs nothing until then


def reduction(is_large: bool, size: tuple[int, int], sigma: float) -> int:
    """Pixels of a photo along an edge for each pixel that is kept of it, blurred by sigma px: a power of 2.

    At most sigma: what finer pixels could show is below 1 % by then (exp(-pi^2 / 2)).

    Args:
        is_large: whether the photos together have more than `LARGE` pixels.
        size: (width, height) of the photo.
    """
    factor = 2 ** max(0, math.frexp(sigma)[1] - 1) if is_large and sigma >= 2 else 1
    while factor > 1 and min(size) < SMALLEST * factor:
        factor //= 2
    return factor


class _Layout(NamedTuple):
    """Blurred photos one after another, and where each begins; they lie at the front of what is reserved."""

    reserved: np.ndarray
    pixels: np.ndarray
    starts: dict[tuple[int, float], int]


class ScaleSpace:
    """Gaussian-blurred photos of a scene, one blur (and its coarser companions) kept at a time per interpolation.

    Memory: 4 bytes a pixel of what is laid out, and decoded photos (2 bytes a pixel) up to `KEPT_PHOTOS`. Of a scene of more
    than `LARGE` pixels blurred photos are kept smaller.

    Args:
        on_photo: told of the photos being laid out: how many are done, and of how many.

    Attributes:
        seconds: spent on laying out photos.
    """

    def __init__(
        self, scene: Scene, color: bool, on_photo: Callable[[int, int], None] = lambda done, count: None
    ) -> None:
        self._views = scene.views
        self._color = color
        self._is_large = sum(view.camera.width * view.camera.height for view in scene.views) > LARGE
        self._photos: dict[int, np.ndarray] = {}
        self._layouts: dict[tuple[float, bool], _Layout] = {}
        self._masks: dict[tuple[int, int], np.ndarray] = {}
        self._in_work = threading.Semaphore(AT_ONCE)
        self._laying_out = threading.Lock()
        self.seconds = 0.0
        self._on_photo = on_photo

    @property
    def channels(self) -> int:
        return 3 if self._color else 1

    @property
    def grey_levels(self) -> np.float32:
        """Grey levels in a unit of the photos as they are kept."""
        return np.float32(1.0 if self._color else 1 / 8)

    def lay_out(
        self, blur: float, cubic: bool, wanted: Iterable[tuple[int, float]], pool: Executor
    ) -> tuple[np.ndarray, dict[tuple[int, float], int]]:
        """Photos at blurs in one flat float32 array, planes (channels, height, width) each, in grey levels, of `size_at`.

        Args:
            blur: of the level, px; what was laid out for it is kept until `forget_all_but`.
            cubic: give cubic B-spline coefficients instead of pixels.
            wanted: views, each with the sigma of a Gaussian, px; 0 for none.
            pool: works on several photos at a time.

        Returns:
            The array, and where each wanted photo begins in it.
        """
        with self._laying_out:
            return self._laid_out(blur, cubic, wanted, pool)

    def _laid_out(
        self, blur: float, cubic: bool, wanted: Iterable[tuple[int, float]], pool: Executor
    ) -> tuple[np.ndarray, dict[tuple[int, float], int]]:
        nothing = np.zeros(0, np.float32)
        reserved, pixels, starts = self._layouts.get((blur, cubic), _Layout(nothing, nothing, {}))
        missing: dict[int, list[float]] = {}
        for view, sigma in wanted:
            if (view, sigma) not in starts:
                missing.setdefault(view, []).append(sigma)
        if missing:
            starts, at = dict(starts), len(pixels)
            for view, sigmas in missing.items():
                for sigma in sigmas:
                    starts[view, sigma] = at
                    at += self._pixels_at(view, sigma)
            if at > len(reserved):
                reserved = np.empty(at + at // ROOM, dtype=np.float32)
                reserved[: len(pixels)] = pixels
            pixels = reserved[:at]

            def fill(view: int, photo: np.ndarray) -> None:
                for sigma in missing[view]:
                    start = starts[view, sigma]
                    kept = self._filtered(photo, sigma, self.reduction(view, sigma), cubic)
                    pixels[start : start + kept.size] = kept.ravel()

            self.for_each(missing, fill, pool)
            self._layouts[blur, cubic] = _Layout(reserved, pixels, starts)
        return pixels, starts

    def reduction(self, view: int, sigma: float) -> int:
        """See `reduction`, of a view at a blur. Pixel (x, y) of the photo that is kept is pixel (f x, f y) of the blurred one."""
        camera = self._views[view].camera
        return reduction(self._is_large, (camera.width, camera.height), sigma)

    def size_at(self, view: int, sigma: float) -> tuple[int, int]:
        """(width, height) of the photo that is kept of a view at a blur."""
        camera, factor = self._views[view].camera, self.reduction(view, sigma)
        return -(-camera.width // factor), -(-camera.height // factor)

    def for_each(self, views: Collection[int], do: Callable[[int, np.ndarray], None], pool: Executor) -> None:
        """Call `do(view, photo)` with photos as taken, (channels, height, width) in units of `grey_levels`, several at a time."""
        began, done = time.perf_counter(), iter(range(1, len(views) + 1))

        def work(view: int) -> None:
            with self._in_work:
                do(view, self._photo(view))
            self._on_photo(next(done), len(views))

        list(pool.map(work, views))
        self.seconds += time.perf_counter() - began

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
        """Free what was laid out for the blurs of other levels."""
        self._layouts = {key: layout for key, layout in self._layouts.items() if key[0] == blur}

    def _pixels_at(self, view: int, sigma: float) -> int:
        width, height = self.size_at(view, sigma)
        return self.channels * width * height

    def _photo(self, view: int) -> np.ndarray:
        if view in self._photos:
            return self._photos[view]
        photo = self._decode(view)
        if photo.nbytes + sum(kept.nbytes for kept in list(self._photos.values())) <= KEPT_PHOTOS:
            self._photos[view] = photo
        return photo

    def _decode(self, view: int) -> np.ndarray:
        pixels = self._views[view].photo.load()
        if self._color:
            return np.ascontiguousarray(pixels.transpose(2, 0, 1))
        # Rec. 601 luma, kept in eighths of a grey level: rounding to whole levels would triple the quantisation noise.
        eighths = np.empty((1, *pixels.shape[:2]), dtype=np.uint16)
        for row in range(0, len(pixels), ROWS):
            part = slice(row, row + ROWS)
            luma = pixels[part].astype(np.float32) @ np.array([0.299, 0.587, 0.114], dtype=np.float32)
            eighths[0, part] = np.round(luma * 8)
        return eighths

    def _filtered(self, photo: np.ndarray, blur: float, factor: int, cubic: bool) -> np.ndarray:
        planes = photo.astype(np.float32) * self.grey_levels
        if blur > 0:
            radius = int(np.ceil(4 * blur))
            size = (2 * radius + 1, 2 * radius + 1)
            planes = np.stack(
                [cv2.GaussianBlur(plane, size, blur, borderType=cv2.BORDER_REFLECT_101) for plane in planes]
            )
        planes = planes[:, ::factor, ::factor]
        if cubic:
            planes = np.stack([spline_filter(plane, 3, np.float32, "mirror") for plane in planes])  # pyright: ignore[reportArgumentType]
        return planes

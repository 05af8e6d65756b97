"""Photos and masks, decoded on demand."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from fairing.image_file import PER_GREY_LEVEL, decode_image, read_header, read_other_orientation
from fairing.lens import Lens
from fairing.util.bounded_cache import BoundedCache
from fairing.util.orientation import AS_STORED, INVERSE, turned, turned_size

MASK_THRESHOLD = 1
"""Least sample of a mask's pixel that is used, 0 to 255, as in COLMAP."""
LOSSY_THRESHOLD = 128
"""The same of a JPEG, whose compression turns black into almost black."""
OPAQUE = 128
"""Least alpha of a photo's pixel that is used, 0 to 255: a lossy compression leaves few pixels at exactly 0 or 255."""


class Photo(Protocol):
    """Source of a view's pixels."""

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels, without decoding the photo."""
        ...

    def load(self) -> np.ndarray:
        """(height, width, 3) uint8, RGB."""
        ...

    def full_depth(self) -> np.ndarray:
        """(height, width, 3) RGB as in the file: uint8, or uint16 with 257 units per grey level; see `grey_levels`."""
        ...


def grey_levels(pixels: np.ndarray) -> np.ndarray:
    """Grey levels, 0 to 255, of pixels at full depth: uint8 as they are, uint16 as float32."""
    return pixels if pixels.dtype == np.uint8 else pixels * np.float32(1 / PER_GREY_LEVEL)


@dataclass(frozen=True, eq=False)
class ArrayPhoto:
    """A photo held in memory: (height, width, 3) uint8, RGB."""

    pixels: np.ndarray

    @property
    def size(self) -> tuple[int, int]:
        return self.pixels.shape[1], self.pixels.shape[0]

    def load(self) -> np.ndarray:
        return self.pixels

    def full_depth(self) -> np.ndarray:
        return self.pixels


LOADED_BYTES = 500_000_000
"""Decoded photos kept in memory."""
# The most recently used photos: a photo is loaded several times in a run (engine, image edges, textures, report).
# There is no cache on disk; `eigenfairing convert` writes undistorted photos (ledger: cache of undistorted photos).
_LOADED: BoundedCache[Photo] = BoundedCache(max_bytes=LOADED_BYTES)


def _kept(photo: Photo, make: Callable[[], np.ndarray]) -> np.ndarray:
    """The pixels of a photo from the cache, else as made, read-only."""

    def read_only() -> tuple[np.ndarray]:
        pixels = make()
        pixels.setflags(write=False)
        return (pixels,)

    return _LOADED.get(photo, read_only)[0]


@dataclass(frozen=True, eq=False)
class FilePhoto:
    """A photo file; decoded photos are kept in a bounded cache.

    Attributes:
        path: may be given as text.
        lens: the distortion of the upright photo, which `load` removes; None for a pinhole camera.
        orientation: how `load` turns the decoded pixels, see `fairing.util.orientation`; by default not at all.
    """

    path: Path
    lens: Lens | None = None
    orientation: int = AS_STORED

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", Path(self.path))

    @property
    def size(self) -> tuple[int, int]:
        return turned_size(read_header(self.path).size, self.orientation)

    @property
    def other_orientation(self) -> int:
        """The orientation in which the photo may be meant instead, by the file's tag; `AS_STORED` if it has none."""
        return read_other_orientation(self.path)

    def load(self) -> np.ndarray:
        return _of_8_bits(self.full_depth())

    def full_depth(self) -> np.ndarray:
        return _kept(self, self.decode)

    def decode(self) -> np.ndarray:
        """As `full_depth`, without the cache."""
        pixels = turned(decode_image(self.path).pixels, self.orientation)
        if pixels.ndim == 2:
            pixels = np.repeat(pixels[..., None], 3, axis=2)
        return pixels if self.lens is None else self.lens.undistort_photo(pixels)


@dataclass(frozen=True, eq=False)
class ResizedPhoto:
    """Another photo resampled by area averaging to another size (width, height) in pixels, with the same outer borders."""

    whole: Photo
    size: tuple[int, int]

    def load(self) -> np.ndarray:
        return _of_8_bits(self.full_depth())

    def full_depth(self) -> np.ndarray:
        return _kept(self, self._resized)

    def _resized(self) -> np.ndarray:
        # The cache holds the reduced photo alone: the whole one may be larger than all of the cache.
        whole = self.whole.decode() if isinstance(self.whole, FilePhoto) else self.whole.full_depth()
        return cv2.resize(whole, self.size, interpolation=cv2.INTER_AREA)


@dataclass(frozen=True, eq=False)
class UndistortedPhoto:
    """Another photo, freed from a distortion that was found in it."""

    whole: Photo
    lens: Lens

    @property
    def size(self) -> tuple[int, int]:
        return self.whole.size

    def load(self) -> np.ndarray:
        return _of_8_bits(self.full_depth())

    def full_depth(self) -> np.ndarray:
        return _kept(self, lambda: self.lens.undistort_photo(self.whole.full_depth()))


def has_given_lens(photo: Photo) -> bool:
    """Whether a photo was undistorted by a lens that its capture gives."""
    if isinstance(photo, (ResizedPhoto, UndistortedPhoto)):
        return has_given_lens(photo.whole)
    return isinstance(photo, FilePhoto) and photo.lens is not None


@dataclass(frozen=True, eq=False)
class Mask:
    """The part of a photo that is used, from an image of the photo's size, the photo's own alpha channel, or both.

    Attributes:
        path: an image whose black pixels are ignored, as in COLMAP; None for none. May be given as text.
        lens: the distortion of the photo and the mask; None for a pinhole camera.
        resized: (width, height) in pixels that photo and mask are used at; None for the file's.
        alpha: the photo file, whose transparent pixels are ignored; None to use them.
        orientation: how the image at `path` is turned, see `mask_orientation`.
        alpha_orientation: how the photo file is turned.
    """

    path: Path | None
    lens: Lens | None = None
    resized: tuple[int, int] | None = None
    alpha: Path | None = None
    orientation: int = AS_STORED
    alpha_orientation: int = AS_STORED

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", None if self.path is None else Path(self.path))

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that the mask is read from."""
        return tuple(path for path in (self.path, self.alpha) if path is not None)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels, without decoding the mask."""
        if self.resized is not None:
            return self.resized
        stored = read_header(self.files[0]).size
        return turned_size(stored, self.alpha_orientation if self.path is None else self.orientation)

    def undistorted(self, lens: Lens) -> "Mask":
        """The mask of the photo freed from a distortion; `lens` is that of the photo at the size of the mask."""
        return replace(self, lens=lens.resized(*replace(self, resized=None).size))

    def load(self) -> np.ndarray:
        """(height, width) bool: True where the photo is used."""
        parts = [] if self.path is None else [turned(_not_black(self.path), self.orientation)]
        if self.alpha is not None:
            parts.append(turned(opaque_part(self.alpha), self.alpha_orientation))
        counts = np.logical_and.reduce(parts).astype(np.uint8)
        if self.lens is not None:
            counts = self.lens.undistort_mask(counts)
        if self.resized is not None:  # a pixel is used if all of its area is
            return cv2.resize(counts.astype(np.float32), self.resized, interpolation=cv2.INTER_AREA) > 1 - 1e-4
        return counts > 0


def mask_orientation(path: Path, photo: FilePhoto) -> int:
    """How a mask image is turned to fit its photo: masks are made of the stored pixels or of the upright picture.

    Its size decides; where both fit, it is turned with the photo if its file has the same orientation tag.

    Raises:
        InputError: photo or mask cannot be read.
    """
    is_turned = photo.orientation != AS_STORED
    needed = photo.orientation if is_turned else INVERSE[photo.other_orientation]
    if needed == AS_STORED:
        return AS_STORED
    size, expected = read_header(path).size, photo.size
    fits = size == expected
    if turned_size(size, needed) != expected or (fits and not is_turned):
        return AS_STORED
    return needed if not fits or read_other_orientation(path) == needed else AS_STORED


def opaque_part(path: Path) -> np.ndarray:
    """(height, width) bool: the pixels of an image file that are not transparent.

    Raises:
        InputError: the file cannot be decoded.
    """
    pixels, alpha = decode_image(path)
    return np.ones(pixels.shape[:2], dtype=bool) if alpha is None else alpha >= OPAQUE


def _not_black(path: Path) -> np.ndarray:
    pixels = decode_image(path).pixels
    largest = pixels if pixels.ndim == 2 else pixels.max(axis=2)
    unit = 1 if pixels.dtype == np.uint8 else PER_GREY_LEVEL
    return largest >= (LOSSY_THRESHOLD * unit if path.suffix.lower() in (".jpg", ".jpeg") else MASK_THRESHOLD)


def _of_8_bits(pixels: np.ndarray) -> np.ndarray:
    return pixels if pixels.dtype == np.uint8 else cv2.convertScaleAbs(pixels, alpha=1 / PER_GREY_LEVEL)

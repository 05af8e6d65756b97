"""Photographs, decoded only when somebody looks at them."""

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
from PIL import Image, UnidentifiedImageError

from fairing.errors import InputError
from fairing.lens import Lens
from fairing.util.bounded_cache import BoundedCache


class Photo(Protocol):
    """Where the pixels of a view come from."""

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels, without decoding the photo."""
        ...

    def load(self) -> np.ndarray:
        """(height, width, 3) uint8, RGB."""
        ...


@dataclass(frozen=True, eq=False)
class ArrayPhoto:
    """A photo held in memory: (height, width, 3) uint8, RGB."""

    pixels: np.ndarray

    @property
    def size(self) -> tuple[int, int]:
        return self.pixels.shape[1], self.pixels.shape[0]

    def load(self) -> np.ndarray:
        return self.pixels


@dataclass(frozen=True, eq=False)
class FilePhoto:
    """A photo file, decoded at every `load` (the engine keeps what it needs at hand).

    Attributes:
        lens: what bent the photo, or None for a pinhole camera. `load` straightens it once and keeps the result while
            there is room.
    """

    path: Path
    lens: Lens | None = None

    @property
    def size(self) -> tuple[int, int]:
        with _naming_failures(self.path), Image.open(self.path) as image:
            return image.size

    def load(self) -> np.ndarray:
        return self._decode() if self.lens is None else _STRAIGHT.get(self, self._straighten)[0]

    def _straighten(self) -> tuple[np.ndarray]:
        assert self.lens is not None
        pixels = self.lens.undistort_photo(self._decode())
        pixels.setflags(write=False)
        return (pixels,)

    def _decode(self) -> np.ndarray:
        with _naming_failures(self.path), Image.open(self.path) as image:
            if image.mode[0] in "IF":
                raise InputError(
                    f"photo {self.path}: expected 8 bits a channel, found {image.mode}; convert it to 8 bits"
                )
            return np.asarray(image.convert("RGB"))


# Straightened photos, those used last. A photo is loaded several times in a run (engine, textures, report). At 20 Mpx
# straightening takes 1.7 s of CPU, decoding a JPEG 0.2 s and a PNG 0.6 s. So a cache on disk would save about a second a
# photo of runs that take minutes; who wants that converts the capture (`eigenfairing convert`).
_STRAIGHT: BoundedCache[FilePhoto] = BoundedCache(room=500_000_000)


@dataclass(frozen=True, eq=False)
class ResizedPhoto:
    """Another photo at another size (width, height), its outer borders unmoved; what is finer than its pixels is averaged."""

    whole: Photo
    size: tuple[int, int]

    def load(self) -> np.ndarray:
        return cv2.resize(self.whole.load(), self.size, interpolation=cv2.INTER_AREA)


@dataclass(frozen=True, eq=False)
class Mask:
    """An image of the photo's size: what is black (0) does not count, as in COLMAP.

    Attributes:
        lens: what bent the photo, and so the mask; None for a pinhole camera.
        resized: (width, height) that photo and mask are shown at; None for the file's.
    """

    path: Path
    lens: Lens | None = None
    resized: tuple[int, int] | None = None

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels, without decoding the mask."""
        return self.resized or FilePhoto(self.path).size

    def load(self) -> np.ndarray:
        """(height, width) bool: True where the photo counts."""
        with _naming_failures(self.path), Image.open(self.path) as image:
            counts = (np.asarray(image.convert("L")) > 0).astype(np.uint8)
        if self.lens is not None:
            counts = self.lens.undistort_mask(counts)
        if self.resized is not None:  # a pixel counts if all of it does
            return cv2.resize(counts.astype(np.float32), self.resized, interpolation=cv2.INTER_AREA) > 1 - 1e-4
        return counts > 0


@contextmanager
def _naming_failures(path: Path) -> Iterator[None]:
    """Whatever Pillow raises becomes one line about this photo."""
    try:
        yield
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"photo {path}: expected an image file, found none; check the image folder") from None
    except PermissionError:
        raise InputError(f"photo {path}: cannot be read (permission denied); make it readable") from None
    except UnidentifiedImageError:
        raise InputError(f"photo {path}: is not an image file (or a damaged one); replace or remove it") from None
    except (OSError, ValueError, SyntaxError, EOFError, struct.error, Image.DecompressionBombError) as error:
        raise InputError(f"photo {path}: cannot be decoded ({error}); replace or remove it") from None

"""Photos and masks, decoded on demand."""

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
from fairing.util.guards import check_regular_file


class Photo(Protocol):
    """Source of a view's pixels."""

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
    """A photo file; `load` keeps decoded photos in a bounded cache.

    Attributes:
        lens: the distortion of the photo, which `load` removes; None for a pinhole camera.
    """

    path: Path
    lens: Lens | None = None

    @property
    def size(self) -> tuple[int, int]:
        with _naming_failures(self.path), Image.open(self.path) as image:
            return image.size

    def load(self) -> np.ndarray:
        return _LOADED.get(self, self._loaded)[0]

    def _loaded(self) -> tuple[np.ndarray]:
        pixels = self._decode()
        if self.lens is not None:
            pixels = self.lens.undistort_photo(pixels)
        pixels.setflags(write=False)
        return (pixels,)

    def _decode(self) -> np.ndarray:
        with _naming_failures(self.path), Image.open(self.path) as image:
            if image.mode[0] in "IF":
                raise InputError(
                    f"photo {self.path}: expected 8 bits a channel, found {image.mode}; convert it to 8 bits"
                )
            return np.asarray(image.convert("RGB"))


LOADED_BYTES = 500_000_000
"""Decoded photo files kept in memory."""
# The most recently used photos: a photo is loaded several times in a run (engine, image edges, textures, report).
# There is no cache on disk; `eigenfairing convert` writes undistorted photos (ledger: cache of undistorted photos).
_LOADED: BoundedCache[FilePhoto] = BoundedCache(max_bytes=LOADED_BYTES)


@dataclass(frozen=True, eq=False)
class ResizedPhoto:
    """Another photo resampled by area averaging to another size (width, height) in pixels, with the same outer borders."""

    whole: Photo
    size: tuple[int, int]

    def load(self) -> np.ndarray:
        return cv2.resize(self.whole.load(), self.size, interpolation=cv2.INTER_AREA)


@dataclass(frozen=True, eq=False)
class Mask:
    """An image of the photo's size: black pixels (0) are ignored, as in COLMAP.

    Attributes:
        lens: the distortion of the photo and the mask; None for a pinhole camera.
        resized: (width, height) in pixels that photo and mask are used at; None for the file's.
    """

    path: Path
    lens: Lens | None = None
    resized: tuple[int, int] | None = None

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels, without decoding the mask."""
        return self.resized or FilePhoto(self.path).size

    def load(self) -> np.ndarray:
        """(height, width) bool: True where the photo is used."""
        with _naming_failures(self.path), Image.open(self.path) as image:
            counts = (np.asarray(image.convert("L")) > 0).astype(np.uint8)
        if self.lens is not None:
            counts = self.lens.undistort_mask(counts)
        if self.resized is not None:  # a pixel is used if all of its area is
            return cv2.resize(counts.astype(np.float32), self.resized, interpolation=cv2.INTER_AREA) > 1 - 1e-4
        return counts > 0


@contextmanager
def _naming_failures(path: Path) -> Iterator[None]:
    """Raises every failure of Pillow as InputError about this photo; refuses pipes and devices."""
    check_regular_file(path, "an image file")
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
    except Exception as error:  # Pillow's decoders raise whatever the damaged bytes make their parsers raise
        reason = str(error) or type(error).__name__
        raise InputError(f"photo {path}: cannot be decoded ({reason}); replace or remove it") from None

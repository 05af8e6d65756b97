"""Photographs, decoded only when somebody looks at them."""

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from PIL import Image, UnidentifiedImageError

from fairing.errors import InputError
from fairing.lens import Lens


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
        lens: what bent the photo, or None for a pinhole camera. `load` straightens it; its maps are not kept.
    """

    path: Path
    lens: Lens | None = None

    @property
    def size(self) -> tuple[int, int]:
        with _naming_failures(self.path), Image.open(self.path) as image:
            return image.size

    def load(self) -> np.ndarray:
        with _naming_failures(self.path), Image.open(self.path) as image:
            if image.mode[0] in "IF":
                raise InputError(
                    f"photo {self.path}: expected 8 bits a channel, found {image.mode}; convert it to 8 bits"
                )
            pixels = np.asarray(image.convert("RGB"))
        return pixels if self.lens is None else self.lens.undistort_photo(pixels)


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

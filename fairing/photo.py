"""Photographs, decoded only when somebody looks at them."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
from PIL import Image

from fairing.errors import InputError


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
        undistortion: two (height, width) float32 maps for `cv2.remap`, pixels, when the lens is not a pinhole.
    """

    path: Path
    undistortion: tuple[np.ndarray, np.ndarray] | None = field(default=None, repr=False)

    @property
    def size(self) -> tuple[int, int]:
        try:
            with Image.open(self.path) as image:
                return image.size
        except FileNotFoundError:
            raise InputError(f"photo {self.path}: expected an image file, found none; check the image folder") from None
        except OSError as error:
            raise InputError(f"photo {self.path}: cannot be read as an image ({error}); replace or remove it") from None

    def load(self) -> np.ndarray:
        try:
            with Image.open(self.path) as image:
                pixels = np.asarray(image.convert("RGB"))
        except (OSError, ValueError, SyntaxError) as error:
            raise InputError(f"photo {self.path}: cannot be decoded ({error}); replace or remove it") from None
        if self.undistortion is not None:
            pixels = cv2.remap(pixels, *self.undistortion, cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
        return pixels

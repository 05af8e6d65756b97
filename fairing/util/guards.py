"""Guards at the entrances for files: regular files, names that can be written, plausible numbers."""

import stat
from pathlib import Path

import numpy as np

from fairing.errors import InputError

LARGEST_COORDINATE = 1e100
"""World units or pixels: beyond it products of three coordinates overflow."""
LARGEST_SIDE = 1_000_000
"""Pixels: width or height of a photo."""
FOCAL_RANGE = (0.01, 1e7)
"""Image widths: shortest and longest plausible focal length."""


def check_regular_file(path: Path, expected: str) -> None:
    """Refuse pipes, devices and sockets, which may block forever or never end. A missing file is accepted.

    Raises:
        InputError: `path` is neither a regular file nor a folder.
    """
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):  # opening the file reports the reason
        return
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise InputError(f"{path}: expected {expected}, found a pipe, device or socket; give a regular file")


def check_name(name: str, what: str) -> None:
    """Refuse names that no file can have and no UTF-8 text can hold.

    Args:
        what: the item for the message, such as "photo".

    Raises:
        InputError: the name holds a NUL or is not valid Unicode.
    """
    if "\0" in name:
        raise InputError(f"{what} {name!r}: expected a name without NUL characters; rename it")
    try:
        name.encode()
    except UnicodeEncodeError:
        raise InputError(f"{what} {name!a}: expected a name in valid UTF-8; rename the file") from None


def check_coordinates(values: np.ndarray, what: str) -> None:
    """Refuse coordinates of implausible size, whose products would overflow.

    Args:
        values: float array of any shape, world units or pixels.
        what: the item for the message, such as "mesh".

    Raises:
        InputError: a value is not finite or exceeds `LARGEST_COORDINATE` in size.
    """
    if not np.isfinite(values).all():
        raise InputError(f"{what}: expected finite coordinates, found NaN or infinity")
    largest = float(np.abs(values).max(initial=0))
    if largest > LARGEST_COORDINATE:
        raise InputError(
            f"{what}: expected coordinates of at most {LARGEST_COORDINATE:g} in size, found {largest:g}; "
            "check the file's numbers or change the unit"
        )


def check_size(width: int, height: int, what: str) -> None:
    """Refuse photo sizes that are not positive or beyond any photo.

    Raises:
        InputError: a side is not within 1 to `LARGEST_SIDE` pixels.
    """
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        found = "x".join(
            str(side) if abs(side) < 10**18 else f"{float(str(side)[:300]):.3g}..." for side in (width, height)
        )
        raise InputError(f"{what}: expected a photo size of 1 to {LARGEST_SIDE} px, found {found}")


def check_focal_lengths(focal_lengths: np.ndarray, width: int, height: int, what: str) -> None:
    """Refuse focal lengths that no camera has.

    Args:
        focal_lengths: (2,) float, pixels.
        width, height: size of the photo, pixels.

    Raises:
        InputError: a focal length is not within `FOCAL_RANGE`.
    """
    ratios = np.asarray(focal_lengths) / max(width, height)
    low, high = FOCAL_RANGE
    if not ((ratios >= low) & (ratios <= high)).all():
        found = ", ".join(f"{focal:g}" for focal in np.asarray(focal_lengths).tolist())
        raise InputError(
            f"{what}: expected focal lengths of {low:g} to {high:g} image widths ({max(width, height)} px), "
            f"found {found} px; check the unit of the focal length"
        )

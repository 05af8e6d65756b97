"""The result of every scene reader, and helpers that the readers share."""

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from fairing.errors import InputError
from fairing.image_file import PHOTO_SUFFIXES as PHOTO_SUFFIXES
from fairing.placement.frames import MeshFrame
from fairing.scene import SparsePoints, View
from fairing.util.guards import check_regular_file


@dataclass(frozen=True, eq=False)
class MissingPhoto:
    """The photo of a camera that was found nowhere: the view can only be left out.

    Attributes:
        size: (width, height) in pixels, as calibrated.
        error: raised where the photo is needed.
    """

    size: tuple[int, int]
    error: InputError

    def load(self) -> np.ndarray:
        raise self.error

    def full_depth(self) -> np.ndarray:
        raise self.error


class Capture(NamedTuple):
    """Calibrated photos as a reader returns them.

    Attributes:
        mesh: the mesh file the format itself names, or None.
        frames: frames that its files name beside the cameras' world, in which a mesh may be.
        sizes_from_photos: whether the format states no sizes, so that the cameras have those of the photo files.
    """

    views: tuple[View, ...]
    sparse_points: SparsePoints | None = None
    warnings: tuple[str, ...] = ()
    mesh: Path | None = None
    frames: tuple[MeshFrame, ...] = ()
    sizes_from_photos: bool = False


class Reader(Protocol):
    """A scene format. Each is a module with these names."""

    @property
    def NAME(self) -> str:
        """The format's name for `--format`, one of `SceneFormat` or a package's own."""
        ...

    @property
    def FORMAT(self) -> str:
        """One line for the list of supported formats."""
        ...

    def recognises(self, path: Path) -> bool:
        """Whether the folder or file is in this format, judged by content without reading all of it.

        Raises:
            InputError: it holds several models of this format.
        """
        ...

    def read(self, path: Path) -> Capture:
        """The photos and cameras of a folder or file that `recognises` accepted."""
        ...


@contextmanager
def naming(item: object) -> Iterator[None]:
    """Prefixes an InputError raised inside with the item's name."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{item}: {error}") from None


@contextmanager
def reading(path: Path, expected: str) -> Iterator[None]:
    """Raises failures of the file system as InputError about this file; refuses pipes and devices."""
    check_regular_file(path, expected)
    try:
        yield
    except FileNotFoundError:
        raise InputError(f"{path}: expected {expected}, found no such file") from None
    except OSError as error:
        raise InputError(f"{path}: expected {expected}, cannot be read ({error.strerror or error})") from None
    except ValueError as error:  # a NUL in the path
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: expected {expected}, cannot be read ({error})") from None


def read_text(path: Path, expected: str) -> str:
    """The text of a UTF-8 file.

    Raises:
        InputError: it cannot be read or is not UTF-8.
    """
    with reading(path, expected):
        data = path.read_bytes()
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(
            f"{path}: line {line}: expected {expected} in UTF-8, found byte {data[error.start]:#04x}"
        ) from None


def files_below(folder: Path, suffixes: frozenset[str]) -> list[Path]:
    """All files in the folder and its sub-folders with one of the suffixes (lower case), sorted."""
    return sorted(
        Path(parent, name)
        for parent, _, names in os.walk(folder)
        for name in names
        if Path(name).suffix.lower() in suffixes
    )


def files_in(folder: Path, suffixes: frozenset[str]) -> list[Path]:
    """All files directly in the folder with one of the suffixes (lower case), sorted; none if there is no folder."""
    if not folder.is_dir():
        return []
    with reading(folder, "a folder"):
        return sorted(path for path in folder.iterdir() if path.suffix.lower() in suffixes and path.is_file())


def listed(items: Iterable[object], limit: int = 6) -> str:
    """`a, b, c and 12 more`, for messages."""
    names = [str(item) for item in items]
    rest = len(names) - limit
    return ", ".join(names) if rest <= 0 else f"{', '.join(names[:limit])} and {rest} more"

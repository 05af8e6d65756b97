"""Photo files that camera files refer to, often by a path on another machine."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.capture import PHOTO_SUFFIXES, files_in, listed
from fairing.photo import FilePhoto
from fairing.util.guards import LARGEST_SIDE

PHOTO_FOLDERS = ("images", "photos")
"""Folders beside the cameras in which photos are found."""


@dataclass(frozen=True)
class MissingFile:
    """A photo that was not found; it can only be left out.

    Attributes:
        name: of its view.
        error: the line that explains it.
    """

    name: str
    error: InputError


def find_photo(written: str, folders: Iterable[Path]) -> Path | MissingFile:
    """The photo file that a camera file refers to, possibly by a path on another machine.

    Args:
        written: the path in the file: absolute or relative to one of the folders, with slashes or backslashes.
        folders: folders to search, together with their `images/` and `photos/`; a file of the same name there is
            accepted.
    """
    name = written.replace("\\", "/")
    inside = searched_folders(folders)
    candidates = [place / name for place in inside] + [place / name.rsplit("/", 1)[-1] for place in inside]
    for candidate in candidates:
        if is_file(candidate):
            return Path(os.path.normpath(candidate))
    return missing_file(written, inside)


class LabelledPhotos:
    """Photos by labels: file names with or without their endings, in some folders, their `images/` and `photos/`."""

    def __init__(self, folders: Iterable[Path]) -> None:
        self._folders = list(folders)

    def find(self, label: str) -> Path | MissingFile:
        """The photo of a label.

        Raises:
            InputError: several photos have that name without their endings.
        """
        found = find_photo(label, self._folders)
        if isinstance(found, Path):
            return found
        same = self._by_stem.get(label, [])
        if len(same) > 1:
            raise InputError(
                f"photo {label}: expected one of this name, found {listed(p.name for p in same)}; remove one"
            )
        return same[0] if same else found

    @cached_property
    def _by_stem(self) -> dict[str, list[Path]]:
        """The photos of the first folder that holds one of that name, by their names without endings."""
        by_stem: dict[str, list[Path]] = {}
        for folder in searched_folders(self._folders):
            found: dict[str, list[Path]] = {}
            for path in files_in(folder, PHOTO_SUFFIXES):
                found.setdefault(path.stem, []).append(Path(os.path.normpath(path)))
            by_stem = found | by_stem
        return by_stem


def searched_folders(folders: Iterable[Path]) -> list[Path]:
    """Folders in which photos are looked for: each of those given, its `images/` and its `photos/`."""
    return [place for folder in dict.fromkeys(folders) for place in (folder, *(folder / sub for sub in PHOTO_FOLDERS))]


def missing_file(written: str, searched: Iterable[Path], name: str | None = None) -> MissingFile:
    """The photo of this path, found in none of the folders.

    Args:
        name: of its view; by default the file name.
    """
    name = name or written.replace("\\", "/").rsplit("/", 1)[-1]
    return MissingFile(
        name,
        InputError(
            f"photo {written}: expected an image file, found none there nor in {listed(searched)}; put it there, or "
            f"leave it out with --leave-out {name}"
        ),
    )


def photo_size(path: Path | MissingFile, focal_length: float) -> tuple[int, int]:
    """(width, height) in pixels, for formats that do not state it; of a missing photo any that suits its focal length."""
    if isinstance(path, MissingFile):
        side = int(np.clip(focal_length, 1, LARGEST_SIDE)) if np.isfinite(focal_length) else 1
        return side, side
    return FilePhoto(path).size


def is_file(path: Path) -> bool:
    """Whether there is such a file; no error for a path that no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name too long, or with a NUL
        return False

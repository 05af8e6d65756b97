"""Plain projection matrices: for each photo a text file of the same stem with its 3x4 matrix.

Photos lie in the folder or in `images/`; matrices in the folder, in `cameras/` or beside the photos, as `0001.txt` or
`0001.P`: twelve numbers, row by row, separated by white space; lines that begin with # are ignored. A matrix maps
world points to pixels of the undistorted photo, pixel centres at integers (the top-left pixel's centre is (0, 0)).
"""

from pathlib import Path

import numpy as np

from fairing.camera import Camera
from fairing.errors import InputError
from fairing.image_kinds import OTHER_SUFFIXES
from fairing.io.capture import PHOTO_SUFFIXES, Capture, files_in, listed, naming, read_text
from fairing.photo import FilePhoto
from fairing.scene import View

NAME = "matrices"
FORMAT = "plain matrices (for each photo a text file of 12 numbers with the same stem, beside it or in cameras/)"

_SUFFIXES = frozenset({".txt", ".p"})
_LARGEST_FILE = 4096
"""Bytes of the largest file examined for a matrix, so that recognition does not read point lists."""


def recognises(path: Path) -> bool:
    stems = {photo.stem for photo in _photos(path)}
    return any(matrix.stem in stems and _looks_like_matrix(matrix) for matrix in _matrices(path))


def read(path: Path) -> Capture:
    photos = _by_stem(_photos(path))
    matrices = _by_stem([matrix for matrix in _matrices(path) if matrix.stem in photos or _looks_like_matrix(matrix)])
    views = []
    for stem, matrix in matrices.items():
        if stem not in photos:
            raise InputError(f"{matrix}: expected a photo of the same stem, found none; add it or remove the matrix")
        with naming(matrix):
            P = _read_matrix(matrix)
            photo = FilePhoto(photos[stem])
            views.append(View(photos[stem].name, Camera(P, *photo.size), photo))
    left_out = [photo.name for stem, photo in photos.items() if stem not in matrices]
    warnings = (
        (f"photos left out because they have no matrix: {len(left_out)} ({listed(left_out)})",) if left_out else ()
    )
    return Capture(tuple(views), warnings=warnings, sizes_from_photos=True)


def _photos(path: Path) -> list[Path]:
    folders = (path, path / "images")
    return next(
        (
            found
            for suffixes in (PHOTO_SUFFIXES, OTHER_SUFFIXES)
            for folder in folders
            if (found := files_in(folder, suffixes))
        ),
        [],
    )


def _matrices(path: Path) -> list[Path]:
    return [file for folder in (path, path / "cameras", path / "images") for file in files_in(folder, _SUFFIXES)]


def _by_stem(files: list[Path]) -> dict[str, Path]:
    by_stem: dict[str, Path] = {}
    for file in files:
        if file.stem in by_stem:
            raise InputError(f"{file}: expected one file of this stem, found {by_stem[file.stem]} too; remove one")
        by_stem[file.stem] = file
    return by_stem


def _looks_like_matrix(file: Path) -> bool:
    if file.stat().st_size > _LARGEST_FILE:
        return False
    try:
        _read_matrix(file)
    except InputError:
        return False
    return True


def _read_matrix(file: Path) -> np.ndarray:
    """(3, 4) float, pixels from world units; it may be infinite, which `Camera` refuses."""
    lines = read_text(file, "a 3x4 matrix").splitlines()
    fields = [field for line in lines if not line.startswith("#") for field in line.split()]
    try:
        numbers = [float(field) for field in fields]
    except ValueError:
        raise InputError(f"expected 12 numbers, found {listed(fields, 3)}") from None
    if len(numbers) != 12:
        raise InputError(f"expected 12 numbers, found {len(numbers)}")
    return np.array(numbers).reshape(3, 4)

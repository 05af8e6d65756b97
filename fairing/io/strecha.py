"""Strecha et al., CVPR 2008 (fountain-P11, Herz-Jesu-P8, castle-P19, ...): for each photo a file `<photo>.camera`.

Its numbers: K, row by row; three of distortion, zero; R, row by row, whose columns are the camera's axes in the world
(world from camera); the centre C; width and height. P = K [R^T | -R^T C], pixel centres at integers. Photos lie beside
the files or in an `images/` there or one folder up.
"""

from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.calibrated import CalibratedPhoto, build_capture
from fairing.io.capture import Capture, files_in, naming
from fairing.io.find_photo import find_photo
from fairing.io.number_file import NumberFile
from fairing.io.poses import pose_of_center
from fairing.lens import Lens

NAME = "strecha"
FORMAT = "Strecha's cameras (for each photo a file <photo>.camera)"

_SUFFIXES = frozenset({".camera"})


def recognises(path: Path) -> bool:
    return bool(_files(path))


def read(path: Path) -> Capture:
    photos = [_photo(file) for file in _files(path)]
    with naming(path):
        return build_capture(photos)


def _files(path: Path) -> list[Path]:
    """The camera files of the folder; one of them stands for all."""
    if path.is_file():
        return files_in(path.parent, _SUFFIXES) if path.suffix == ".camera" else []
    return files_in(path, _SUFFIXES) or files_in(path / "images", _SUFFIXES)


def _photo(file: Path) -> CalibratedPhoto:
    numbers = NumberFile(file, "a camera of K, R, C and size")
    K = numbers.numbers(9, "K").reshape(3, 3)
    distortion = numbers.numbers(3, "three zeros")
    R = numbers.numbers(9, "R").reshape(3, 3).T
    C = numbers.numbers(3, "the camera's centre")
    width, height = numbers.whole("the width"), numbers.whole("the height")
    numbers.finish()
    with naming(file):
        if distortion.any():
            raise InputError(f"expected three zeros after K, found {distortion.tolist()}; undistort the photo first")
        if np.any(np.tril(K, -1)) or K[2, 2] != 1 or min(width, height) < 1:
            raise InputError(f"expected an upper triangular K and a size, found K {K.tolist()}, {width}x{height}")
        photo = find_photo(file.name.removesuffix(".camera"), [file.parent, file.parent.parent])
        return CalibratedPhoto(photo, Lens(K, np.zeros(0), width, height), R, pose_of_center(R, C))

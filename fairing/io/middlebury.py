"""Middlebury multi-view stereo: `<name>_par.txt`, one line per photo, beside the photos (or beside `images/`).

A line is `photo k11 k12 ... k33 r11 ... r33 t1 t2 t3`, and P = K [R | t]. "The image origin is top-left, x to the right,
y down" (vision.middlebury.edu/mview/data); pixel centres are assumed to lie at integers.
"""

from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.calibrated import CalibratedPhoto, build_capture
from fairing.io.capture import Capture, naming
from fairing.io.find_photo import find_photo, photo_size
from fairing.io.number_file import NumberFile
from fairing.lens import Lens

NAME = "middlebury"
FORMAT = "Middlebury parameters (*_par.txt)"


def recognises(path: Path) -> bool:
    return _file(path) is not None


def read(path: Path) -> Capture:
    file = _file(path)
    assert file is not None
    numbers = NumberFile(file, "the number of photos, then a line for each")
    photos = []
    for _ in range(numbers.whole("the number of photos")):
        name = numbers.word("the name of a photo")
        values = numbers.numbers(21, f"K, R and t of {name}")
        with naming(numbers.place):
            photo = find_photo(name, [file.parent])
            lens = _pinhole(values[:9].reshape(3, 3), photo_size(photo, values[0]))
        photos.append(CalibratedPhoto(photo, lens, values[9:18].reshape(3, 3), values[18:]))
    numbers.finish()
    with naming(file):
        return build_capture(photos)._replace(sizes_from_photos=True)


def _pinhole(K: np.ndarray, size: tuple[int, int]) -> Lens:
    if np.any(np.tril(K, -1)) or K[2, 2] == 0:
        raise InputError("expected an upper triangular K, found numbers below its diagonal or a zero at its end")
    with np.errstate(over="ignore"):  # `Lens` refuses infinity
        return Lens(K / K[2, 2], np.zeros(0), *size)


def _file(path: Path) -> Path | None:
    if path.is_file():
        return path if path.name.endswith("_par.txt") else None
    found = sorted(path.glob("*_par.txt")) if path.is_dir() else []
    if len(found) > 1:
        raise InputError(f"{path}: expected one *_par.txt, found {len(found)}; give the file instead of the folder")
    return found[0] if found else None

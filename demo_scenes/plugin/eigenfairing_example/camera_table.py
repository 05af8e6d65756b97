"""A format: `cameras.csv` with a line for each photo, its name and its projection matrix, row by row."""

from pathlib import Path

import numpy as np

from fairing.camera import Camera
from fairing.errors import InputError
from fairing.io.capture import Capture
from fairing.photo import FilePhoto
from fairing.scene import View

NAME = "camera-table"
FORMAT = "a camera table (cameras.csv: the photo's name and the twelve numbers of its matrix)"


def recognises(path: Path) -> bool:
    return (path / "cameras.csv").is_file()


def read(path: Path) -> Capture:
    views = []
    for line in (path / "cameras.csv").read_text(encoding="utf-8").splitlines():
        name, *numbers = line.split(",")
        if len(numbers) != 12:
            raise InputError(f"{path / 'cameras.csv'}: {name}: expected twelve numbers, found {len(numbers)}")
        photo = FilePhoto(path / name)
        views.append(View(name, Camera(np.array(numbers, dtype=float).reshape(3, 4), *photo.size), photo))
    return Capture(tuple(views))

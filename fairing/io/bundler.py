"""Bundler: `bundle.out` (version 0.3) with its list of photos.

The list is `<name>.list.txt`, `<name>.out.list.txt` or `list.txt`, beside the .out file or one folder up: one photo per
line, in the order of the cameras, optionally followed by a focal length. A camera is f k1 k2, R (row by row), t:
P = R X + t, p = -P / P_z, pixel = f (1 + k1 |p|^2 + k2 |p|^4) p. It looks along its negative z axis, y up, and pixels are
relative to the middle of the photo, y up. Cameras with f = 0 were not registered. Source: Bundler v0.4 user's manual,
section VI.
"""

import re
from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.calibrated import CalibratedPhoto, ObservedPoints, build_capture
from fairing.io.capture import Capture, files_in, listed, naming, read_text, reading
from fairing.io.find_photo import MissingFile, find_photo, photo_size
from fairing.io.number_file import NumberFile
from fairing.lens import Lens

NAME = "bundler"
FORMAT = "Bundler (bundle.out with list.txt), also of RealityScan"

_HEADER = b"# Bundle file v0.3"
_FLIP = np.diag([1.0, -1.0, -1.0])


def recognises(path: Path) -> bool:
    return _file(path) is not None


def read(path: Path) -> Capture:
    file = _file(path)
    assert file is not None
    list_file = _list_file(file)
    names = _listed_photos(list_file)
    numbers = NumberFile(file, "a Bundler reconstruction", skip_lines=1)
    n_cameras, n_points = numbers.whole("the number of cameras"), numbers.whole("the number of points")
    if n_cameras != len(names):
        raise InputError(f"{file}: expected {len(names)} cameras as {list_file} lists photos, found {n_cameras}")
    photos: list[CalibratedPhoto] = []
    photo_of_camera = np.full(n_cameras, -1)
    for i, name in enumerate(names):
        values = numbers.numbers(15, f"f k1 k2, R and t of camera {i}")
        if values[0] == 0:
            continue
        with naming(f"{file}: camera {i}"):
            photo_of_camera[i] = len(photos)
            photos.append(_photo(find_photo(name, [list_file.parent, file.parent]), values))
    points = _points(numbers, n_points, photo_of_camera, photos)
    missing = [name for name, photo in zip(names, photo_of_camera, strict=True) if photo < 0]
    warnings = (f"photos left out, not registered: {len(missing)} ({listed(missing)})",) if missing else ()
    with naming(file):
        return build_capture(photos, points, warnings)._replace(sizes_from_photos=True)


def _photo(path: Path | MissingFile, values: np.ndarray) -> CalibratedPhoto:
    f, k1, k2 = values[:3]
    width, height = photo_size(path, f)
    K = np.array([[f, 0, (width - 1) / 2], [0, f, (height - 1) / 2], [0, 0, 1]])
    R, t = values[3:12].reshape(3, 3), values[12:]
    return CalibratedPhoto(path, Lens(K, np.array([k1, k2]), width, height), _FLIP @ R, _FLIP @ t)


def _points(
    numbers: NumberFile, n_points: int, photo_of_camera: np.ndarray, photos: list[CalibratedPhoto]
) -> ObservedPoints:
    positions, colors, observations, pixels = [], [], [], []
    for point in range(n_points):
        what = f"position, color and observations of point {point}"
        positions.append(numbers.numbers(3, what))
        colors.append(numbers.numbers(3, what))
        for _ in range(numbers.whole(what)):
            camera = numbers.whole(what)
            _, x, y = numbers.numbers(3, what)
            if camera >= len(photo_of_camera):
                raise InputError(f"{numbers.place}: expected a camera below {len(photo_of_camera)}, found {camera}")
            photo = photo_of_camera[camera]
            if photo >= 0:
                lens = photos[photo].lens
                observations.append((point, photo))
                pixels.append((x + (lens.width - 1) / 2, (lens.height - 1) / 2 - y))
    return ObservedPoints(
        np.array(positions).reshape(-1, 3),
        np.clip(np.array(colors).reshape(-1, 3), 0, 255).astype(np.uint8),
        np.array(observations, dtype=np.int64).reshape(-1, 2),
        np.array(pixels).reshape(-1, 2),
    )


def _file(path: Path) -> Path | None:
    if path.is_file():
        return path if path.suffix == ".out" and _begins_right(path) else None
    for folder in (path, path / "bundle"):
        found = [file for file in files_in(folder, frozenset({".out"})) if _begins_right(file)]
        # Bundler also writes its intermediate states: bundle_001.out, ...
        final = [file for file in found if file.name == "bundle.out"] or found
        if len(final) > 1:
            raise InputError(f"{folder}: expected one Bundler file, found {listed(f.name for f in final)}; give one")
        if final:
            return final[0]
    return None


def _begins_right(file: Path) -> bool:
    with reading(file, "a Bundler reconstruction"), file.open("rb") as stream:
        return stream.read(len(_HEADER)) == _HEADER


def _list_file(file: Path) -> Path:
    stem = file.name.removesuffix(".out").removesuffix(".bundle")
    candidates = [
        folder / name
        for folder in (file.parent, file.parent.parent)
        for name in (f"{stem}.list.txt", f"{file.name}.list.txt", "list.txt")
    ]
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    raise InputError(f"{file}: expected the list of its photos, found none of {listed(candidates)}; put it there")


def _listed_photos(list_file: Path) -> list[str]:
    lines = [line.strip() for line in read_text(list_file, "a list of photos").splitlines()]
    return [re.sub(r"\s+\d+(\s+[-+.\deE]+)?$", "", line) for line in lines if line]

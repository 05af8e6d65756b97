"""RealityScan (RealityCapture): the table of internal and external camera parameters, `.csv`.

Columns by their names in the first line: `#name, x, y, alt, heading, pitch, roll, f`, and optionally `px, py, k1, k2, k3, k4,
t1, t2`. The camera's axes are x right, y up, z backwards; to the world they turn by Rz(-heading) Rx(pitch) Ry(roll), degrees.
The focal length is in millimetres of a film 36 mm wide; it and the principal point, from the middle of the photo, are
relative to the photo's larger side: f / 36 and px, py. The lens is Brown's, with OpenCV's p1 as t2 and p2 as t1.

Source: RealityScan's export templates and its article on camera math; the importers of nerfstudio, AliceVision and brush.
"""

import csv
import io
from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.calibrated import CalibratedPhoto, build_capture
from fairing.io.capture import Capture, files_in, listed, naming, read_text
from fairing.io.find_photo import LabelledPhotos, photo_size
from fairing.io.poses import pose_of_center
from fairing.lens import Lens

NAME = "realityscan"
FORMAT = "RealityScan / RealityCapture (internal/external camera parameters, .csv)"

_SUFFIXES = frozenset({".csv"})
_POSE = ("x", "y", "alt", "heading", "pitch", "roll", "f")
_LENS = ("px", "py", "k1", "k2", "k3", "k4", "t1", "t2")
_FILM = 36.0  # mm
_FLIP = np.diag([1.0, -1.0, -1.0])


def recognises(path: Path) -> bool:
    return _file(path) is not None


def read(path: Path) -> Capture:
    file = _file(path)
    assert file is not None
    lines = read_text(file, "camera parameters of RealityScan").splitlines()
    first = next(number for number, line in enumerate(lines) if _columns(line))
    columns = _columns(lines[first])
    assert columns is not None
    files, photos = LabelledPhotos([file.parent, file.parent.parent]), []
    with naming(file):
        for number, line in enumerate(lines[first + 1 :], start=first + 2):
            if not line.strip() or line.startswith("#"):
                continue
            with naming(f"line {number}"):
                photos.append(_photo(_row(line, columns), files))
        return build_capture(photos)._replace(sizes_from_photos=True)


def _file(path: Path) -> Path | None:
    found = [path] if path.is_file() and path.suffix.lower() in _SUFFIXES else files_in(path, _SUFFIXES)
    found = [file for file in found if _begins_right(file)]
    if len(found) > 1:
        raise InputError(
            f"{path}: expected one table of cameras, found {listed(f.name for f in found)}; give one of them"
        )
    return found[0] if found else None


def _begins_right(file: Path) -> bool:
    """Whether one of the first lines names the columns."""
    try:
        with file.open("rb") as stream:
            lines = stream.read(1 << 12).decode("utf-8-sig", errors="replace").splitlines()[:4]
    except OSError:
        return False
    return any(_columns(line) for line in lines)


def _columns(line: str) -> list[str] | None:
    """The names of the columns, or None if the line does not name them."""
    names = [name.strip().lstrip("#").lower() for name in line.split(",")]
    return names if {"name", *_POSE} <= set(names) else None


def _row(line: str, columns: list[str]) -> dict[str, str]:
    words = next(csv.reader(io.StringIO(line)))
    if len(words) != len(columns):
        raise InputError(f"expected {len(columns)} values, found {len(words)}")
    return dict(zip(columns, (word.strip() for word in words), strict=True))


def _photo(row: dict[str, str], files: LabelledPhotos) -> CalibratedPhoto:
    if not row["name"]:
        raise InputError("expected the name of a photo, found none")
    values = {name: _number(row, name) for name in _POSE}
    lens_values = {name: _number(row, name) if name in row else 0.0 for name in _LENS}
    found = files.find(row["name"])
    width, height = photo_size(found, 1.0)
    side = max(width, height)
    f = values["f"] / _FILM * side
    cx = lens_values["px"] * side + (width - 1) / 2
    cy = lens_values["py"] * side + (height - 1) / 2
    distortion = np.array([lens_values[name] for name in ("k1", "k2", "t2", "t1", "k3", "k4")])
    lens = Lens(np.array([[f, 0, cx], [0, f, cy], [0, 0, 1]]), distortion, width, height, "four radial")
    world_from_camera = _turn(2, -values["heading"]) @ _turn(0, values["pitch"]) @ _turn(1, values["roll"])
    R = (world_from_camera @ _FLIP).T
    return CalibratedPhoto(found, lens, R, pose_of_center(R, np.array([values["x"], values["y"], values["alt"]])))


def _number(row: dict[str, str], name: str) -> float:
    try:
        value = float(row[name])
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise InputError(f"{name}: expected a finite number, found {row[name][:40]!r}")
    return value


def _turn(axis: int, degrees: float) -> np.ndarray:
    """(3, 3) rotation about a coordinate axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[i, i], R[i, j], R[j, i], R[j, j] = c, -s, s, c
    return R

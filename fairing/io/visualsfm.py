"""VisualSFM: `.nvm` (NVM_V3) with cameras, points and measurements.

The header `NVM_V3` may be followed by `FixedK fx cx fy cy r`, the calibration of all photos. A model is the number of its
cameras, a line `file, focal length, quaternion w x y z, centre, r1, 0` for each, the number of its points, and a line `X Y Z
R G B, number of measurements, (camera, feature, x, y) ...` for each; a model of no cameras ends the list. The model with
most cameras is read. Spaces in file names are written as quotation marks.

World to camera: x right, y down, z forward. Measurements are pixels from the principal point, which is the middle of the
photo without `FixedK`. The lens is "measured radial" (`fairing.distortion`): VisualSFM corrects the measurements, not the
projections, and stores r1 for measurements in focal lengths. Source: VisualSFM's documentation of NVM; the multicore
bundle adjustment's LoadNVM and SetNormalizedMeasurementDistortion; COLMAP's ExportNVM, which writes the sign this implies.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.calibrated import CalibratedPhoto, ObservedPoints, build_capture
from fairing.io.capture import Capture, files_in, listed, naming, read_text, reading
from fairing.io.find_photo import MissingFile, find_photo, photo_size
from fairing.io.poses import pose_of_center, rotation_of_quaternion
from fairing.lens import Lens

NAME = "visualsfm"
FORMAT = "VisualSFM (.nvm)"

_HEADER = "NVM_V3"
_SUFFIXES = frozenset({".nvm"})
_CAMERA = "FILE FOCAL QW QX QY QZ CX CY CZ R1 0"
_POINT = "X Y Z R G B N and N times CAMERA FEATURE X Y"


@dataclass(frozen=True)
class _FixedK:
    """The calibration of all photos; pixel centres at integers."""

    fx: float
    cx: float
    fy: float
    cy: float
    r1: float


@dataclass(frozen=True)
class _Model:
    """Cameras as names and numbers (10,), and its points with their places in the file."""

    names: list[str]
    cameras: list[np.ndarray]
    points: list[tuple[str, list[float]]]


def recognises(path: Path) -> bool:
    return _file(path) is not None


def read(path: Path) -> Capture:
    file = _file(path)
    assert file is not None
    lines = _Lines(file)
    fixed = _fixed_calibration(lines.line(_HEADER), lines.place)
    models = list(_models(lines))
    if not models:
        raise InputError(f"{file}: expected a model with cameras, found none; run VisualSFM's reconstruction first")
    chosen = max(models, key=lambda model: len(model.names))
    others = [len(model.names) for model in models if model is not chosen]
    warnings = [f"further models are not read: {len(others)} ({listed(others)} photos)"] if others else []
    photos = []
    with naming(file):
        for name, numbers in zip(chosen.names, chosen.cameras, strict=True):
            with naming(f"camera {name}"):
                photos.append(_photo(_find(name, file.parent), numbers, fixed))
    points = _points(chosen, photos)
    if points is not None and fixed is not None and abs(fixed.fx / fixed.fy - 1) > 1e-6:
        warnings.append("observations are not read: their unit is not documented where FixedK has two focal lengths")
        points = ObservedPoints(points.positions, points.colors, points.observations[:0], points.pixels[:0])
    with naming(file):
        return build_capture(photos, points, tuple(warnings))._replace(sizes_from_photos=True)


def _file(path: Path) -> Path | None:
    if path.is_file():
        return path if path.suffix.lower() == ".nvm" and _begins_right(path) else None
    found = [file for file in files_in(path, _SUFFIXES) if _begins_right(file)]
    if len(found) > 1:
        raise InputError(f"{path}: expected one .nvm file, found {listed(f.name for f in found)}; give one of them")
    return found[0] if found else None


def _begins_right(file: Path) -> bool:
    with reading(file, "a VisualSFM model"), file.open("rb") as stream:
        return stream.read(len(_HEADER)) == _HEADER.encode()


class _Lines:
    """The lines of a file that are not empty, in order."""

    def __init__(self, file: Path) -> None:
        self._file = file
        lines = enumerate(read_text(file, "a VisualSFM model").splitlines(), start=1)
        self._lines = [(number, line) for number, line in lines if line.strip()]
        self._next = 0

    @property
    def place(self) -> str:
        """The file and the line read last, for messages."""
        return f"{self._file}: line {self._lines[self._next - 1][0]}"

    @property
    def at_end(self) -> bool:
        return self._next == len(self._lines)

    def line(self, what: str) -> str:
        if self.at_end:
            raise InputError(f"{self._file}: expected {what}, found the end of the file; it is incomplete")
        self._next += 1
        return self._lines[self._next - 1][1]

    def count(self, what: str) -> int:
        """A line of one whole number."""
        line = self.line(what).strip()
        if not line.isascii() or not line.isdigit() or len(line) > 18:
            raise InputError(f"{self.place}: expected {what}, found {line[:40]!r}")
        return int(line)


def _fixed_calibration(header: str, where: str) -> _FixedK | None:
    word, *rest = header.split()
    if word != _HEADER:
        raise InputError(f"{where}: expected {_HEADER}, found {word[:20]}; export the model as NVM_V3")
    if not rest:
        return None
    try:
        numbers = [float(word) for word in rest[1:]]
    except ValueError:
        numbers = []
    if (
        rest[0] != "FixedK"
        or len(numbers) not in (4, 5)
        or not np.isfinite(numbers).all()
        or min(numbers[0], numbers[2]) <= 0
    ):
        raise InputError(f"{where}: expected FixedK fx cx fy cy r after {_HEADER}, found {' '.join(rest)[:60]!r}")
    fx, cx, fy, cy, *r1 = numbers
    return _FixedK(fx, cx - 0.5, fy, cy - 0.5, r1[0] if r1 else 0.0)


def _models(lines: _Lines) -> Iterator[_Model]:
    """The models of a file up to the end of their list."""
    while n_cameras := 0 if lines.at_end else lines.count("the number of cameras"):
        names, cameras, points = [], [], []
        for _ in range(n_cameras):
            name, *words = lines.line(_CAMERA).rsplit(maxsplit=10)
            names.append(name.strip())
            cameras.append(np.array(_numbers(words, lines.place, _CAMERA, 10)))
        for _ in range(lines.count("the number of points")):
            words = lines.line(_POINT).split()
            points.append((lines.place, _numbers(words, lines.place, _POINT)))
        yield _Model(names, cameras, points)


def _numbers(words: list[str], where: str, expected: str, length: int | None = None) -> list[float]:
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if not numbers or (length is not None and len(numbers) != length) or not np.isfinite(numbers).all():
        raise InputError(f"{where}: expected {expected} in finite numbers, found {' '.join(words)[:60]!r}")
    return numbers


def _find(name: str, folder: Path) -> Path | MissingFile:
    written = find_photo(name, [folder])
    with_spaces = find_photo(name.strip('"').replace('"', " "), [folder]) if '"' in name else written
    return with_spaces if isinstance(written, MissingFile) else written


def _photo(found: Path | MissingFile, numbers: np.ndarray, fixed: _FixedK | None) -> CalibratedPhoto:
    focal, quaternion, center, r1, last = numbers[0], numbers[1:5], numbers[5:8], numbers[8], numbers[9]
    if last != 0:
        raise InputError(f"expected 0 as the last number, found {last:g}")
    width, height = photo_size(found, focal)
    fx = fy = focal
    cx, cy = (width - 1) / 2, (height - 1) / 2
    if fixed is not None:
        fx, fy, cx, cy = fixed.fx, fixed.fy, fixed.cx, fixed.cy
        r1 = r1 or fixed.r1
        if not (width / 4 < cx < 3 * width / 4 and height / 4 < cy < 3 * height / 4):
            raise InputError(
                f"expected the principal point of FixedK near the middle of the {width}x{height} photo, found ({cx:g}, "
                f"{cy:g}); give it in pixels from the corner"
            )
    lens = Lens(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), np.array([r1]), width, height, "measured radial")
    R = rotation_of_quaternion(quaternion)
    return CalibratedPhoto(found, lens, R, pose_of_center(R, center))


def _points(model: _Model, photos: list[CalibratedPhoto]) -> ObservedPoints | None:
    if not model.points:
        return None
    positions, colors, observations, pixels = [], [], [], []
    for point, (place, numbers) in enumerate(model.points):
        if len(numbers) < 7 or len(numbers) != 7 + 4 * numbers[6]:
            raise InputError(f"{place}: expected {_POINT}, found {len(numbers)} numbers")
        positions.append(numbers[:3])
        colors.append(numbers[3:6])
        for camera, _, x, y in zip(*[iter(numbers[7:])] * 4, strict=True):
            if not (camera.is_integer() and 0 <= camera < len(photos)):
                raise InputError(f"{place}: expected a camera below {len(photos)}, found {camera:g}")
            center = photos[int(camera)].lens.K[:2, 2]
            observations.append((point, int(camera)))
            pixels.append((x + center[0], y + center[1]))
    return ObservedPoints(
        np.array(positions).reshape(-1, 3),
        np.clip(np.array(colors).reshape(-1, 3), 0, 255).astype(np.uint8),
        np.array(observations, dtype=np.int64).reshape(-1, 2),
        np.array(pixels).reshape(-1, 2),
    )

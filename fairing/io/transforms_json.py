"""nerfstudio, instant-ngp, Blender and NeRF: `transforms.json` with intrinsics and a camera-to-world matrix for each photo.

Axes of a camera are OpenGL's: x right, y up, z backwards. Pixels are COLMAP's: the centre of the top-left pixel is
(0.5, 0.5); without `cx`, `cy` the principal point is the photo's centre. Intrinsics of a frame take precedence over those
of the file. `mask_path` names a frame's mask, `ply_file_path` sparse points in the world of the cameras.

The world is the file's, after `applied_transform` and `applied_scale`; the frames before them are those a mesh may be in
(`Capture.frames`).

Lenses: the polynomial k1, k2, p1, p2, k3, with nerfstudio's k4 of r^8, and OPENCV_FISHEYE (k1 to k4). instant-ngp's other
lenses (ftheta, latlong, equirectangular, orthographic) and conventions (from_na, from_mitsuba) are refused by name.

Sources: nerfstudio's nerfstudio_dataparser.py and camera_utils.py, instant-ngp's nerf_loader.cu and colmap2nerf.py, the
NeRF paper's synthetic scenes (camera_angle_x only, photos without suffix).
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from fairing.distortion import MODELS
from fairing.errors import InputError
from fairing.io.calibrated import CalibratedPhoto, ObservedPoints, build_capture
from fairing.io.capture import PHOTO_SUFFIXES, Capture, files_in, listed, naming
from fairing.io.find_photo import MissingFile, find_photo, photo_size
from fairing.io.json_file import Item, holds, read_json
from fairing.io.poses import check_last_row, pose_of_center
from fairing.lens import Lens
from fairing.placement.frames import MeshFrame

NAME = "transforms.json"
FORMAT = "transforms.json (nerfstudio, instant-ngp, Blender, NeRF)"

_MODELS = ("PERSPECTIVE", "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE")
_FISHEYE = "OPENCV_FISHEYE"
# instant-ngp's keys that select another lens or other axes, whatever their value but false.
_REFUSED = ("ftheta_p0", "latlong", "equirectangular", "orthographic", "from_na", "from_mitsuba")
_OPENCV_FROM_OPENGL = np.array([1.0, -1.0, -1.0])
_MOST_SCALE, _MOST_ENTRY = (1e-9, 1e9), 1e12
"""Plausible factors and entries of `applied_transform` and `applied_scale`."""
_ROUNDING = 1e-4
"""Of the entries of `applied_transform`, which may be written with few digits."""
_SPLITS = ("transforms.json", "transforms_train.json")


def recognises(path: Path) -> bool:
    return _file(path) is not None


def read(path: Path) -> Capture:
    file = _file(path) or (path if path.is_file() else next(path / name for name in _SPLITS if (path / name).is_file()))
    content = read_json(file, "cameras")
    with naming(file):
        photos = [_photo(content, frame, file.parent) for frame in content["frames"]]
        capture = build_capture(photos, _points(content, file.parent), _other_splits(path, file))
        return capture._replace(frames=_frames(content, file.name))


def _file(path: Path) -> Path | None:
    if path.is_file():
        return path if holds(path, "frames", "transform_matrix") else None
    return next((path / name for name in _SPLITS if holds(path / name, "frames")), None)


def _other_splits(path: Path, file: Path) -> tuple[str, ...]:
    if file.name != "transforms_train.json" or path.is_file():
        return ()
    others = [p.name for p in files_in(path, frozenset({".json"})) if p.name.startswith("transforms_") and p != file]
    return (f"only {file.name} is read; left out: {listed(others)}",) if others else ()


def _frames(content: Item, name: str) -> tuple[MeshFrame, ...]:
    """The frames before `applied_transform` and `applied_scale`, x_file = scale (A x + b), and the ones after doing so again.

    Transforms that are no similarities, or implausible, name no frame.
    """
    scale = content["applied_scale"].number() if "applied_scale" in content else 1.0
    A, b = np.eye(3), np.zeros(3)
    if "applied_transform" in content:
        item = content["applied_transform"]
        has_last_row = isinstance(item.value, list) and len(item.value) == 4
        matrix = _transform(item) if has_last_row else item.numbers(3, 4)
        A, b = matrix[:3, :3], matrix[:3, 3]
    if not (_MOST_SCALE[0] <= abs(scale) <= _MOST_SCALE[1] and max(np.abs(A).max(), np.abs(b).max()) < _MOST_ENTRY):
        return ()
    size = np.cbrt(abs(np.linalg.det(A)))
    if size < _MOST_SCALE[0] or np.abs(A @ A.T / size**2 - np.eye(3)).max() > _ROUNDING:
        return ()
    both = MeshFrame(f"in the frame before `applied_transform` of {name}", scale * A, scale * b)
    if scale != 1:
        both = replace(both, name=f"in the frame before `applied_transform` and `applied_scale` of {name}")
    unscaled = MeshFrame(f"in the frame before `applied_scale` of {name}", scale * np.eye(3), np.zeros(3))
    again = replace(both.inverse, name=f"in the frame after `applied_transform` of {name}, applied twice")
    kinds = [both, *([unscaled] if scale != 1 else []), again]
    return tuple(kind for kind in kinds if not (np.array_equal(kind.linear, np.eye(3)) and not kind.shift.any()))


def _photo(content: Item, frame: Item, folder: Path) -> CalibratedPhoto:
    written = frame["file_path"].text()
    with naming(frame.where):
        path = _find(written, folder)
        lens = _lens(content, frame, path)
        mask = _mask(frame["mask_path"].text(), folder) if "mask_path" in frame else None
    world_from_camera = _transform(frame["transform_matrix"])
    R = (world_from_camera[:3, :3] * _OPENCV_FROM_OPENGL).T
    return CalibratedPhoto(path, lens, R, pose_of_center(R, world_from_camera[:3, 3]), mask)


def _transform(item: Item) -> np.ndarray:
    """(4, 4) float, whose last row may be omitted in the file."""
    if isinstance(item.value, list) and len(item.value) == 3:
        return np.vstack([item.numbers(3, 4), (0, 0, 0, 1)])
    matrix = item.numbers(4, 4)
    check_last_row(matrix, item.where)
    return matrix


def _find(written: str, folder: Path) -> Path | MissingFile:
    if Path(written).suffix.lower() in PHOTO_SUFFIXES:
        return find_photo(written, [folder])
    found = find_photo(f"{written}.png", [folder])  # the scenes of the NeRF paper omit the suffix
    return found if isinstance(found, Path) else find_photo(written, [folder])


def _mask(written: str, folder: Path) -> Path:
    found = find_photo(written, [folder])
    if isinstance(found, MissingFile):
        raise InputError(f"mask_path {written}: expected an image file, found none; put it there or remove the key")
    return found


def _points(content: Item, folder: Path) -> ObservedPoints | None:
    """The positions of `ply_file_path`; the file has no observations of them."""
    if "ply_file_path" not in content or content["ply_file_path"].value in (None, ""):
        return None
    from fairing.io.scan_file import read_points_of_scan  # imported on first use, with its libraries

    positions = read_points_of_scan(folder / content["ply_file_path"].text())
    return ObservedPoints(
        positions, np.full((len(positions), 3), 128, dtype=np.uint8), np.zeros((0, 2), dtype=np.int64), np.zeros((0, 2))
    )


def _lens(content: Item, frame: Item, path: Path | MissingFile) -> Lens:
    def given(key: str) -> float | None:
        for item in (frame, content):
            if key in item:
                return item[key].number()
        return None

    model = next((item["camera_model"].text() for item in (frame, content) if "camera_model" in item), "PERSPECTIVE")
    if _is_set(frame, "is_fisheye") or _is_set(content, "is_fisheye"):
        model = _FISHEYE
    model = next((key for key in _REFUSED for item in (frame, content) if _is_set(item, key, even_zero=True)), model)
    if model not in _MODELS:
        raise InputError(
            f"camera model {model} is not supported (expected {', '.join(_MODELS)}); undistort the photos first"
        )
    if beyond := [key for key in ("k5", "k6") if given(key)]:
        raise InputError(
            f"distortion {beyond[0]} is not supported (expected k1 to k4, p1, p2); undistort the photos first"
        )
    fx, fy = given("fl_x"), given("fl_y")
    width, height = (
        next((item[key].whole(lowest=1) for item in (frame, content) if key in item), size)
        for key, size in zip(("w", "h"), photo_size(path, fx or 1.0), strict=True)
    )
    fx, fy = (
        focal or _focal(given(angle), size) or _focal(_radians(given(degrees)), size)
        for focal, angle, degrees, size in (
            (fx, "camera_angle_x", "x_fov", width), (fy, "camera_angle_y", "y_fov", height)
        )
    )  # fmt: skip
    fx, fy = fx or fy, fy or fx
    if fx is None or fy is None:
        raise InputError("expected a focal length (fl_x, or camera_angle_x), found none")
    cx, cy = given("cx"), given("cy")
    K = np.array(
        [
            [fx, 0, (width / 2 if cx is None else cx) - 0.5],
            [0, fy, (height / 2 if cy is None else cy) - 0.5],
            [0, 0, 1],
        ]
    )
    distortion_model = "fisheye" if model == _FISHEYE else "four radial" if given("k4") else "polynomial"
    names = MODELS[distortion_model].names[:5] if distortion_model == "polynomial" else MODELS[distortion_model].names
    return Lens(K, np.array([given(name) or 0.0 for name in names]), width, height, distortion_model)


def _radians(degrees: float | None) -> float | None:
    return None if degrees is None else math.radians(degrees)


def _is_set(item: Item, key: str, even_zero: bool = False) -> bool:
    """Whether a key has a value that counts as true, or with `even_zero` any value but false and null."""
    if key not in item:
        return False
    value = item[key].value
    return value is not None and value is not False if even_zero else bool(value)


def _focal(angle: float | None, size: int) -> float | None:
    """Pixels, from the whole field of view in radians."""
    if angle is None:
        return None
    if not 0 < angle < math.pi:
        raise InputError(f"expected a field of view between 0 and pi radians, found {angle:g}")
    return size / 2 / math.tan(angle / 2)

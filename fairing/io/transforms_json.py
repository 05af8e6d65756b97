"""nerfstudio, instant-ngp and NeRF: `transforms.json` with intrinsics and a camera-to-world matrix for each photo.

Axes of a camera are OpenGL's: x right, y up, z backwards. Pixels are COLMAP's: the centre of the top-left pixel is
(0.5, 0.5); without `cx`, `cy` the principal point is the photo's centre. The world is the file's: `applied_transform`
and `applied_scale` are not inverted, so a mesh must be in the same world as the cameras. Intrinsics of a frame take
precedence over those of the file. `mask_path` names a frame's mask.

Sources: nerfstudio's nerfstudio_dataparser.py and camera_utils.py (radial distortion to k4 r^8, of which k1 to k3 are
supported), instant-ngp's colmap2nerf.py, the NeRF paper's synthetic scenes (camera_angle_x only, photos without suffix).
"""

import math
from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.calibrated import CalibratedPhoto, build_capture, find_photo, pose_of_center
from fairing.io.capture import PHOTO_SUFFIXES, Capture, files_in, listed, naming
from fairing.io.json_file import Item, holds, read_json
from fairing.lens import DISTORTION, Lens
from fairing.photo import FilePhoto

NAME = "transforms.json"
FORMAT = "transforms.json (nerfstudio, instant-ngp, NeRF)"

_MODELS = ("PERSPECTIVE", "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV")
_OPENCV_FROM_OPENGL = np.array([1.0, -1.0, -1.0])
_SPLITS = ("transforms.json", "transforms_train.json")


def recognises(path: Path) -> bool:
    return _file(path) is not None


def read(path: Path) -> Capture:
    file = _file(path) or (path if path.is_file() else next(path / name for name in _SPLITS if (path / name).is_file()))
    content = read_json(file, "cameras")
    with naming(file):
        photos = [_photo(content, frame, file.parent) for frame in content["frames"]]
        return build_capture(photos, warnings=_other_splits(path, file))


def _file(path: Path) -> Path | None:
    if path.is_file():
        return path if holds(path, "frames", "transform_matrix") else None
    return next((path / name for name in _SPLITS if holds(path / name, "frames")), None)


def _other_splits(path: Path, file: Path) -> tuple[str, ...]:
    if file.name != "transforms_train.json" or path.is_file():
        return ()
    others = [p.name for p in files_in(path, frozenset({".json"})) if p.name.startswith("transforms_") and p != file]
    return (f"only {file.name} is read; left out: {listed(others)}",) if others else ()


def _photo(content: Item, frame: Item, folder: Path) -> CalibratedPhoto:
    written = frame["file_path"].text()
    with naming(frame.where):
        path = _find(written, folder)
        lens = _lens(content, frame, path)
        mask = find_photo(frame["mask_path"].text(), [folder]) if "mask_path" in frame else None
    pose = frame["transform_matrix"]
    world_from_camera = pose.numbers(4, 4) if np.shape(pose.value)[:1] != (3,) else pose.numbers(3, 4)
    R = (world_from_camera[:3, :3] * _OPENCV_FROM_OPENGL).T
    return CalibratedPhoto(path, lens, R, pose_of_center(R, world_from_camera[:3, 3]), mask)


def _find(written: str, folder: Path) -> Path:
    if Path(written).suffix.lower() in PHOTO_SUFFIXES:
        return find_photo(written, [folder])
    try:  # the scenes of the NeRF paper omit the suffix
        return find_photo(f"{written}.png", [folder])
    except InputError:
        return find_photo(written, [folder])


def _lens(content: Item, frame: Item, path: Path) -> Lens:
    def given(key: str) -> float | None:
        for item in (frame, content):
            if key in item:
                return item[key].number()
        return None

    model = next((item["camera_model"].text() for item in (frame, content) if "camera_model" in item), "PERSPECTIVE")
    if _is_set(frame, "is_fisheye") or _is_set(content, "is_fisheye"):
        model = "OPENCV_FISHEYE"
    if model not in _MODELS:
        raise InputError(
            f"camera model {model} is not supported (expected {', '.join(_MODELS)}); undistort the photos first"
        )
    if given("k4"):
        raise InputError("distortion k4 is not supported (expected k1, k2, k3, p1, p2); undistort the photos first")
    width, height = (
        next((item[key].whole(lowest=1) for item in (frame, content) if key in item), size)
        for key, size in zip(("w", "h"), FilePhoto(path).size, strict=True)
    )
    fx, fy = (
        given(focal) or _focal(given(angle), size)
        for focal, angle, size in (("fl_x", "camera_angle_x", width), ("fl_y", "camera_angle_y", height))
    )
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
    distortion = np.array([given(name) or 0.0 for name in DISTORTION[:5]])
    return Lens(K, distortion, width, height)


def _is_set(item: Item, key: str) -> bool:
    return key in item and bool(item[key].value)


def _focal(angle: float | None, size: int) -> float | None:
    """Pixels, from the whole field of view in radians."""
    if angle is None:
        return None
    if not 0 < angle < math.pi:
        raise InputError(f"expected a field of view between 0 and pi radians, found {angle:g}")
    return size / 2 / math.tan(angle / 2)

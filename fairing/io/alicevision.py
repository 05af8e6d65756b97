"""Meshroom (AliceVision): `.sfm` and its .json with views, intrinsics, poses and landmarks; all numbers are strings.

World to camera: R (X - C); R is stored column by column. Pixel centres lie at integers. Since version 1.2.1 the principal
point is relative to the middle of the photo (width / 2, height / 2), before to its corner. The focal length is given in
pixels before 1.2.2, then in millimetres of a sensor `sensorWidth` wide; `pixelRatio` is fx / fy before 1.2.5 and fy / fx
since. Distortions: none, radialk1, radialk3, brown (k1, k2, k3, p1, p2) and fisheye4 (as OpenCV's), before 1.2.6 named by
the camera's type (pinhole, radial1, radial3, brown, fisheye4). An `undistortionType` is a second model (3DE) and refused.
Source: AliceVision's sfmDataIO/jsonIO.cpp and its compatibilityData.
"""

from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.calibrated import CalibratedPhoto, ObservedPoints, build_capture
from fairing.io.capture import Capture, files_in, listed, naming
from fairing.io.find_photo import find_photo
from fairing.io.json_file import Item, holds, read_json
from fairing.io.poses import pose_of_center
from fairing.lens import Lens

NAME = "meshroom"
FORMAT = "Meshroom / AliceVision (.sfm)"

# The model of each distortion, and the indices of its parameters, by the name of the distortion and of the old camera type.
_DISTORTIONS: dict[str, tuple[str, tuple[int, ...]]] = {
    "none": ("polynomial", ()),
    "pinhole": ("polynomial", ()),
    "radialk1": ("polynomial", (0,)),
    "radial1": ("polynomial", (0,)),
    "radialk3": ("polynomial", (0, 1, 4)),
    "radial3": ("polynomial", (0, 1, 4)),
    "brown": ("polynomial", (0, 1, 4, 2, 3)),
    "fisheye4": ("fisheye", (0, 1, 2, 3)),
}

_LARGEST_VERSION = 1e6


def recognises(path: Path) -> bool:
    return _file(path) is not None


def read(path: Path) -> Capture:
    file = _file(path)
    assert file is not None
    content = read_json(file, "a Meshroom scene", quoted=True)
    with naming(file):
        version = _version(content["version"])
        lenses = {item["intrinsicId"].whole(): _lens(item, version) for item in _items(content, "intrinsics")}
        poses = {item["poseId"].whole(): item["pose"]["transform"] for item in _items(content, "poses")}
        if not poses:
            raise InputError("expected poses, found none; give the result of StructureFromMotion as .sfm")
        photos, photo_of_view, left_out = [], {}, []
        for view in content["views"]:
            written = view["path"].text()
            pose = poses.get(view["poseId"].whole()) if "poseId" in view else None
            lens = lenses.get(view["intrinsicId"].whole()) if "intrinsicId" in view else None
            if pose is None or lens is None:
                left_out.append(written.replace("\\", "/").rsplit("/", 1)[-1])
                continue
            if "rigId" in view and "isPoseIndependant" in view:
                raise InputError(f"{view.where}: poses of a rig are not supported; export with independent poses")
            R, C = pose["rotation"].numbers(9).reshape(3, 3).T, pose["center"].numbers(3)
            with naming(view.where):
                photo = find_photo(written, [file.parent, file.parent.parent])
            photo_of_view[view["viewId"].whole()] = len(photos)
            photos.append(CalibratedPhoto(photo, lens, R, pose_of_center(R, C)))
        warnings = (f"photos left out, without a pose: {len(left_out)} ({listed(left_out)})",) if left_out else ()
        return build_capture(photos, _points(content, photo_of_view), warnings)


def _version(item: Item) -> tuple[int, ...]:
    numbers = item.numbers(3)
    if not (np.abs(numbers) < _LARGEST_VERSION).all():
        raise InputError(f"{item.where}: expected 3 numbers such as 1.2.14, found {item.kind}")
    return tuple(int(number) for number in numbers)


def _lens(item: Item, version: tuple[int, ...]) -> Lens:
    width, height = item["width"].whole(lowest=1), item["height"].whole(lowest=1)
    cx, cy = item["principalPoint"].numbers(2)
    if version >= (1, 2, 1):
        cx, cy = cx + width / 2, cy + height / 2
    if version >= (1, 2, 2):
        sensor_width = item["sensorWidth"].number() if "sensorWidth" in item else 36.0
        ratio = item["pixelRatio"].number() if "pixelRatio" in item else 1.0
        if not (sensor_width > 0 and ratio > 0):
            raise InputError(
                f"{item.where}: expected positive sensorWidth and pixelRatio, found {sensor_width}, {ratio}"
            )
        fx = item["focalLength"].number() / sensor_width * width
        fy = fx * ratio if version >= (1, 2, 5) else fx / ratio
    elif version >= (1, 2, 0):
        fx, fy = item["pxFocalLength"].numbers(2)
    else:
        fx = fy = item["pxFocalLength"].number()
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    with naming(item.where):
        model, distortion = _distortion(item)
        return Lens(K, distortion, width, height, model)


def _distortion(item: Item) -> tuple[str, np.ndarray]:
    """The model of the distortion and its parameters."""
    kind = item["type"].text()
    if kind == "pinhole" and "distortionType" in item:
        kind = item["distortionType"].text()
    if kind not in _DISTORTIONS:
        raise InputError(
            f"camera model {kind} is not supported (expected {', '.join(_DISTORTIONS)}); run ExportImages or "
            "PrepareDenseScene, which undistort"
        )
    undistortion = item["undistortionType"].text(may_be_empty=True) if "undistortionType" in item else ""
    if undistortion not in ("", "none"):
        raise InputError(
            f"undistortionType {undistortion} is not supported (expected none); run ExportImages or PrepareDenseScene, "
            "which undistort"
        )
    model, places = _DISTORTIONS[kind]
    distortion = np.zeros(5 if model == "polynomial" else 4)
    if places and "distortionParams" in item and item["distortionParams"].value:
        distortion[list(places)] = item["distortionParams"].numbers(len(places))
    return model, distortion


def _points(content: Item, photo_of_view: dict[int, int]) -> ObservedPoints:
    positions, colors, observations, pixels = [], [], [], []
    for landmark in _items(content, "structure"):
        for observation in _items(landmark, "observations"):
            photo = photo_of_view.get(observation["observationId"].whole())
            if photo is not None and "x" in observation:
                observations.append((len(positions), photo))
                pixels.append(observation["x"].numbers(2))
        positions.append(landmark["X"].numbers(3))
        colors.append(landmark["color"].numbers(3) if "color" in landmark else np.full(3, 128.0))
    return ObservedPoints(
        np.array(positions).reshape(-1, 3),
        np.clip(np.nan_to_num(np.array(colors)).reshape(-1, 3), 0, 255).astype(np.uint8),
        np.array(observations, dtype=np.int64).reshape(-1, 2),
        np.array(pixels).reshape(-1, 2),
    )


def _items(item: Item, key: str) -> list[Item]:
    """The items of a list that may be missing; an empty list is stored as an empty string."""
    return list(item[key]) if key in item and item[key].value != "" else []


def _file(path: Path) -> Path | None:
    if path.is_file():
        return path if path.suffix.lower() == ".sfm" or holds(path, "version", "views", "viewId") else None
    found = files_in(path, frozenset({".sfm"}))
    if len(found) > 1:
        raise InputError(f"{path}: expected one .sfm file, found {listed(f.name for f in found)}; give one of them")
    return found[0] if found else None

"""OpenMVG: `sfm_data.json` (also sfm_data_*.json with poses).

World to camera: R (X - C). Pixel centres lie at integers (its UndistortImage samples whole numbers). The lenses are
models of `fairing.distortion`: pinhole, pinhole_radial_k1, pinhole_radial_k3, pinhole_brown_t2 (k1, k2, k3, t1 = p1, t2 = p2) and
fisheye (k1 to k4, as OpenCV's).
The file is serialized by cereal: a type's name is given at its first use only; later uses have its number
(`polymorphic_id`, whose highest bit marks the first use). Source: openMVG/cameras/*_io.hpp, sfm_data_io_cereal.cpp.
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

NAME = "openmvg"
FORMAT = "OpenMVG (sfm_data.json with poses)"

# The key of each type's parameters, the model, and their indices among its parameters.
_DISTORTIONS: dict[str, tuple[str, str, tuple[int, ...]]] = {
    "pinhole": ("", "polynomial", ()),
    "pinhole_radial_k1": ("disto_k1", "polynomial", (0,)),
    "pinhole_radial_k3": ("disto_k3", "polynomial", (0, 1, 4)),
    "pinhole_brown_t2": ("disto_t2", "polynomial", (0, 1, 4, 2, 3)),
    "fisheye": ("fisheye", "fisheye", (0, 1, 2, 3)),
}
_FIRST_TIME = 1 << 31


def recognises(path: Path) -> bool:
    return _file(path) is not None


def read(path: Path) -> Capture:
    file = _file(path)
    assert file is not None
    content = read_json(file, "an OpenMVG scene")
    with naming(file):
        lenses = _lenses(content)
        poses = {item["key"].whole(): item["value"] for item in content["extrinsics"]}
        if not poses:
            raise InputError(
                "expected poses (extrinsics), found none; run OpenMVG's reconstruction and give its sfm_data"
            )
        root = content["root_path"].text(may_be_empty=True) if "root_path" in content else ""
        folders = [Path(root), file.parent] if root else [file.parent]
        photos, photo_of_view, left_out = [], {}, []
        for item in content["views"]:
            view = _base(_data(item["value"]))
            written = view["filename"].text()
            if view["id_pose"].whole() not in poses or view["id_intrinsic"].whole() not in lenses:
                left_out.append(written)
                continue
            pose = poses[view["id_pose"].whole()]
            R, C = pose["rotation"].numbers(3, 3), pose["center"].numbers(3)
            local = view["local_path"].text(may_be_empty=True) if "local_path" in view else ""
            with naming(view.where):
                photo = find_photo(f"{local}/{written}" if local else written, folders)
            photo_of_view[view["id_view"].whole()] = len(photos)
            photos.append(CalibratedPhoto(photo, lenses[view["id_intrinsic"].whole()], R, pose_of_center(R, C)))
        points = _points(content, photo_of_view)
        warnings = (f"photos left out, without a pose: {len(left_out)} ({listed(left_out)})",) if left_out else ()
        return build_capture(photos, points, warnings)


def _lenses(content: Item) -> dict[int, Lens]:
    names: dict[int, str] = {}
    lenses = {}
    for item in content["intrinsics"]:
        value = item["value"]
        number = value["polymorphic_id"].whole()
        if number & _FIRST_TIME:
            names[number ^ _FIRST_TIME] = value["polymorphic_name"].text()
        name = names.get(number & ~_FIRST_TIME, f"number {number}")
        with naming(value.where):
            if name not in _DISTORTIONS:
                raise InputError(
                    f"camera model {name} is not supported (expected {', '.join(_DISTORTIONS)}); "
                    "run openMVG_main_ExportUndistortedImages"
                )
        lenses[item["key"].whole()] = _lens(_data(value), *_DISTORTIONS[name])
    return lenses


def _lens(data: Item, key: str, model: str, places: tuple[int, ...]) -> Lens:
    pinhole = _base(data)
    f = pinhole["focal_length"].number()
    cx, cy = pinhole["principal_point"].numbers(2)
    distortion = np.zeros(5 if model == "polynomial" else 4)
    if key:
        distortion[list(places)] = data[key].numbers(len(places))
    width, height = pinhole["width"].whole(lowest=1), pinhole["height"].whole(lowest=1)
    with naming(data.where):
        return Lens(np.array([[f, 0, cx], [0, f, cy], [0, 0, 1]]), distortion, width, height, model)


def _points(content: Item, photo_of_view: dict[int, int]) -> ObservedPoints | None:
    if "structure" not in content:
        return None
    positions, observations, pixels = [], [], []
    for item in content["structure"]:
        landmark = item["value"]
        for observation in landmark["observations"]:
            photo = photo_of_view.get(observation["key"].whole())
            if photo is not None:
                observations.append((len(positions), photo))
                pixels.append(observation["value"]["x"].numbers(2))
        positions.append(landmark["X"].numbers(3))
    return ObservedPoints(
        np.array(positions).reshape(-1, 3),
        np.full((len(positions), 3), 128, dtype=np.uint8),  # OpenMVG stores no colors
        np.array(observations, dtype=np.int64).reshape(-1, 2),
        np.array(pixels).reshape(-1, 2),
    )


def _data(value: Item) -> Item:
    return value["ptr_wrapper"]["data"]


def _base(data: Item) -> Item:
    """The fields of the base type: an object of its own in newer files, among the others in older ones."""
    is_nested = "value0" in data
    return data["value0"] if is_nested else data


def _file(path: Path) -> Path | None:
    if path.is_file():
        return path if holds(path, "sfm_data_version") else None
    found = [file for file in files_in(path, frozenset({".json"})) if holds(file, "sfm_data_version")]
    chosen = [file for file in found if file.name == "sfm_data.json"] if len(found) > 1 else found
    if len(found) > 1 and not chosen:
        raise InputError(f"{path}: expected one sfm_data.json, found {listed(f.name for f in found)}; give one")
    return chosen[0] if chosen else None

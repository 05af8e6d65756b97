"""OpenSfM and WebODM: `reconstruction.json`, in the folder or in its `opensfm/`, with `tracks.csv` beside it.

A list of reconstructions, of which the one with most photos is read. A shot has the rotation (axis times angle) and the
translation from world to camera, axes x right, y down, z forward. Lengths in a photo are relative to its larger side, and
to its middle: pixel = (larger side) * value + (size - 1) / 2, pixel centres at integers. Lenses: perspective (focal, k1,
k2), simple_radial, radial, brown (k1, k2, k3, p1, p2), fisheye (k1, k2) and fisheye_opencv (k1 to k4).

The points' observations are the rows `image, track, feature, x, y, ...` of `tracks.csv`, separated by tabs.

Source: OpenSfM's io.py, features.py (normalized_image_coordinates) and geometry/camera_distortions_functions.h.
"""

from pathlib import Path

import numpy as np

from fairing.distortion import MODELS
from fairing.errors import InputError
from fairing.io.calibrated import CalibratedPhoto, ObservedPoints, build_capture
from fairing.io.capture import Capture, listed, naming, read_text
from fairing.io.find_photo import find_photo
from fairing.io.json_file import Item, holds, read_json
from fairing.io.poses import rotation_of_axis_angle
from fairing.lens import Lens

NAME = "opensfm"
FORMAT = "OpenSfM / WebODM (reconstruction.json)"

_FILE = "reconstruction.json"
_TRACKS = "tracks.csv"
# The model of `fairing.distortion` of each type of projection; its parameters have the same names.
_LENSES = {
    "perspective": "polynomial",
    "simple_radial": "polynomial",
    "radial": "polynomial",
    "brown": "polynomial",
    "fisheye": "fisheye",
    "fisheye_opencv": "fisheye",
}


def recognises(path: Path) -> bool:
    return _file(path) is not None


def read(path: Path) -> Capture:
    file = _file(path)
    assert file is not None
    content = read_json(file, "an OpenSfM reconstruction")
    with naming(file):
        parts = list(content)
        if not parts:
            raise InputError("expected reconstructions, found none; run OpenSfM's reconstruct first")
        sizes = [len(part["shots"].names) for part in parts]
        chosen = parts[sizes.index(max(sizes))]
        lenses = {name: _lens(chosen["cameras"][name]) for name in chosen["cameras"].names}
        photos, shots = [], {}
        for name in chosen["shots"].names:
            shot = chosen["shots"][name]
            camera = shot["camera"].text()
            if camera not in lenses:
                raise InputError(f"{shot.where}: expected a camera of the file, found {camera[:60]!r}")
            with naming(shot.where):
                R = rotation_of_axis_angle(shot["rotation"].numbers(3))
            found = find_photo(name, [file.parent, file.parent.parent])
            shots[name] = len(photos)
            photos.append(CalibratedPhoto(found, lenses[camera], R, shot["translation"].numbers(3)))
        points = _points(chosen, photos, shots, file.parent / _TRACKS)
        sizes.remove(max(sizes))
        others = (f"further reconstructions are not read: {len(sizes)} ({listed(sizes)} photos)",) if sizes else ()
        return build_capture(photos, points, others)


def _file(path: Path) -> Path | None:
    candidates = (path,) if path.is_file() else (path / _FILE, path / "opensfm" / _FILE)
    return next((file for file in candidates if holds(file, "cameras", "projection_type")), None)


def _lens(item: Item) -> Lens:
    kind = item["projection_type"].text() if "projection_type" in item else "perspective"
    if kind not in _LENSES:
        raise InputError(
            f"{item.where}: projection type {kind[:60]} is not supported (expected {', '.join(_LENSES)}); run OpenSfM's "
            "undistort and give its reconstruction"
        )
    width, height = item["width"].whole(lowest=1), item["height"].whole(lowest=1)
    side = max(width, height)
    if "focal" in item:
        fx = fy = side * item["focal"].number()
    else:
        fx, fy = side * item["focal_x"].number(), side * item["focal_y"].number()
    cx, cy = (item[key].number() if key in item else 0.0 for key in ("c_x", "c_y"))
    K = np.array([[fx, 0, side * cx + (width - 1) / 2], [0, fy, side * cy + (height - 1) / 2], [0, 0, 1]])
    model = _LENSES[kind]
    distortion = np.array([item[name].number() if name in item else 0.0 for name in MODELS[model].names])
    with naming(item.where):
        return Lens(K, distortion, width, height, model)


def _points(content: Item, photos: list[CalibratedPhoto], shots: dict[str, int], tracks: Path) -> ObservedPoints | None:
    if "points" not in content or not content["points"].names:
        return None
    ids, positions, colors = {}, [], []
    for name in content["points"].names:
        point = content["points"][name]
        ids[name] = len(positions)
        positions.append(point["coordinates"].numbers(3))
        colors.append(point["color"].numbers(3) if "color" in point else np.full(3, 128.0))
    observations, pixels = _observations(tracks, ids, shots, photos) if tracks.is_file() else ([], [])
    return ObservedPoints(
        np.array(positions).reshape(-1, 3),
        np.clip(np.nan_to_num(np.array(colors)).reshape(-1, 3), 0, 255).astype(np.uint8),
        np.array(observations, dtype=np.int64).reshape(-1, 2),
        np.array(pixels).reshape(-1, 2),
    )


def _observations(
    tracks: Path, ids: dict[str, int], shots: dict[str, int], photos: list[CalibratedPhoto]
) -> tuple[list[tuple[int, int]], list[tuple[float, float]]]:
    """Observations of the points as (point, photo) and their distorted pixels."""
    observations, pixels = [], []
    for number, line in enumerate(read_text(tracks, "OpenSfM's tracks").splitlines(), start=1):
        words = line.split("\t")
        if len(words) < 5:
            if line.strip() and not line.startswith("OPENSFM_TRACKS_VERSION"):
                raise InputError(f"{tracks}: line {number}: expected image, track, feature, x, y, found {line[:40]!r}")
            continue
        point, photo = ids.get(words[1]), shots.get(words[0])
        if point is None or photo is None:
            continue
        try:
            x, y = float(words[3]), float(words[4])
        except ValueError:
            raise InputError(
                f"{tracks}: line {number}: expected x, y, found {words[3][:20]!r}, {words[4][:20]!r}"
            ) from None
        lens = photos[photo].lens
        side = max(lens.width, lens.height)
        observations.append((point, photo))
        pixels.append((side * x + (lens.width - 1) / 2, side * y + (lens.height - 1) / 2))
    return observations, pixels

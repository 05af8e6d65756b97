"""COLMAP reconstructions: cameras, images and points3D, as .txt or .bin.

The model is searched in the folder itself, in `sparse/` and in `sparse/0/`; the photos in `images/` beside any of these,
or beside the model. If both text and binary files exist, the binary is read, as in COLMAP. `rigs` and `frames` (COLMAP 4)
repeat the content of the images and are not read.

The centre of the top-left pixel is (0.5, 0.5) in COLMAP and (0, 0) here: this module subtracts the half from principal
points and observations. All cameras it returns are pinholes: lenses are undistorted here (`fairing.lens`).
"""

import os
from pathlib import Path

import numpy as np

from fairing.camera import Camera
from fairing.errors import InputError
from fairing.io.capture import PHOTO_SUFFIXES, Capture, files_below, listed, naming
from fairing.io.colmap_binary import read_binary_model
from fairing.io.colmap_model import ColmapCamera, ColmapImage, ColmapModel
from fairing.io.colmap_text import read_text_model
from fairing.lens import DISTORTION, Lens
from fairing.photo import FilePhoto
from fairing.scene import SparsePoints, View

NAME = "colmap"
FORMAT = "COLMAP model (cameras and images, .txt or .bin, in the folder, sparse/ or sparse/0/)"

_HALF_PIXEL = 0.5


def recognises(path: Path) -> bool:
    return _model_folder(path) is not None


def read(path: Path) -> Capture:
    folder = _model_folder(path)
    assert folder is not None
    model = read_binary_model(folder) if _has_model(folder, ".bin") else read_text_model(folder)
    if not model.images:
        raise InputError(f"{folder}: expected photos in the COLMAP model, found none; run COLMAP's mapper first")
    photos = _photo_folder(path, folder, model)
    cameras = {}
    for camera_id, camera in model.cameras.items():
        with naming(f"{folder}: camera {camera_id}"):
            cameras[camera_id] = _intrinsics(camera)

    views, pixels = [], []
    # By name, because COLMAP's files come in no particular order.
    images = dict(sorted(model.images.items(), key=lambda item: item[1].name))
    for image_id, image in images.items():
        with naming(f"{folder}: image {image_id} ({image.name})"):
            if image.camera_id not in cameras:
                raise InputError(f"expected a camera {image.camera_id} in the model, found {listed(cameras)}")
            if not np.isfinite(image.pixels).all():
                raise InputError("expected finite observations, found NaN or infinity; export the model again")
            lens = cameras[image.camera_id]
            views.append(_view(image, lens, photos))
            pixels.append(lens.undistort(image.pixels - _HALF_PIXEL))
    warnings = _unregistered(photos, model) + _other_models(folder)
    return Capture(tuple(views), _sparse_points(folder, model, list(images.values()), pixels), warnings)


def _has_model(folder: Path, suffix: str) -> bool:
    return (folder / f"cameras{suffix}").is_file() and (folder / f"images{suffix}").is_file()


def _model_folder(path: Path) -> Path | None:
    """The folder of the model, or None. A file of the model stands for its folder."""
    if path.is_file():
        return path.parent if path.name in ("cameras.txt", "cameras.bin", "images.txt", "images.bin") else None
    for folder in (path, path / "sparse", path / "sparse" / "0"):
        if _has_model(folder, ".bin") or _has_model(folder, ".txt"):
            return folder
    return None


def _photo_folder(path: Path, folder: Path, model: ColmapModel) -> Path:
    """The folder that photo names are relative to: the first candidate that holds one of the photos."""
    above = Path(os.path.abspath(folder)).parents
    roots = list(dict.fromkeys([path if path.is_dir() else folder, folder, *above[:2]]))
    candidates = [candidate for root in roots for candidate in (root / "images", root)]
    for candidate in candidates:
        if any((candidate / image.name).is_file() for image in model.images.values()):
            return candidate
    first = min(image.name for image in model.images.values())
    raise InputError(
        f"{folder}: expected the photos of the COLMAP model (such as {first}) in {roots[0] / 'images'}, found none of "
        "them; put the photos there that COLMAP calibrated"
    )


def _intrinsics(camera: ColmapCamera) -> Lens:
    p = camera.parameters
    fx, fy = p.get("fx", p.get("f", 0.0)), p.get("fy", p.get("f", 0.0))
    K = np.array([[fx, 0, p["cx"] - _HALF_PIXEL], [0, fy, p["cy"] - _HALF_PIXEL], [0, 0, 1]])
    distortion = np.array([p.get(name, 0.0) for name in DISTORTION])
    return Lens(K, distortion, camera.width, camera.height)


def _view(image: ColmapImage, lens: Lens, photos: Path) -> View:
    camera = Camera.from_krt(lens.pinhole_K, _rotation(image.quaternion), image.translation, lens.width, lens.height)
    return View(image.name, camera, FilePhoto(photos / image.name, lens if lens.is_distorted else None))


def _rotation(quaternion: np.ndarray) -> np.ndarray:
    """(3, 3) rotation of a quaternion (4,) w x y z, of any length but zero."""
    largest = np.abs(quaternion).max()
    if not np.isfinite(largest) or largest == 0:
        raise InputError(f"expected a rotation as quaternion, found {quaternion.tolist()}")
    quaternion = quaternion / largest  # so that no square overflows
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _sparse_points(
    folder: Path, model: ColmapModel, images: list[ColmapImage], pixels: list[np.ndarray]
) -> SparsePoints | None:
    """The points with all their observations; features without a point are dropped."""
    if model.points is None or len(model.points.ids) == 0:
        return None
    if not np.isfinite(model.points.positions).all():
        raise InputError(f"{folder}: points3D: expected finite positions, found NaN or infinity")
    order = np.argsort(model.points.ids)
    ids = model.points.ids[order]
    point_ids = np.concatenate([image.point_ids for image in images])
    view_index = np.repeat(np.arange(len(images)), [len(image.point_ids) for image in images])
    seen = point_ids != -1
    observed = np.concatenate(pixels)
    seen &= np.isfinite(observed).all(axis=1)  # some corners have no ray through the lens
    point_ids, view_index, observed = point_ids[seen], view_index[seen], observed[seen]
    position = np.minimum(np.searchsorted(ids, point_ids), len(ids) - 1)
    unknown = np.flatnonzero(ids[position] != point_ids)
    if len(unknown):
        raise InputError(
            f"{folder}: image {images[view_index[unknown[0]]].name} shows point {point_ids[unknown[0]]}, which "
            "points3D does not hold; the files are not of one model, export it from COLMAP again"
        )
    return SparsePoints(
        model.points.positions,
        model.points.colors,
        np.column_stack([order[position], view_index]),
        observed,
    )


def _unregistered(photos: Path, model: ColmapModel) -> tuple[str, ...]:
    known = {image.name for image in model.images.values()}
    left_out = [
        name
        for path in files_below(photos, PHOTO_SUFFIXES)
        if (name := path.relative_to(photos).as_posix()) not in known
    ]
    if not left_out:
        return ()
    return (f"photos left out because the COLMAP model has no camera of them: {len(left_out)} ({listed(left_out)})",)


def _other_models(folder: Path) -> tuple[str, ...]:
    """A warning about further models: COLMAP numbers the components of a capture that it could not join 0, 1, ..."""
    if folder.name != "0":
        return ()
    others = [path.name for path in sorted(folder.parent.iterdir()) if path.name.isdigit() and path != folder]
    return (f"{folder.parent} holds more models ({listed(others)}); {folder.name} is read",) if others else ()

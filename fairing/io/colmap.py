"""COLMAP reconstructions: cameras, images and points3D, as .txt or .bin.

The model is searched in the folder itself, in `sparse/` and in their numbered folders, of which COLMAP makes one for each
component of a capture that it could not join: the one with most photos is read. Photos are searched in `images/` and
`photos/` beside any of these, or beside the model. If both text and binary files exist, the binary is read, as in COLMAP.
`rigs` and `frames` (COLMAP 4) repeat the content of the images and are not read.

The centre of the top-left pixel is (0.5, 0.5) in COLMAP and (0, 0) here: this module subtracts the half from principal
points and observations. All cameras it returns are pinholes: lenses are undistorted here (`fairing.lens`).
"""

import os
from pathlib import Path

import numpy as np

from fairing.distortion import MODELS
from fairing.errors import InputError
from fairing.io.calibrated import CalibratedPhoto, build_view, resized_note, undistorted
from fairing.io.capture import PHOTO_SUFFIXES, Capture, files_below, listed, naming, read_text, reading
from fairing.io.colmap_binary import read_binary_model
from fairing.io.colmap_model import DISTORTION_MODELS, ColmapCamera, ColmapImage, ColmapModel
from fairing.io.colmap_text import read_text_model
from fairing.io.find_photo import PHOTO_FOLDERS, is_file, missing_file
from fairing.io.poses import rotation_of_quaternion
from fairing.lens import Lens
from fairing.scene import SparsePoints

NAME = "colmap"
FORMAT = "COLMAP model (cameras and images, .txt or .bin, in the folder, sparse/ or sparse/0/), also of RealityScan"

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

    views, pixels, resized = [], [], []
    # By name, because COLMAP's files come in no particular order.
    images = dict(sorted(model.images.items(), key=lambda item: item[1].name))
    for image_id, image in images.items():
        with naming(f"{folder}: image {image_id} ({image.name})"):
            if image.camera_id not in cameras:
                raise InputError(f"expected a camera {image.camera_id} in the model, found {listed(cameras)}")
            if not np.isfinite(image.pixels).all():
                raise InputError("expected finite observations, found NaN or infinity; export the model again")
            lens = cameras[image.camera_id]
            file = photos / image.name
            found = file if os.path.exists(file) else missing_file(image.name, [photos], image.name)
            rotation = rotation_of_quaternion(image.quaternion)
            view = build_view(image.name, CalibratedPhoto(found, lens, rotation, image.translation))
            views.append(view)
            if (view.camera.width, view.camera.height) != (lens.width, lens.height):
                resized.append(image.name)
            pixels.append(undistorted(image.pixels - _HALF_PIXEL, lens, view))
    warnings = _unregistered(photos, model) + resized_note(resized) + _other_models(folder)
    return Capture(tuple(views), _sparse_points(folder, model, list(images.values()), pixels), warnings)


def _has_model(folder: Path, suffix: str) -> bool:
    return (folder / f"cameras{suffix}").is_file() and (folder / f"images{suffix}").is_file()


def _model_folder(path: Path) -> Path | None:
    """The folder of the model, or None. A file of the model stands for its folder."""
    if path.is_file():
        return path.parent if path.name in ("cameras.txt", "cameras.bin", "images.txt", "images.bin") else None
    for folder in (path, path / "sparse"):
        if _has_model(folder, ".bin") or _has_model(folder, ".txt"):
            return folder
        numbered = _numbered_models(folder)
        if numbered:  # of equal ones the first
            return max(numbered, key=lambda model: (_count_images(model), -int(model.name)))
    return None


def _numbered_models(folder: Path) -> list[Path]:
    """The models in folders 0, 1, ..., in the order of their numbers."""
    if not folder.is_dir():
        return []
    with reading(folder, "a folder"):
        # Longer names are no numbers of COLMAP, and might have more digits than Python converts.
        numbered = [path for path in folder.iterdir() if path.name.isascii() and path.name.isdigit()]
    models = [
        path for path in numbered if len(path.name) < 10 and (_has_model(path, ".bin") or _has_model(path, ".txt"))
    ]
    return sorted(models, key=lambda path: int(path.name))


def _count_images(folder: Path) -> int:
    """The number of images that the model's file declares or lists."""
    if _has_model(folder, ".bin"):
        file = folder / "images.bin"
        with reading(file, "a COLMAP model"), file.open("rb") as stream:
            return int.from_bytes(stream.read(8), "little")
    lines = read_text(folder / "images.txt", "a COLMAP model").splitlines()
    return sum(1 for line in lines if not line.startswith("#")) // 2  # the second line of an image may be empty


def _photo_folder(path: Path, folder: Path, model: ColmapModel) -> Path:
    """The folder that photo names are relative to: the first candidate that holds one of the photos."""
    above = Path(os.path.abspath(folder)).parents
    roots = list(dict.fromkeys([path if path.is_dir() else folder, folder, *above[:3]]))
    candidates = [candidate for root in roots for candidate in (*(root / name for name in PHOTO_FOLDERS), root)]
    for candidate in candidates:
        if any(is_file(candidate / image.name) for image in model.images.values()):
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
    distortion_model = DISTORTION_MODELS.get(camera.model, "polynomial")
    distortion = np.array([p.get(name, 0.0) for name in MODELS[distortion_model].names])
    return Lens(K, distortion, camera.width, camera.height, distortion_model)


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
    """A note about further models."""
    others = [model for model in _numbered_models(folder.parent) if model != folder] if folder.name.isdigit() else []
    if not others:
        return ()
    found = listed(f"{model.name} with {_count_images(model)} photos" for model in others)
    return (f"{folder.parent} holds more models ({found}); {folder.name} with {_count_images(folder)} photos is read",)

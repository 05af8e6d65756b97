"""EigenFairing's own format: one `scene.json` that names a mesh, photos and cameras.

    {
      "mesh": "mesh.ply",
      "views": [
        {"name": "left", "photo": "images/left.jpg", "width": 640, "height": 480,
         "image_from_world": [[700, 0, 320, 0], [0, 700, 240, 0], [0, 0, 1, 5]]},
        {"photo": "images/right.jpg", "width": 640, "height": 480,
         "K": [[700, 0, 320], [0, 700, 240], [0, 0, 1]],
         "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
         "t": [0, 0, 5], "mask": "masks/right.jpg.png", "weight": 0.5}
      ],
      "points": "points.npz"
    }

- `mesh` (optional): a mesh file.
- `views`: at least three. Each has `photo` (undistorted), `width` and `height` in pixels, and its camera: either the
  3x4 projection matrix `image_from_world`, or `K`, `R`, `t` with pixels = K (R x + t), axes x right, y down, z forward.
  Pixel centres lie at integers: the top-left pixel's centre is (0, 0). The default `name` is the photo's path.
  `mask` (optional) is an image of the same size, black where the photo is ignored; `weight` (optional, default 1) is its
  weight relative to the other photos.
- `points` (optional): sparse points as a NumPy file of the arrays `positions` (n, 3), `colors` (n, 3) uint8,
  `observations` (o, 2) of a point's and a view's index, and `pixels` (o, 2), see `fairing.scene.SparsePoints`.

Paths are relative to the JSON file. Unknown keys are errors, so that a misspelt key does not go unnoticed.
"""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fairing.camera import Camera
from fairing.errors import InputError
from fairing.io.atomic import write_atomically
from fairing.io.capture import Capture, MissingPhoto, listed, naming
from fairing.io.find_photo import missing_file
from fairing.io.json_file import Item, holds, read_json
from fairing.io.points_file import read_points, write_points
from fairing.photo import FilePhoto, Mask
from fairing.scene import SparsePoints, View

NAME = "scene.json"
FORMAT = "scene.json (EigenFairing's own: mesh, photos and cameras in one file)"
FILE = "scene.json"

_POINTS = "points.npz"
_MATRIX_KEYS = ("image_from_world",)
_POSE_KEYS = ("K", "R", "t")


def recognises(path: Path) -> bool:
    """By the file's keys, because other programs write a scene.json of their own."""
    file = path if path.is_file() else path / FILE
    return (
        file.name == FILE
        and holds(file, "views", "photo")
        and any(holds(file, key) for key in (*_MATRIX_KEYS, *_POSE_KEYS))
    )


def read(path: Path) -> Capture:
    file = path if path.is_file() else path / FILE
    content = read_json(file, "a scene")
    with naming(file):
        _expect_keys(content, required=("views",), optional=("mesh", "points"))
        mesh = file.parent / content["mesh"].text() if "mesh" in content else None
        views = tuple(_view(item, file.parent) for item in content["views"])
        points = file.parent / content["points"].text() if "points" in content else None
    return Capture(views, None if points is None else read_points(points, len(views)), mesh=mesh)


def write(folder: Path, views: Sequence[View], sparse: SparsePoints | None, mesh: str | None) -> None:
    """Write scene.json and the sparse points to a folder that holds the photos in images/ and the masks in masks/.

    Cameras are written as matrices, which represent every camera without loss.

    Args:
        mesh: the mesh's file name, or None.
    """
    content: dict[str, Any] = {} if mesh is None else {"mesh": mesh}
    content["views"] = [_description(view) for view in views]
    if sparse is not None:
        write_points(folder / _POINTS, sparse)
        content["points"] = _POINTS
    text = json.dumps(content, indent=1, allow_nan=False)
    write_atomically(folder / FILE, lambda file: file.write(text.encode()))


def _description(view: View) -> dict[str, Any]:
    camera = view.camera
    description = {"name": view.name, "photo": f"images/{view.name}", "width": camera.width, "height": camera.height,
                   "image_from_world": camera.image_from_world.tolist()}  # fmt: skip
    if view.mask is not None:
        description["mask"] = f"masks/{view.name}.png"
    if view.weight != 1:
        description["weight"] = view.weight
    return description


def _view(item: Item, folder: Path) -> View:
    has_matrix = "image_from_world" in item
    camera_keys = _MATRIX_KEYS if has_matrix else _POSE_KEYS
    _expect_keys(item, required=("photo", "width", "height", *camera_keys), optional=("name", "mask", "weight"))
    photo = item["photo"].text()
    name = item["name"].text() if "name" in item else photo
    width, height = (item[key].whole(lowest=1) for key in ("width", "height"))
    if has_matrix:
        image_from_world = item["image_from_world"].numbers(3, 4)
        with naming(item.where):
            camera = Camera(image_from_world, width, height)
    else:
        K, R, t = item["K"].numbers(3, 3), item["R"].numbers(3, 3), item["t"].numbers(3)
        if np.any(np.tril(K, -1)):
            raise InputError(f"{item.where}.K: expected an upper triangular matrix, found numbers below its diagonal")
        with naming(item.where):
            camera = Camera.from_krt(K, R, t, width, height)
    mask = Mask(folder / item["mask"].text()) if "mask" in item else None
    weight = item["weight"].number() if "weight" in item else 1.0
    found = folder / photo
    source = (
        FilePhoto(found)
        if os.path.exists(found)
        else MissingPhoto((width, height), missing_file(photo, [folder], name).error)
    )
    with naming(item.where):
        return View(name, camera, source, mask, weight)


def _expect_keys(item: Item, required: tuple[str, ...], optional: tuple[str, ...]) -> None:
    where = item.where or "the file"
    for key in required:
        if key not in item:
            hint = " (or image_from_world)" if key in _POSE_KEYS else ""
            raise InputError(f"{where}: expected {key}{hint}, found only {listed(item.names) or 'nothing'}")
    for key in item.names:
        if key not in required and key not in optional:
            raise InputError(f"{where}: expected only {', '.join(required + optional)}, found {key}")

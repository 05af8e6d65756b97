"""Our own format: one `scene.json` that names a mesh, photos and cameras.

    {
      "mesh": "mesh.ply",
      "views": [
        {"name": "left", "photo": "images/left.jpg", "width": 640, "height": 480,
         "image_from_world": [[700, 0, 320, 0], [0, 700, 240, 0], [0, 0, 1, 5]]},
        {"photo": "images/right.jpg", "width": 640, "height": 480,
         "K": [[700, 0, 320], [0, 700, 240], [0, 0, 1]],
         "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
         "t": [0, 0, 5]}
      ]
    }

- `mesh` (optional): a mesh file.
- `views`: at least three. Each has `photo` (undistorted), `width` and `height` in pixels, and its camera: either the
  3x4 projection matrix `image_from_world`, or `K`, `R`, `t` with pixels = K (R x + t), axes x right, y down, z forward.
  Pixel centres lie at integers: the top-left pixel's centre is (0, 0). Without `name` a view is named as its photo.

Paths are relative to the json file. Anything else in the file is an error, so that no misspelt name goes unnoticed.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from fairing.camera import Camera
from fairing.errors import InputError
from fairing.io.capture import Capture, listed, naming, read_text
from fairing.photo import FilePhoto
from fairing.scene import View

FORMAT = "scene.json (EigenFairing's own: mesh, photos and cameras in one file)"

_MATRIX_KEYS = ("image_from_world",)
_POSE_KEYS = ("K", "R", "t")


def recognises(path: Path) -> bool:
    return path.name == "scene.json" if path.is_file() else (path / "scene.json").is_file()


def read(path: Path) -> Capture:
    file = path if path.is_file() else path / "scene.json"
    text = read_text(file, "a scene")
    with naming(file):
        try:
            content = json.loads(text)
        except json.JSONDecodeError as error:
            raise InputError(f"line {error.lineno}: expected JSON ({error.msg.lower()})") from None
        except RecursionError:
            raise InputError("expected a scene, found JSON nested too deeply") from None
        _expect_keys(content, "the file", required=("views",), optional=("mesh",))
        mesh = file.parent / _text(content, "mesh", "mesh") if "mesh" in content else None
        items = content["views"]
        if not isinstance(items, list):
            raise InputError(f"views: expected a list, found {_kind(items)}")
        return Capture(tuple(_view(item, f"views[{i}]", file.parent) for i, item in enumerate(items)), mesh=mesh)


def _view(item: Any, where: str, folder: Path) -> View:
    has_matrix = isinstance(item, dict) and "image_from_world" in item
    camera_keys = _MATRIX_KEYS if has_matrix else _POSE_KEYS
    _expect_keys(item, where, required=("photo", "width", "height", *camera_keys), optional=("name",))
    photo = _text(item, "photo", f"{where}.photo")
    name = _text(item, "name", f"{where}.name") if "name" in item else photo
    width, height = (_size(item[key], f"{where}.{key}") for key in ("width", "height"))
    with naming(where):
        if has_matrix:
            camera = Camera(_numbers(item, "image_from_world", (3, 4)), width, height)
        else:
            K, R, t = (_numbers(item, key, shape) for key, shape in (("K", (3, 3)), ("R", (3, 3)), ("t", (3,))))
            if np.any(np.tril(K, -1)):
                raise InputError("K: expected an upper triangular matrix, found numbers below its diagonal")
            camera = Camera.from_krt(K, R, t, width, height)
        return View(name, camera, FilePhoto(folder / photo))


def _expect_keys(item: Any, where: str, required: tuple[str, ...], optional: tuple[str, ...]) -> None:
    if not isinstance(item, dict):
        raise InputError(f"{where}: expected an object with {', '.join(required)}, found {_kind(item)}")
    for key in required:
        if key not in item:
            hint = " (or image_from_world)" if key in _POSE_KEYS else ""
            raise InputError(f"{where}: expected {key}{hint}, found only {listed(item) or 'nothing'}")
    for key in item:
        if key not in required and key not in optional:
            raise InputError(f"{where}: expected only {', '.join(required + optional)}, found {key}")


def _text(item: dict[str, Any], key: str, where: str) -> str:
    if not isinstance(item[key], str) or not item[key]:
        raise InputError(f"{where}: expected a text, found {_kind(item[key])}")
    return item[key]


def _size(value: Any, where: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 1:
        raise InputError(f"{where}: expected a positive whole number, found {_kind(value)}")
    return value


def _numbers(item: dict[str, Any], key: str, shape: tuple[int, ...]) -> np.ndarray:
    """An array of exactly this shape."""
    expected = f"{'x'.join(map(str, shape))} numbers"
    try:
        array = np.array(item[key])
    except ValueError:
        raise InputError(f"{key}: expected {expected}, found rows of different lengths") from None
    if array.shape != shape or array.dtype.kind not in "if":
        raise InputError(f"{key}: expected {expected}, found {_kind(item[key])}")
    return array.astype(np.float64)


def _kind(value: Any) -> str:
    """A short form of a JSON value, for messages."""
    text = json.dumps(value)
    return text if len(text) <= 40 else f"{text[:37]}..."

"""Feature points as a NumPy file (.npz), found again by a digest of what they were made of."""

import hashlib
import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict
from functools import cache
from pathlib import Path

import numpy as np

import fairing.features
from fairing.errors import InputError
from fairing.features.find import Progress, find_points
from fairing.features.options import FeatureOptions
from fairing.features.points import FeaturePoints
from fairing.io.atomic import write_atomically
from fairing.io.capture import reading
from fairing.lens import Lens
from fairing.photo import FilePhoto, Photo, ResizedPhoto, UndistortedPhoto
from fairing.scene import View
from fairing.util.npz import read_npz

_ARRAYS = {  # name: (shape of an item, kind)
    "positions": ((3,), "f"), "covariance": ((3, 3), "f"), "colors": ((3,), "u"), "offsets": ((), "iu"),
    "photos": ((), "iu"), "pixels": ((2,), "f"), "residual": ((), "f"),
}  # fmt: skip
_TEXTS = ("reason", "key")


def points_key(views: Sequence[View], options: FeatureOptions) -> str:
    """64 hexadecimal digits that change with photos, masks, cameras, options and the code that finds points.

    A photo in a file counts as unchanged while its name, size and time of modification are.
    """
    digest = hashlib.sha256(_code_digest())
    digest.update(json.dumps(asdict(options), sort_keys=True).encode())
    for view in views:
        digest.update(view.camera.image_from_world.tobytes())
        parts = [str((view.camera.width, view.camera.height)), _photo_key(view.photo)]
        if view.mask is not None:
            parts += [_photo_key(FilePhoto(path, view.mask.lens)) for path in view.mask.files]
            parts.append(f"{view.mask.resized} {view.mask.orientation} {view.mask.alpha_orientation}")
        digest.update("\n".join(parts).encode() + b"\0")
    return digest.hexdigest()


def save_points(path: Path, points: FeaturePoints, key: str) -> None:
    """Write the points with the digest of what they were made of, complete or not at all.

    Raises:
        InputError: the file cannot be written.
    """
    arrays = {name: getattr(points, name) for name in _ARRAYS}
    facts = {"keypoint_sigma": np.float64(points.keypoint_sigma), "reason": np.str_(points.reason), "key": np.str_(key)}
    write_atomically(path, lambda file: np.savez_compressed(file, **arrays, **facts))


def load_points(path: Path) -> tuple[FeaturePoints, str]:
    """The points of a file and their digest.

    Raises:
        InputError: no such file, or its content makes no sense.
    """
    with reading(path, "feature points"), path.open("rb") as file:
        try:
            found = read_npz(file, (*_ARRAYS, "keypoint_sigma"), _TEXTS)
            sigma, reason, key = (found[name].item() for name in ("keypoint_sigma", *_TEXTS))
            arrays = {name: found[name] for name in _ARRAYS}
        except (ValueError, KeyError) as error:
            raise InputError(f"{path}: expected feature points, cannot be read ({error}); find them again") from None
    n, o = len(arrays["positions"]), len(arrays["photos"])
    length = dict.fromkeys(_ARRAYS, n) | {"offsets": n + 1, "photos": o, "pixels": o}
    for name, (item, kind) in _ARRAYS.items():
        array = arrays[name]
        if array.shape != (length[name], *item) or array.dtype.kind not in kind:
            raise InputError(
                f"{path}: {name}: expected shape {(length[name], *item)}, found {array.shape} of {array.dtype}; "
                "find the points again"
            )
    offsets = arrays["offsets"]
    if offsets[0] != 0 or offsets[-1] != o or (np.diff(offsets) < 0).any():
        raise InputError(f"{path}: offsets: expected 0 to {o} in ascending order; find the points again")
    return FeaturePoints(**arrays, keypoint_sigma=sigma, reason=reason), key


def find_points_once(
    views: Sequence[View],
    path: Path,
    options: FeatureOptions | None = None,
    threads: int = 0,
    on_progress: Progress | None = None,
    cancel_requested: Callable[[], bool] | None = None,
    is_cache: bool = False,
    found: FeaturePoints | None = None,
) -> FeaturePoints:
    """The points of a file where they were made of the same photos, cameras and options; else found and written there.

    Arguments and exceptions as of `find_points`; further:

    Args:
        is_cache: create missing folders of the file; a file that cannot be written is no error.
        found: what `find_points` returned for these arguments; it is written.

    Raises:
        InputError: the file cannot be written.
    """
    options = options or FeatureOptions()
    key = points_key(views, options)
    try:
        points, found_key = load_points(path)
        if found_key == key:
            return points
    except InputError:
        pass  # missing, damaged or of another version
    points = found if found is not None else find_points(views, options, threads, on_progress, cancel_requested)
    if is_cache:
        with suppress(OSError, InputError):
            path.parent.mkdir(parents=True, exist_ok=True)
            save_points(path, points, key)
    else:
        save_points(path, points, key)
    return points


def _photo_key(photo: Photo) -> str:
    """What identifies a photo's pixels."""
    if isinstance(photo, ResizedPhoto):
        return f"{_photo_key(photo.whole)} {photo.size}"
    if isinstance(photo, UndistortedPhoto):
        return f"{_photo_key(photo.whole)} {_lens_key(photo.lens)}"
    if isinstance(photo, FilePhoto):
        try:
            status = photo.path.stat()
        except OSError as error:
            raise InputError(f"photo {photo.path}: cannot be read ({error.strerror}); check the image folder") from None
        bent = "" if photo.lens is None else _lens_key(photo.lens)
        return f"{photo.path.name} {status.st_size} {status.st_mtime_ns} {photo.orientation} {bent}"
    pixels = np.ascontiguousarray(photo.full_depth())
    return f"{pixels.shape} {hashlib.sha256(pixels.data).hexdigest()}"


def _lens_key(lens: Lens) -> str:
    return f"{lens.model} {lens.K.tolist()} {lens.distortion.tolist()}"


@cache
def _code_digest() -> bytes:
    """Changes whenever the code that finds points does."""
    sources = sorted(Path(fairing.features.__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).digest()

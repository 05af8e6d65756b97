"""Captures from the photos, lenses and poses that other programs write.

Shared by their readers: locating the photos, naming the views, rescaling cameras of resized photos, and undistorting
observations.
"""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fairing.camera import Camera
from fairing.errors import InputError
from fairing.io.capture import Capture, listed, naming
from fairing.lens import Lens
from fairing.photo import FilePhoto, Mask
from fairing.scene import SparsePoints, View

_RESIZED = 0.9
"""A photo counts as resized if its size differs at least by this factor; a smaller difference is an error."""


@dataclass(frozen=True, eq=False)
class CalibratedPhoto:
    """A photo file, its lens (pixel centres at integers) and its pose.

    Attributes:
        R, t: camera from world, axes x right, y down, z forward: (3, 3) and (3,) float, world units.
        mask: an image of the distorted photo's size, black where the photo is ignored.
    """

    path: Path
    lens: Lens
    R: np.ndarray
    t: np.ndarray
    mask: Path | None = None


@dataclass(frozen=True, eq=False)
class ObservedPoints:
    """Points of a reconstruction with their observations in the distorted photos.

    Attributes:
        positions: (n, 3) float, world units.
        colors: (n, 3) uint8, RGB.
        observations: (o, 2) int: a point's index and a photo's index.
        pixels: (o, 2) float: distorted pixels of the observations, pixel centres at integers.
    """

    positions: np.ndarray
    colors: np.ndarray
    observations: np.ndarray
    pixels: np.ndarray


def pose_of_center(R: np.ndarray, C: np.ndarray) -> np.ndarray:
    """t (3,), world units, of a camera with rotation R (3, 3) and centre C (3,), so that x = R X + t.

    The result may be infinite; `Camera` refuses it.
    """
    with np.errstate(all="ignore"):
        return -R @ C


def find_photo(written: str, folders: Iterable[Path]) -> Path:
    """The photo file that a camera file refers to, possibly by a path on another machine.

    Args:
        written: the path in the file: absolute or relative to one of the folders, with slashes or backslashes.
        folders: folders to search, together with their `images/`; a file of the same name there is accepted.

    Raises:
        InputError: there is no such photo.
    """
    name = written.replace("\\", "/")
    folders = list(dict.fromkeys(folders))
    inside = [place for folder in folders for place in (folder, folder / "images")]
    candidates = [place / name for place in inside] + [place / name.rsplit("/", 1)[-1] for place in inside]
    for candidate in candidates:
        if _is_file(candidate):
            return Path(os.path.normpath(candidate))
    raise InputError(f"photo {written}: expected an image file, found none there nor in {listed(inside)}; put it there")


def build_capture(
    photos: Sequence[CalibratedPhoto], points: ObservedPoints | None = None, warnings: tuple[str, ...] = ()
) -> Capture:
    """The capture with its views sorted by name; names are paths relative to the photos' common folder.

    Raises:
        InputError: there are no photos, one cannot be read, or a size or pose is invalid.
    """
    if not photos:
        raise InputError("expected photos with cameras, found none")
    root = os.path.commonpath([os.path.abspath(photo.path.parent) for photo in photos])
    names = [Path(os.path.relpath(photo.path, root)).as_posix() for photo in photos]
    order = sorted(range(len(photos)), key=names.__getitem__)
    views, resized = [], []
    for i in order:
        photo = photos[i]
        with naming(f"photo {names[i]}"):
            lens = _at_size(photo.lens, *FilePhoto(photo.path).size)
            if lens is not photo.lens:
                resized.append(names[i])
            camera = Camera.from_krt(lens.pinhole_K, photo.R, photo.t, lens.width, lens.height)
            bent = lens if lens.is_distorted else None
            mask = None if photo.mask is None else Mask(photo.mask, bent)
            views.append(View(names[i], camera, FilePhoto(photo.path, bent), mask))
    if resized:
        warnings = (
            *warnings,
            f"photos of another size than calibrated, cameras scaled with them: {len(resized)} ({listed(resized)})",
        )
    sparse = _sparse_points(points, photos, order, views) if points is not None and len(points.positions) else None
    return Capture(tuple(views), sparse, warnings)


def _at_size(lens: Lens, width: int, height: int) -> Lens:
    """The lens scaled to a photo of this size, if it can be the calibrated photo resized; else the lens unchanged."""
    factor = width / lens.width
    is_resized = not _RESIZED < factor < 1 / _RESIZED
    # Programs round the sizes to whole pixels.
    if is_resized and abs(height - factor * lens.height) <= 1:
        return lens.resized(width, height)
    return lens


def _sparse_points(
    points: ObservedPoints, photos: Sequence[CalibratedPhoto], order: list[int], views: list[View]
) -> SparsePoints:
    """The points with undistorted observations in the order of the views; observations without a ray are dropped."""
    if not np.isfinite(points.positions).all():
        raise InputError("sparse points: expected finite positions, found NaN or infinity")
    if not np.isfinite(points.pixels).all():
        raise InputError("sparse points: expected finite observations, found NaN or infinity")
    observations, pixels = [], []
    for v, (i, view) in enumerate(zip(order, views, strict=True)):
        mine = points.observations[:, 1] == i
        lens = photos[i].lens.resized(view.camera.width, view.camera.height)
        scale = np.array([view.camera.width / photos[i].lens.width, view.camera.height / photos[i].lens.height])
        straight = lens.undistort((points.pixels[mine] + 0.5) * scale - 0.5)
        found = np.isfinite(straight).all(axis=1)
        observations.append(np.column_stack([points.observations[mine, 0], np.full(mine.sum(), v)])[found])
        pixels.append(straight[found])
    return SparsePoints(points.positions, points.colors, np.concatenate(observations), np.concatenate(pixels))


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name too long, or with a NUL
        return False

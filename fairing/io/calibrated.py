"""Captures from the photos, lenses and poses that other programs write.

Shared by their readers: naming the views, rescaling cameras of resized photos, turning photos upright, and undistorting
observations.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fairing.camera import Camera
from fairing.errors import InputError
from fairing.io.capture import Capture, MissingPhoto, listed, naming
from fairing.io.find_photo import MissingFile
from fairing.lens import Lens
from fairing.photo import FilePhoto, Mask, mask_orientation
from fairing.scene import SparsePoints, View
from fairing.util.orientation import AS_STORED, swaps_sides

_RESIZED = 0.9
"""A photo counts as resized if its size differs at least by this factor; a smaller difference is an error."""


@dataclass(frozen=True, eq=False)
class CalibratedPhoto:
    """A photo file, its lens (pixel centres at integers) and its pose.

    Attributes:
        path: the file, or the reason why there is none.
        R, t: camera from world, axes x right, y down, z forward: (3, 3) and (3,) float, world units.
        mask: an image of the distorted photo's size, black where the photo is ignored.
    """

    path: Path | MissingFile
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


def build_capture(
    photos: Sequence[CalibratedPhoto], points: ObservedPoints | None = None, warnings: tuple[str, ...] = ()
) -> Capture:
    """The capture with its views sorted by name; names are paths relative to the photos' common folder.

    Raises:
        InputError: there are no photos, one cannot be read, or a size or pose is invalid.
    """
    if not photos:
        raise InputError("expected photos with cameras, found none")
    names = _names(photos)
    order = sorted(range(len(photos)), key=names.__getitem__)
    views, resized = [], []
    for i in order:
        photo = photos[i]
        with naming(f"photo {names[i]}"):
            views.append(build_view(names[i], photo))
            if (views[-1].camera.width, views[-1].camera.height) != (photo.lens.width, photo.lens.height):
                resized.append(names[i])
    warnings = (*warnings, *resized_note(resized))
    sparse = _sparse_points(points, photos, order, views) if points is not None and len(points.positions) else None
    return Capture(tuple(views), sparse, warnings)


def build_view(name: str, photo: CalibratedPhoto) -> View:
    """The view of a photo, which may have another size than calibrated, or be stored turned with an orientation tag.

    Where the photo fits its camera as stored, it is taken so; else it is turned if it then fits.

    Raises:
        InputError: the photo cannot be read, or its size or pose is invalid.
    """
    if isinstance(photo.path, MissingFile):
        lens, source = photo.lens, MissingPhoto((photo.lens.width, photo.lens.height), photo.path.error)
    else:
        source = FilePhoto(photo.path)
        lens = _at_size(photo.lens, *source.size)
        if (lens.width, lens.height) != source.size and swaps_sides(other := source.other_orientation):
            turned = FilePhoto(photo.path, orientation=other)
            scaled = _at_size(photo.lens, *turned.size)
            if (scaled.width, scaled.height) == turned.size:
                lens, source = scaled, turned
        if lens.is_distorted:
            source = replace(source, lens=lens)
    camera = Camera.from_krt(lens.pinhole_K, photo.R, photo.t, lens.width, lens.height)
    mask = None
    if photo.mask is not None:
        orientation = mask_orientation(photo.mask, source) if isinstance(source, FilePhoto) else AS_STORED
        mask = Mask(photo.mask, lens if lens.is_distorted else None, orientation=orientation)
    return View(name, camera, source, mask)


def undistorted(pixels: np.ndarray, lens: Lens, view: View) -> np.ndarray:
    """Pixels (n, 2) of the view from pixels (n, 2) of the distorted photo at its calibrated size; NaN where no ray is."""
    scale = np.array([view.camera.width / lens.width, view.camera.height / lens.height])
    return lens.resized(view.camera.width, view.camera.height).undistort((pixels + 0.5) * scale - 0.5)


def resized_note(names: Sequence[str]) -> tuple[str, ...]:
    """The note about photos of another size than calibrated."""
    if not names:
        return ()
    return (f"photos of another size than calibrated, cameras scaled with them: {len(names)} ({listed(names)})",)


def _names(photos: Sequence[CalibratedPhoto]) -> list[str]:
    """Paths relative to the common folder of the photos that exist; of the others the file names."""
    parents = [os.path.abspath(photo.path.parent) for photo in photos if isinstance(photo.path, Path)]
    root = os.path.commonpath(parents) if parents else ""
    return [
        Path(os.path.relpath(photo.path, root)).as_posix() if isinstance(photo.path, Path) else photo.path.name
        for photo in photos
    ]


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
        straight = undistorted(points.pixels[mine], photos[i].lens, view)
        found = np.isfinite(straight).all(axis=1)
        observations.append(np.column_stack([points.observations[mine, 0], np.full(mine.sum(), v)])[found])
        pixels.append(straight[found])
    return SparsePoints(points.positions, points.colors, np.concatenate(observations), np.concatenate(pixels))

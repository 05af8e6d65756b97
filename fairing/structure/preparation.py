"""Photos prepared for structure from motion: upright, reduced, under names that every program can read, with their masks."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from fairing.camera import Camera
from fairing.errors import Cancelled, InputError
from fairing.io.atomic import write_atomically
from fairing.io.mask_files import masks_of
from fairing.photo import FilePhoto, Mask, Photo, ResizedPhoto
from fairing.scene import View
from fairing.structure.photo_set import PhotoFile, PhotoSet

PHOTOS, MASKS = "images", "masks"
"""Folders of the prepared photos and of their masks, in COLMAP's layout."""


def prepared_name(index: int) -> str:
    """File name of a prepared photo. It has no blanks, which separate names in COLMAP's files."""
    return f"{index:05d}.png"


def prepared_size(photo: PhotoFile, largest_side: int) -> tuple[int, int]:
    """(width, height) in pixels of a prepared photo."""
    scale = min(1.0, largest_side / max(photo.size))
    width, height = (max(1, round(scale * side)) for side in photo.size)
    return width, height


def prepare_photos(
    photos: PhotoSet,
    source: Path,
    work: Path,
    largest_side: int,
    on_photo: Callable[[int], None],
    cancel_requested: Callable[[], bool],
) -> dict[int, str]:
    """Write photos and masks to a working folder; those that are there already are kept.

    Args:
        source: the folder that the photos were found in; masks are searched in it as for any capture.
        on_photo: called with the number of finished photos.

    Returns:
        The reason by index of photos that cannot be decoded.

    Raises:
        InputError: a file cannot be written.
        Cancelled: `cancel_requested` returned True.
    """
    for folder in (work / PHOTOS, work / MASKS):
        folder.mkdir(parents=True, exist_ok=True)
    masks, damaged = _masks(photos, source), {}
    for i, photo in enumerate(photos.photos):
        if cancel_requested():
            raise Cancelled
        size, target = prepared_size(photo, largest_side), work / PHOTOS / prepared_name(i)
        try:
            mask, mask_file = masks[i], work / MASKS / f"{prepared_name(i)}.png"
            if mask is not None and not mask_file.exists():
                counts = replace(mask, resized=size).load()
                _write_png(mask_file, counts.astype(np.uint8) * 255)
            if not target.exists():
                whole: Photo = FilePhoto(photo.path, orientation=photo.shot.orientation)
                _write_png(target, (whole if size == photo.size else ResizedPhoto(whole, size)).load())
        except InputError as error:
            if not str(error).startswith(("photo ", "mask ")):  # the disk
                raise
            damaged[i] = str(error).removeprefix(f"photo {photo.path}: ")
        on_photo(i + 1)
    return damaged


def _masks(photos: PhotoSet, source: Path) -> list[Mask | None]:
    """The mask of each photo, found as those of a capture are."""
    views = []
    for photo in photos.photos:
        width, height = photo.size
        K = np.array([[width, 0, width / 2], [0, width, height / 2], [0, 0, 1.0]])  # any: no mask depends on it
        camera = Camera.from_krt(K, np.eye(3), np.zeros(3), width, height)
        views.append(View(photo.path.name, camera, FilePhoto(photo.path, orientation=photo.shot.orientation)))
    return masks_of(views, range(len(views)), None, source)[0]


def _write_png(path: Path, pixels: np.ndarray) -> None:
    image = Image.fromarray(pixels)
    write_atomically(path, lambda file: image.save(file, format="PNG", compress_level=1))

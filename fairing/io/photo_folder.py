"""Folders of photos without cameras: what is recognized as one, and its photo files."""

from pathlib import Path

from fairing.image_file import HEIF_SUFFIXES, PHOTO_SUFFIXES
from fairing.io.capture import files_in, reading
from fairing.io.find_photo import PHOTO_FOLDERS
from fairing.io.mask_files import ENDINGS, MASK_FOLDER
from fairing.io.mesh_file import MESH_SUFFIXES

_PHOTOS = PHOTO_SUFFIXES | HEIF_SUFFIXES
_BESIDE_PHOTOS = frozenset({".aae", ".mov", ".mp4", ".thm", ".xmp"})
"""Files that phones and cameras write beside photos."""


def photos_alone(path: Path) -> list[Path]:
    """The photos of a folder, or a photo, without anything that could describe cameras; else none."""
    if path.is_file():
        return [path] if path.suffix.lower() in _PHOTOS else []
    folders = (*PHOTO_FOLDERS, MASK_FOLDER)
    with reading(path, "a folder"):
        others = [
            entry
            for entry in path.iterdir()
            if entry.suffix.lower() not in _PHOTOS | MESH_SUFFIXES | _BESIDE_PHOTOS
            and not (entry.name in folders or entry.name.startswith("."))
        ]
    return [] if others else photo_files(path)


def photo_files(folder: Path) -> list[Path]:
    """The photos in a folder, or in its `images/` or `photos/` if these hold more; masks beside photos are left out.

    Raises:
        InputError: the folder cannot be read.
    """
    found = max((files_in(place, _PHOTOS) for place in (folder, *(folder / name for name in PHOTO_FOLDERS))), key=len)
    bases = {name for file in found for name in (file.stem, file.name)}
    return [
        file
        for file in found
        if not any(file.stem.endswith(end) and file.stem.removesuffix(end) in bases for end in ENDINGS)
    ]

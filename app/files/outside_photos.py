"""Photos outside the capture folder: a file of a capture may name any image of the disk, which exports would then carry."""

from collections.abc import Sequence
from pathlib import Path

from app.files.named_scenes import is_named
from fairing.io.capture import listed
from fairing.photo import FilePhoto, Photo, ResizedPhoto
from fairing.scene import View

_PART_FOLDERS = ("sparse", "cameras", "models", "colmap", "dense", "openmvg", "bundle")
"""Names, in lower case, of folders within a capture that hold its cameras; COLMAP numbers its models as well."""


def outside_photos(scene: str, views: Sequence[View]) -> str:
    """A line about photos that lie outside the capture folder, links resolved; empty if there are none.

    Args:
        scene: name of a demo, or path of a capture's folder or file.
    """
    if is_named(scene):
        return ""
    folder = capture_folder(Path(scene))
    paths = [path for view in views if (path := _path_of(view.photo)) is not None]
    outside = [path for path in paths if not path.resolve().is_relative_to(folder)]
    if not outside:
        return ""
    return (
        f"{len(outside)} photos lie outside the capture folder {folder} ({listed(outside)}); what is written shows them"
    )


def capture_folder(path: Path) -> Path:
    """The folder of a capture, links resolved, of the folder or file that is opened, which may be a part of it."""
    folder = path.resolve() if path.is_dir() else path.resolve().parent
    while folder.name.lower() in _PART_FOLDERS or folder.name.isdigit():
        folder = folder.parent
    return folder


def _path_of(photo: Photo) -> Path | None:
    """The file of a photo; None for a photo in memory."""
    if isinstance(photo, ResizedPhoto):
        return _path_of(photo.whole)
    return photo.path if isinstance(photo, FilePhoto) else None

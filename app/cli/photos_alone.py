"""Photos without cameras, where a command expects a scene: a capture is made of them first."""

import hashlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from app.cli.interrupt import Interrupt
from app.cli.lines import print_line
from app.cli.loading import ShowProgress, load_with_bar
from app.files.named_scenes import is_named
from app.files.scene_source import SceneSource
from fairing.errors import Cancelled
from fairing.io.find_photo import PHOTO_FOLDERS
from fairing.io.photo_folder import photos_alone
from fairing.util.cache_folder import cache_folder

if TYPE_CHECKING:
    from fairing.structure.reconstruction import PlacedPhotos


def with_cameras(
    source: SceneSource,
    console: Console,
    folder: Path | None = None,
    show: ShowProgress = lambda line, fraction: None,
) -> SceneSource:
    """The source as it is; of photos alone that of the capture made of them, with a progress bar and lines about the result.

    Ctrl-C cancels; the next call continues.

    Args:
        folder: for the capture, below it; default: in the user's cache folder.
        show: called with the line and the remaining time, and the finished part, a few times a second.

    Raises:
        InputError: see `fairing.structure.reconstruction.capture_of_photos`.
        KeyboardInterrupt: Ctrl-C was pressed.
    """
    if not is_photos_alone(source):
        return source
    # Imported on first use: the page is served before the engine is loaded.
    from fairing.structure.reconstruction import capture_of_photos

    photos, cached = Path(source.scene), _cached(Path(source.scene))
    out = cached if folder is None else folder / cached.name
    print_line(console, f"{photos} has no cameras: they are computed, and the capture is written to {out}")
    interrupt = Interrupt()

    def placed_photos(progress: Callable[[float, str], None]) -> "PlacedPhotos":
        return capture_of_photos(photos, out, None, progress, lambda: interrupt.requested, cached)

    try:
        with interrupt.listening():
            placed = load_with_bar(f"photos in {photos}", placed_photos, console, show)
    except Cancelled:
        print_line(console, "the same command continues to compute the cameras")
        raise KeyboardInterrupt from None
    for line in placed.lines():
        print_line(console, line)
    return replace(source, scene=str(out.resolve()))


def is_photos_alone(source: SceneSource) -> bool:
    """Whether the scene of a source is a folder of photos without cameras."""
    folder = Path(source.scene)
    if is_named(source.scene) or not folder.is_dir() or not photos_alone(folder):
        return False
    from fairing.io.load import is_capture  # cameras may lie among the photos; imported on first use: it takes a second

    return not is_capture(folder)


def check_openable(source: SceneSource) -> None:
    """Check that a scene can be opened as far as its files' kinds show, before a page is announced for it.

    Raises:
        InputError: it holds no cameras in a supported format; or photos alone, but too few or without pycolmap.
    """
    if is_named(source.scene):
        return
    if not is_photos_alone(source):
        from fairing.io.load import check_recognized

        check_recognized(Path(source.scene))
        return
    from fairing.structure.photo_set import read_photo_set
    from fairing.structure.reconstruction import check_pycolmap

    folder = Path(source.scene)
    photos = read_photo_set(folder)
    check_pycolmap(folder, len(photos.photos))


def _cached(photos: Path) -> Path:
    """The folder in the user's cache for the capture of these photos, which has their folder's name."""
    digest = hashlib.sha256(str(photos).encode("utf-8", "surrogateescape")).hexdigest()[:16]
    name = photos.parent.name if photos.name in PHOTO_FOLDERS else photos.name
    return cache_folder() / "captures" / digest / (name or "photos")

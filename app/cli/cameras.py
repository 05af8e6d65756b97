"""`cameras`: a capture from photos alone."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from app.cli.interrupt import Interrupt
from app.cli.lines import print_line
from app.cli.loading import load_with_bar
from fairing.errors import Cancelled
from fairing.structure.options import StructureOptions
from fairing.structure.reconstruction import PlacedPhotos, capture_of_photos

DEFAULTS = StructureOptions()


def cameras(
    photos: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="PHOTOS", help="A folder of photos.")],
    out: Path,
    options: Annotated[StructureOptions, tyro.conf.arg(name="")] = DEFAULTS,
) -> int:
    """Compute the cameras of photos (structure from motion with pycolmap) and write a capture: images/ and sparse/.

    Needs `pip install "eigenfairing[photos]"`. An interrupted command continues where it was when it is given again.

    Args:
        out: Folder for the capture: new, empty, or of an earlier command.
    """
    return cameras_to_folder(photos, out, options, Console(stderr=True))


def cameras_to_folder(photos: Path, out: Path, options: StructureOptions, console: Console) -> int:
    """Compute the cameras with a progress bar; Ctrl-C cancels.

    Returns:
        Exit code: 0, or 130 after a cancellation.

    Raises:
        InputError: see `capture_of_photos`.
    """
    interrupt = Interrupt()
    try:
        with interrupt.listening():
            placed = place_with_bar(photos, out, options, console, lambda: interrupt.requested)
    except Cancelled:
        print_line(console, "cancelled; the same command continues")
        return 130
    for line in [*placed.lines(), f"wrote {out}"]:
        print_line(console, line)
    return 0


def place_with_bar(
    photos: Path,
    out: Path,
    options: StructureOptions,
    console: Console,
    cancel_requested: Callable[[], bool] = lambda: False,
    show: Callable[[str, float | None], None] = lambda line, fraction: None,
) -> PlacedPhotos:
    """The capture of photos, written with a progress bar; arguments and exceptions as of `capture_of_photos`.

    Args:
        show: called with the line and the remaining time, and the finished part, a few times a second.
    """
    return load_with_bar(
        str(photos),
        lambda progress: capture_of_photos(photos, out, options, progress, cancel_requested),
        console,
        show,
    )

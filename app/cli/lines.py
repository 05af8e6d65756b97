"""Lines on the terminal, printed as they are: no highlighting, no wrapping, no markup."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.console import Console

if TYPE_CHECKING:
    from fairing.scene import View


def print_line(console: Console, line: str) -> None:
    """Print a line. Brackets in names of files are not read as markup."""
    console.print(line, highlight=False, soft_wrap=True, markup=False)


def note_outside_photos(console: Console, scene: str, views: "Sequence[View]") -> None:
    """Print a line if photos that are about to be written lie outside the capture folder; see `outside_photos`."""
    from app.files.outside_photos import outside_photos  # imported on first use: it loads OpenCV

    line = outside_photos(scene, views)
    if line:
        print_line(console, f"note: {line}")

"""The folder that `fair` and `triangulate` write corrected cameras to."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from app.cli.lines import print_line
from fairing.cameras.corrected_scene import found_lens
from fairing.errors import InputError
from fairing.io.colmap_write import FILES, write_text_model
from fairing.scene import SparsePoints, View


def write_cameras(views: Sequence[View] | None, points: SparsePoints | None, folder: Path, console: Console) -> None:
    """Write corrected cameras as a COLMAP model, and remove the model of an earlier run if there are none.

    Args:
        views: the photos with their corrected cameras; None if they have the given ones.

    Raises:
        InputError: a file cannot be written.
    """
    for name in FILES:
        (folder / name).unlink(missing_ok=True)
    if views is None:
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
        return
    try:
        write_text_model(folder, views, points, [found_lens(view) for view in views])
    except InputError as error:
        print_line(console, f"note: the corrected cameras are not written: {error}")
        return
    print_line(console, f"wrote {folder}")

"""The folder that `fair` writes refined cameras to."""

from pathlib import Path

from rich.console import Console

from app.cli.lines import print_line
from fairing.errors import InputError
from fairing.io.colmap_write import FILES, write_text_model
from fairing.scene import Scene


def write_cameras(scene: Scene, folder: Path, console: Console) -> None:
    """Write the corrected cameras of a scene as a COLMAP model, and remove the model of an earlier run if there are none.

    Raises:
        InputError: a file cannot be written.
    """
    for name in FILES:
        (folder / name).unlink(missing_ok=True)
    if scene.cameras_origin == "given":
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
        return
    try:
        write_text_model(folder, scene.views, scene.sparse_points)
    except InputError as error:
        print_line(console, f"note: the corrected cameras are not written: {error}")
        return
    print_line(console, f"wrote {folder}")

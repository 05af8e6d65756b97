"""`fair --cameras refine`: a session with refined cameras, and the folder they are written to."""

from collections.abc import Callable
from pathlib import Path

from rich.console import Console

from app.cli.lines import print_line
from app.cli.loading import open_session
from app.files.scene_source import SceneSource
from fairing.cameras.refinement import Refinement, refine
from fairing.errors import InputError
from fairing.io.colmap_write import FILES, write_text_model
from fairing.judge.report import REFINEMENT
from fairing.options import FairingOptions
from fairing.run.session import Session
from fairing.scene import Scene


def open_session_with_refined_cameras(source: SceneSource, console: Console, options: FairingOptions) -> Session:
    """A new session on the scene of a source after refinement of its cameras, which is noted in the trace's header.

    Raises:
        InputError: the scene or an option cannot be used.
    """
    found: list[Refinement] = []

    def load(progress: Callable[[float, str], None]) -> Scene:
        found.append(refine(source.load(progress), options.threads, progress))
        return found[0].scene

    session = open_session(source, console, options, load=load)
    session.trace.header[REFINEMENT] = found[0].facts()
    print_line(console, found[0].reason)
    return session


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

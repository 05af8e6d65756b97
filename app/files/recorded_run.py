"""Finding a recorded run and its scene."""

from pathlib import Path

from app.files.run_files import TRACE
from app.files.scene_source import SceneSource
from fairing.io import PhotoChoice
from fairing.trace import Trace


def find_run(run: Path, scene: str | None, mesh: Path | None, photos: PhotoChoice) -> tuple[Trace, SceneSource, Path]:
    """The record in a folder that `fair` wrote, or in a trace, where its scene is, and the path of the trace.

    Args:
        scene, mesh, photos: as typed; see `SceneSource.of_replay`.

    Raises:
        InputError: there is no run, or nobody says which scene it was recorded on.
    """
    path = run / TRACE if run.is_dir() else run
    trace = Trace.load(path)
    return trace, SceneSource.of_replay(trace.header, path, scene, mesh, photos), path

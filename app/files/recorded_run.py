"""Recorded runs: the trace in a folder or file, and the source of its scene."""

from pathlib import Path

from app.files.run_files import TRACE
from app.files.scene_source import SceneSource
from fairing.io import PhotoChoice
from fairing.trace import Trace


def find_run(run: Path, scene: str | None, mesh: Path | None, photos: PhotoChoice) -> tuple[Trace, SceneSource, Path]:
    """The trace, the source of its scene, and the path of the trace.

    Args:
        run: the folder that `fair` wrote, or a trace file.
        scene, mesh, photos: as typed; see `SceneSource.of_replay`.

    Raises:
        InputError: there is no run, or neither the run nor the arguments name its scene.
    """
    path = run / TRACE if run.is_dir() else run
    trace = Trace.load(path)
    return trace, SceneSource.of_replay(trace.header, path, scene, mesh, photos), path

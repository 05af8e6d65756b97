"""Mesh series: mesh files of another program, in their order, on the photos of a capture."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.files.scene_source import SceneSource
from demo_scenes import is_demo
from fairing.errors import InputError
from fairing.io import PhotoChoice

if TYPE_CHECKING:
    from fairing.mesh import Mesh
    from fairing.run.session import Session


@dataclass(frozen=True)
class MeshSeries:
    """Attributes:
    source: of the scene, with the mesh whose faces are shown.
    meshes: as read.
    """

    source: SceneSource
    meshes: "tuple[Mesh, ...]"

    def session(self, on_progress: Callable[[float, str], None]) -> "Session":
        """The session of the meshes; it may take seconds for each of them.

        Raises:
            InputError: the scene or a mesh cannot be used.
        """
        from fairing.run.snapshots import session_of_meshes  # imported on first use: the page is served before

        session = session_of_meshes(self.source.load(on_progress), self.meshes, on_progress)
        self.source.note_in(session.trace.header)
        return session


def open_series(capture: str, files: Sequence[Path], faces: Path | None, photos: PhotoChoice) -> MeshSeries:
    """Read mesh files.

    Args:
        capture: photos and cameras, as typed.
        faces: the mesh whose faces are shown; default: the last file, of a demo its own mesh.

    Raises:
        InputError: a file cannot be read, or there are fewer than two.
    """
    from fairing.io.capture import naming
    from fairing.io.mesh_file import read_mesh
    from fairing.mesh import Mesh

    if len(files) < 2:
        raise InputError(f"--meshes: expected at least two mesh files and a capture, found {len(files)} mesh files")
    meshes = []
    for file in files:
        with naming(file):
            meshes.append(Mesh(*read_mesh(file)))
    source = SceneSource.typed(capture, None, photos)
    if not is_demo(source.scene):  # a demo shows its own faces
        source = replace(source, mesh=str((faces or files[-1]).resolve()))
    return MeshSeries(source, tuple(meshes))

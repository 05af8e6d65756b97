"""Mesh series: mesh files of another program, in their order, on the photos of a capture."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.files.named_scenes import is_named
from app.files.scene_source import SceneSource
from fairing.errors import InputError
from fairing.io import PhotoChoice
from fairing.io.points_choice import PointsChoice

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
    if len(files) < 2:
        raise InputError(f"--meshes: expected at least two mesh files and a capture, found {len(files)} mesh files")
    return MeshSeries(source_of_meshes(capture, faces or files[-1], photos), tuple(read_meshes(files)))


def source_of_meshes(capture: str, mesh: Path, photos: PhotoChoice, points: PointsChoice = "given") -> SceneSource:
    """The source of photos, cameras and sparse points for meshes, with one of them; a demo has its own mesh."""
    source = SceneSource.typed(capture, None, photos, points)
    return source if is_named(source.scene) else replace(source, mesh=str(mesh.resolve()))


def read_meshes(files: Sequence[Path]) -> "list[Mesh]":
    """The meshes of files as read.

    Raises:
        InputError: a file cannot be read, or its mesh cannot be used.
    """
    from fairing.io.capture import naming
    from fairing.io.mesh_file import read_mesh
    from fairing.mesh import Mesh

    meshes = []
    for file in files:
        with naming(file):
            meshes.append(Mesh(*read_mesh(file)))
    return meshes

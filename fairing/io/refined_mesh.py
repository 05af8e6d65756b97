"""The mesh of a run as files: as PLY, and in the format of the mesh it began with, with all of its attributes."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from fairing.errors import InputError
from fairing.io.capture import reading
from fairing.io.mesh_file import MESH_SUFFIXES, own_suffix, write_mesh
from fairing.scene import Scene


class WrittenMesh(NamedTuple):
    """What was written.

    Attributes:
        files: the PLY first.
        notes: why attributes are not kept, one line each.
    """

    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()


def write_refined_mesh(path: Path, scene: Scene, vertices: np.ndarray) -> WrittenMesh:
    """Write welded vertices (n, 3) float, world units, as PLY with the vertices, order and faces of the scene's input.

    A mesh that was read from a file of another format is also written in that format, beside the PLY. An own-format file of an
    earlier run is removed. Where the input cannot be read any more, the mesh is written without its attributes.

    Args:
        path: of the PLY.

    Raises:
        InputError: the PLY cannot be written.
    """
    positions, faces, like = scene.unweld(vertices), scene.original_faces, scene.mesh_file
    try:
        files = write_mesh(path, positions, faces, like=like)
        if like is not None and own_suffix(like) != path.suffix:
            files += write_mesh(path.with_suffix(own_suffix(like)), positions, faces, like=like)
        notes = ()
    except InputError as error:
        files = write_mesh(path, positions, faces)
        notes = (f"the mesh is written without the attributes of the one that was read: {error}",)
    for other in {path.with_suffix(suffix) for suffix in MESH_SUFFIXES} - set(files):
        with reading(other, "a file that may be replaced"):
            other.unlink(missing_ok=True)
    return WrittenMesh(files, notes)

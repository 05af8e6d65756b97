"""Loading a scene: photos, cameras and a mesh from a folder, in any supported format."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.geometry.mesh_check import inspect_mesh
from fairing.io import (
    alicevision,
    bundler,
    colmap,
    matrices,
    middlebury,
    openmvg,
    scene_json,
    strecha,
    transforms_json,
)
from fairing.io.capture import Capture, Reader, files_in, listed, naming, reading
from fairing.io.in_view import check_mesh_in_view
from fairing.io.mesh_file import MESH_SUFFIXES, read_mesh
from fairing.io.photo_choice import PhotoChoice, SceneFormat, apply_choice
from fairing.mesh import Mesh
from fairing.scene import Scene

READERS: tuple[Reader, ...] = (
    colmap, bundler, openmvg, alicevision, transforms_json, middlebury, strecha, matrices, scene_json
)  # fmt: skip
"""Supported formats. A new one is a module with the names of `Reader`, added here and to `SceneFormat`."""
_BY_FILE_NAME: dict[str, Reader] = {
    "scene.json": scene_json,
    "transforms.json": transforms_json,
    "transforms_train.json": transforms_json,
}
"""Files that are read for their name where nothing is recognised by content, so that the error names what is damaged."""


def load_scene(
    path: str | Path,
    mesh: str | Path | None = None,
    choice: PhotoChoice | None = None,
    without_mesh: Callable[[str, Capture], Scene] | None = None,
    choose_points: Callable[[Capture, int | None], Capture] | None = None,
) -> Scene:
    """The scene in a folder (or a file of it), in any supported format, recognised by content.

    Args:
        path: the folder, or the file that describes the scene.
        mesh: a mesh file; default: the one that the format names, or the only one in the folder.
        choice: the format, photos left out, masks and weights.
        without_mesh: builds the scene from its name and the capture where there is no mesh but sparse points.
        choose_points: returns the capture with the chosen sparse points; called with the capture and the number of the
            mesh's vertices, or None without a mesh; see `fairing.io.scene_points`. Default: the given points.

    Raises:
        InputError: the input cannot be used; the message is one line.
    """
    capture, path = read_capture(path, choice), Path(path)
    folder = path if path.is_dir() else path.parent
    found = Path(mesh) if mesh is not None else capture.mesh
    with_points = choose_points or (lambda capture, n_vertices: capture)
    if found is None and without_mesh is not None and not files_in(folder, MESH_SUFFIXES):
        chosen = with_points(capture, None)
        if chosen.sparse_points is None or len(chosen.sparse_points.positions) == 0:
            raise _no_mesh(folder, chosen.warnings[len(capture.warnings) :])
        scene = without_mesh(path.resolve().name, chosen)
        return replace(scene, warnings=chosen.warnings + scene.warnings)
    mesh_path = found or only_mesh(folder)
    vertices, faces = read_mesh(mesh_path)
    with naming(mesh_path):
        Mesh(vertices, faces)  # validated here so that errors name the file
    name = path.resolve().name
    scene = Scene.build(name, vertices, faces, capture.views)
    with naming(mesh_path):
        facts = inspect_mesh(scene.mesh)
    check_mesh_in_view(scene)
    capture = with_points(capture, len(scene.mesh.vertices))
    scene = replace(scene, sparse_points=capture.sparse_points)
    _, input_vertices = np.unique(scene.original_from_welded, return_index=True)
    return replace(scene, warnings=capture.warnings + facts.warnings(input_vertices))


def read_capture(path: str | Path, choice: PhotoChoice | None = None) -> Capture:
    """The photos and cameras in a folder or file, without a mesh.

    Where a folder holds cameras in several formats, the most complete readable one is returned: the one with the most
    photos, then with sparse points, then with a mesh. A warning names the others. `choice.format` selects one.

    Raises:
        InputError: no such path, no supported format, or none that can be read.
    """
    path, choice = Path(path), choice or PhotoChoice()
    with reading(path, "a scene (a folder or a file of it)"):
        if not path.exists():
            raise FileNotFoundError
        capture = _read(path) if choice.format is None else _read_as(path, choice.format)
    return apply_choice(capture, choice, path if path.is_dir() else path.parent)


def _read(path: Path) -> Capture:
    found: list[tuple[Reader, Capture]] = []
    failed: list[tuple[Reader, InputError]] = []
    for reader in READERS:
        try:
            if reader.recognises(path):
                found.append((reader, reader.read(path)))
        except InputError as error:
            failed.append((reader, error))
    if found:
        chosen, capture = max(found, key=lambda item: _completeness(item[1]))
        others = [f"{reader.NAME} ({len(other.views)} photos)" for reader, other in found if reader is not chosen]
        others += [f"{reader.NAME} (not readable: {error})" for reader, error in failed]
        if not others:
            return capture
        note = f"read as {chosen.NAME} ({len(capture.views)} photos); it also holds {', '.join(others)}: choose with --format"
        return capture._replace(warnings=(*capture.warnings, note))
    if failed:
        raise failed[0][1]
    by_name = _BY_FILE_NAME.get(path.name) if path.is_file() else None
    by_name = by_name or next((reader for name, reader in _BY_FILE_NAME.items() if (path / name).is_file()), None)
    if by_name is not None:
        return by_name.read(path)
    raise _unsupported(path)


def _read_as(path: Path, format: SceneFormat) -> Capture:
    reader = next(reader for reader in READERS if format == reader.NAME)
    if not reader.recognises(path):
        raise InputError(f"--format {format}: expected a {reader.FORMAT} in {path}, found {_contents(path)}")
    return reader.read(path)


def _completeness(capture: Capture) -> tuple[int, bool, bool]:
    has_points = capture.sparse_points is not None and len(capture.sparse_points.positions) > 0
    return len(capture.views), has_points, capture.mesh is not None


def _unsupported(path: Path) -> InputError:
    supported = "; ".join(reader.FORMAT for reader in READERS)
    return InputError(f"{path}: expected one of: {supported}; found {_contents(path)}")


def _contents(path: Path) -> str:
    if path.is_file():
        return "another kind of file"
    with reading(path, "a folder"):
        names = sorted(entry.name + "/" * entry.is_dir() for entry in path.iterdir())
    return listed(names) if names else "an empty folder"


def only_mesh(folder: Path) -> Path:
    """The mesh file in a folder.

    Raises:
        InputError: there is none, or several.
    """
    meshes = files_in(folder, MESH_SUFFIXES)
    if len(meshes) == 1:
        return meshes[0]
    if meshes:
        raise InputError(f"{folder}: expected one mesh, found {listed(p.name for p in meshes)}; choose with --mesh")
    raise _no_mesh(folder)


def _no_mesh(folder: Path, reasons: tuple[str, ...] = ()) -> InputError:
    found = ", ".join(("found none", *reasons))
    return InputError(f"{folder}: expected a mesh ({', '.join(sorted(MESH_SUFFIXES))}), {found}; give one with --mesh")

"""From a folder of photos, cameras and a mesh to a Scene."""

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
from fairing.io.photo_choice import PhotoChoice, apply_choice
from fairing.mesh import Mesh
from fairing.scene import Scene

READERS: tuple[Reader, ...] = (
    colmap, bundler, openmvg, alicevision, transforms_json, middlebury, strecha, matrices, scene_json
)  # fmt: skip
"""Supported formats. A new one is a module with the names of `Reader`, added here."""


def load_scene(
    path: str | Path,
    mesh: str | Path | None = None,
    choice: PhotoChoice | None = None,
    without_mesh: Callable[[str, Capture], Scene] | None = None,
) -> Scene:
    """The scene in a folder (or a file of it), in any supported format, recognised by content.

    Args:
        path: the folder, or the file that describes the scene.
        mesh: a mesh file; without it the one that the format names, or the only one in the folder.
        choice: photos left out, masks and weights.
        without_mesh: makes the scene, of its name and the capture, where no mesh is named or found but sparse points are.

    Raises:
        InputError: whatever is wrong with the input, in one line.
    """
    capture, path = read_capture(path, choice), Path(path)
    folder = path if path.is_dir() else path.parent
    found = Path(mesh) if mesh is not None else capture.mesh
    has_points = capture.sparse_points is not None and len(capture.sparse_points.positions) > 0
    if found is None and without_mesh is not None and has_points and not files_in(folder, MESH_SUFFIXES):
        scene = without_mesh(path.resolve().name, capture)
        return replace(scene, warnings=capture.warnings + scene.warnings)
    mesh_path = found or only_mesh(folder)
    vertices, faces = read_mesh(mesh_path)
    with naming(mesh_path):
        Mesh(vertices, faces)  # whatever is wrong with it is said with the file's name
    name = path.resolve().name
    scene = Scene.build(name, vertices, faces, capture.views, sparse_points=capture.sparse_points)
    with naming(mesh_path):
        facts = inspect_mesh(scene.mesh)
    check_mesh_in_view(scene)
    _, input_vertices = np.unique(scene.original_from_welded, return_index=True)
    return replace(scene, warnings=capture.warnings + facts.warnings(input_vertices))


def read_capture(path: str | Path, choice: PhotoChoice | None = None) -> Capture:
    """The photos and cameras in a folder or file, without a mesh.

    Where cameras of one reconstruction lie in several formats, the one that holds sparse points, too, is read, and the
    others are named in a warning.

    Raises:
        InputError: no such path, no supported format or several, or whatever the reader finds wrong.
    """
    path = Path(path)
    capture = _read(path)
    return apply_choice(capture, choice or PhotoChoice(), path if path.is_dir() else path.parent)


def _read(path: Path) -> Capture:
    with reading(path, "a scene (a folder or a file of it)"):
        if not path.exists():
            raise FileNotFoundError
        matching = [reader for reader in READERS if reader.recognises(path)]
        with_points = [reader for reader in matching if reader.HOLDS_POINTS]
        chosen = with_points if len(with_points) == 1 else matching
        if len(chosen) == 1:
            capture = chosen[0].read(path)
            others = "; ".join(reader.FORMAT for reader in matching if reader is not chosen[0])
            if not others:
                return capture
            note = f"read as {chosen[0].FORMAT}; it also holds {others}: give one of those files to read it instead"
            return capture._replace(warnings=(*capture.warnings, note))
    if matching:
        found = "; ".join(reader.FORMAT for reader in matching)
        raise InputError(f"{path}: expected one scene, found several: {found}; move all but one elsewhere")
    supported = "; ".join(reader.FORMAT for reader in READERS)
    raise InputError(f"{path}: expected one of: {supported}; found {_contents(path)}")


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
    raise InputError(
        f"{folder}: expected a mesh ({', '.join(sorted(MESH_SUFFIXES))}), found none; give one with --mesh"
    )

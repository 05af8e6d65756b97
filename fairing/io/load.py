"""Loading a scene: photos, cameras and a mesh from a folder, in any supported format."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fairing.errors import InputError
from fairing.geometry.mesh_check import inspect_mesh
from fairing.io import (
    alicevision,
    bundler,
    colmap,
    matrices,
    metashape,
    middlebury,
    openmvg,
    opensfm,
    realityscan,
    scene_json,
    strecha,
    transforms_json,
    visualsfm,
)
from fairing.io.capture import Capture, MissingPhoto, Reader, files_in, listed, naming, reading
from fairing.io.in_view import check_mesh_in_view
from fairing.io.mesh_file import MESH_SUFFIXES, has_faces, read_mesh
from fairing.io.mesh_place import in_frame_of_mesh
from fairing.io.named_scenes import module_of_scene, scene_names
from fairing.io.photo_choice import READERS_GROUP, PhotoChoice, apply_choice, format_names
from fairing.io.photo_folder import photos_alone
from fairing.io.points_file import read_points
from fairing.io.scene_points import Progress
from fairing.io.upright import settle_orientations
from fairing.mesh import Mesh
from fairing.scene import Around, BoxCorners, CamerasChoice, PointsChoice, Scene
from fairing.util.plugins import offered
from fairing.weld import Welded, welded

if TYPE_CHECKING:
    from fairing.io.chosen_inputs import ChosenInputs

READERS: tuple[Reader, ...] = (
    colmap, bundler, openmvg, alicevision, opensfm, visualsfm, metashape, realityscan, transforms_json, middlebury, strecha,
    matrices, scene_json,
)  # fmt: skip
"""Supported formats. A new one is a module with the names of `Reader`, added here and to `SceneFormat`; or offered by another
package as an entry point of the group `fairing.readers`."""
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
    points: PointsChoice = "automatic",
    cameras: CamerasChoice = "automatic",
    around: Around = "automatic",
    points_file: Path | None = None,
    box: BoxCorners | None = None,
    on_progress: Progress = lambda fraction, line: None,
    skip_requested: Callable[[], bool] = lambda: False,
) -> Scene:
    """The scene in a folder (or a file of it), in any supported format, recognised by content; or a demo scene by its name.

    Without a mesh the sparse points are triangulated; before, cameras are refined and points found in the photos as `cameras`
    and `points` require it.

    Args:
        path: the folder, or the file that describes the scene; or the name of a demo scene, unless a folder of that name
            holds a capture.
        mesh: a mesh file; default: the one that the format names, or the only one in the folder.
        choice: the format, photos left out, masks and weights.
        points: the sparse points that a run of the scene uses, see `Session.choose_inputs`. A demo scene has a choice of its own
            in place of "automatic".
        cameras: the cameras that a run of the scene uses, see `Session.choose_inputs`.
        around: the points that become vertices, of the object or all; only without a mesh.
        points_file: the points that a run recorded beside its trace, instead.
        box: the points in this box become vertices instead; only without a mesh.
        on_progress: called with the finished part, 0 to 1, and a line while cameras are refined, points found or triangulated, or
            photos rendered.
        skip_requested: polled while cameras are refined and points found; where it returns True, the given ones are used.

    Raises:
        InputError: the input cannot be used; the message is one line.
    """
    if (scene := _named(path, mesh, choice, on_progress)) is not None:
        _check_around(around, box, path)
        points = scene.points_choice if points == "automatic" else points
        return replace(scene, points_choice=points, cameras_choice="given" if cameras == "automatic" else cameras)
    capture, path = read_capture(path, choice), Path(path)
    recorded = None if points_file is None else read_points(points_file, len(capture.views))
    if recorded is not None:
        capture, points = capture._replace(sparse_points=recorded), "given"
    folder = path if path.is_dir() else path.parent
    found = Path(mesh) if mesh is not None else capture.mesh
    if found is None and not _meshes_in(folder):
        inputs = _chosen(path, capture, points, cameras, on_progress, skip_requested)
        if recorded is not None:  # with the corrected cameras already
            inputs = replace(inputs, sparse_points=recorded)
        return _triangulated(path.resolve().name, folder, capture, inputs, around, box, on_progress)
    mesh_path = found or only_mesh(folder)
    _check_around(around, box, mesh_path)
    vertices, faces = read_mesh(mesh_path)
    name = path.resolve().name
    with naming(mesh_path):
        as_read = Mesh(vertices, faces)  # validated here so that errors name the file
        surface = welded(as_read)
    capture = in_frame_of_mesh(capture, as_read)
    facts = inspect_mesh(surface.all_faces)
    scene = Scene.of_surface(name, surface, capture.views, sparse_points=capture.sparse_points, points_choice=points)
    scene = replace(scene, mesh_file=mesh_path.absolute())
    scene = replace(scene, cameras_choice="refine" if cameras == "automatic" else cameras)
    check_mesh_in_view(scene)
    _, input_vertices = np.unique(scene.original_from_welded, return_index=True)
    return replace(scene, warnings=capture.warnings + _rounded_copies(surface) + facts.warnings(input_vertices))


def load_capture(
    path: str | Path,
    choice: PhotoChoice | None = None,
    points: PointsChoice = "automatic",
    cameras: CamerasChoice = "automatic",
    on_progress: Progress = lambda fraction, line: None,
) -> "ChosenInputs":
    """The photos of a capture with the cameras and sparse points that `fairing.triangulate` is called with, without a mesh.

    Of a demo scene "automatic" stands for its own choice of points and for its given cameras. Arguments and exceptions as of
    `load_scene`.
    """
    from fairing.io.chosen_inputs import inputs_of_demo

    if (scene := _named(path, None, choice, on_progress)) is None:
        return _chosen(Path(path), read_capture(path, choice), points, cameras, on_progress)
    return inputs_of_demo(scene, points, cameras, on_progress)


def _chosen(
    path: Path,
    capture: Capture,
    points: PointsChoice,
    cameras: CamerasChoice,
    on_progress: Progress,
    skip_requested: Callable[[], bool] = lambda: False,
) -> "ChosenInputs":
    """The inputs of a triangulation."""
    from fairing.io.chosen_inputs import choose_inputs  # imported where there is no mesh: it takes a while

    chosen = choose_inputs(
        path.resolve().name, capture.views, capture.sparse_points, points, cameras, None, on_progress=on_progress,
        skip_requested=skip_requested,
    )  # fmt: skip
    return replace(chosen, warnings=(*capture.warnings, *chosen.warnings))


def _check_around(around: Around, box: BoxCorners | None, mesh: object) -> None:
    """Raises InputError where points to triangulate are chosen, but there is a mesh."""
    if around == "object":
        raise InputError(f"--around object: expected a capture without a mesh, found {mesh}; leave --around out")
    if box is not None:
        raise InputError(f"--box: expected a capture without a mesh, found {mesh}; leave --box out")


def _rounded_copies(surface: Welded) -> tuple[str, ...]:
    """A warning if some vertices as read differ by rounding from the copy that stands for them."""
    apart = surface.displacement
    copies = np.flatnonzero(apart)
    if len(copies) == 0:
        return ()
    return (
        f"mesh: vertices that differ from another by rounding: {len(copies)} (first: {copies[0]}; at most "
        f"{apart.max() / surface.mesh.diagonal:.1g} of the diagonal apart); they are moved as one",
    )


def _named(
    path: str | Path, mesh: str | Path | None, choice: PhotoChoice | None, on_progress: Progress
) -> Scene | None:
    """The demo scene of that name; None if there is none, or a folder of that name that holds a capture."""
    module = module_of_scene(str(path))
    if module is None or (os.path.exists(path) and is_capture(Path(path))):
        return None
    if mesh is not None or choice not in (None, PhotoChoice()):
        raise InputError(f"{path}: a demo scene has its own mesh and takes all its photos; leave mesh and choice out")
    return module.load_demo(str(path), progress=on_progress)


def _triangulated(
    name: str,
    folder: Path,
    capture: Capture,
    inputs: "ChosenInputs",
    around: Around,
    corners: BoxCorners | None,
    on_progress: Progress,
) -> Scene:
    """The scene of a capture without a mesh: its chosen sparse points, triangulated."""
    from fairing.io.chosen_inputs import with_inputs
    from fairing.triangulation import triangulate  # imported where there is no mesh: it takes a while
    from fairing.triangulation.points_in_box import points_around

    points = inputs.sparse_points
    if points is None or len(points.positions) == 0:
        raise _no_mesh(folder, inputs.warnings[len(capture.warnings) :])

    def show(part: float, line: str) -> None:
        on_progress(part, f"triangulating sparse points: {line}")

    taken, box, note = points_around(inputs.views, points, around, corners)
    triangulated = triangulate(name, inputs.views, taken, on_progress=show).result()
    scene = with_inputs(replace(triangulated, object_box=box, warnings=()), inputs, capture.views)
    return replace(scene, warnings=scene.warnings + (note,) * bool(note) + triangulated.warnings)


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
            offered = scene_names()
            if offered and len(path.parts) == 1:
                raise InputError(f"{path}: expected a folder, a file of it, or a demo scene ({offered}), found neither")
            raise FileNotFoundError
        capture = _read(path) if choice.format is None else _read_as(path, choice.format)
    return apply_choice(settle_orientations(capture), choice, path if path.is_dir() else path.parent)


def readers() -> tuple[Reader, ...]:
    """The supported formats, and those of other installed packages."""
    return (*READERS, *offered(READERS_GROUP).values())


def is_capture(path: Path) -> bool:
    """Whether a folder or file holds cameras in a supported format, possibly damaged ones."""
    for reader in readers():
        try:
            if reader.recognises(path):
                return True
        except InputError:  # several of this format
            return True
    return False


def check_recognized(path: Path) -> None:
    """Raises InputError if a folder or file holds no cameras in a supported format; damaged ones are accepted."""
    if not is_capture(path) and not any(path.name == name or (path / name).is_file() for name in _BY_FILE_NAME):
        raise _unsupported(path)


def _read(path: Path) -> Capture:
    found: list[tuple[Reader, Capture]] = []
    failed: list[tuple[Reader, InputError]] = []
    for reader in readers():
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


def _read_as(path: Path, format: str) -> Capture:
    reader = next((reader for reader in readers() if format == reader.NAME), None)
    if reader is None:
        raise InputError(f"--format {format:.40}: expected one of {', '.join(format_names())}, found another name")
    if not reader.recognises(path):
        raise InputError(f"--format {format}: expected a {reader.FORMAT} in {path}, found {_contents(path)}")
    return reader.read(path)


def _completeness(capture: Capture) -> tuple[int, bool, bool]:
    has_points = capture.sparse_points is not None and len(capture.sparse_points.positions) > 0
    n_photos = sum(not isinstance(view.photo, MissingPhoto) for view in capture.views)
    return n_photos, has_points, capture.mesh is not None


def _unsupported(path: Path) -> InputError:
    if photos := photos_alone(path):
        return InputError(
            f"{path}: expected cameras beside the {len(photos)} photos, found none; compute them with `eigenfairing cameras "
            f"{photos[0].parent} --out CAPTURE` and give CAPTURE; or export them from RealityScan, Metashape or WebODM beside "
            "the photos"
        )
    supported = "; ".join(reader.FORMAT for reader in readers())
    return InputError(f"{path}: expected one of: {supported}; found {_contents(path)}")


def _contents(path: Path) -> str:
    if path.is_file():
        return "another kind of file"
    with reading(path, "a folder"):
        names = sorted(entry.name + "/" * entry.is_dir() for entry in path.iterdir())
    return listed(names) if names else "an empty folder"


def only_mesh(folder: Path) -> Path:
    """The mesh file in a folder; a file without faces, such as a point cloud, is none.

    Raises:
        InputError: there is none, or several.
    """
    meshes = _meshes_in(folder)
    if len(meshes) == 1:
        return meshes[0]
    if meshes:
        raise InputError(f"{folder}: expected one mesh, found {listed(p.name for p in meshes)}; choose with --mesh")
    raise _no_mesh(folder)


def _meshes_in(folder: Path) -> list[Path]:
    return [path for path in files_in(folder, MESH_SUFFIXES) if has_faces(path)]


def _no_mesh(folder: Path, reasons: tuple[str, ...] = ()) -> InputError:
    clouds = listed(path.name for path in files_in(folder, MESH_SUFFIXES))
    found = ", ".join(("found none", *([f"{clouds} without faces"] if clouds else []), *reasons))
    return InputError(f"{folder}: expected a mesh ({', '.join(sorted(MESH_SUFFIXES))}), {found}; give one with --mesh")

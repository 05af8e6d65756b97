"""`convert`: a scene of any format as a COLMAP model or scene.json."""

from pathlib import Path

from rich.console import Console

from app.cli.arguments import ALL_CONVERTED_PHOTOS, ConvertedPhotosArgument, MeshArgument, SceneArgument
from app.cli.lines import note_outside_photos, print_line
from app.cli.loading import load_with_progress
from app.files.named_scenes import is_named
from app.files.scene_source import SceneSource
from fairing.errors import InputError
from fairing.io import locked_output_folder, read_mesh
from fairing.io.convert import Format, write_capture
from fairing.io.load import only_mesh, read_capture
from fairing.io.mesh_place import in_frame_of_mesh
from fairing.mesh import Mesh


def convert(
    scene: SceneArgument,
    out: Path,
    mesh: MeshArgument = None,
    format: Format = "colmap",
    photos: ConvertedPhotosArgument = ALL_CONVERTED_PHOTOS,
) -> int:
    """Write a scene in another format, with undistorted photos, sparse points, masks and mesh.

    Args:
        out: Folder for the copy: new, empty, or of an earlier conversion.
        format: colmap: a COLMAP text model, sparse/ and images/. scene.json: EigenFairing's own.
    """
    return convert_to_folder(SceneSource.typed(scene, mesh, photos.choice()), out, format, Console(stderr=True))


def convert_to_folder(source: SceneSource, out: Path, format: Format, console: Console) -> int:
    """Read a scene, with or without a mesh, and write it to a folder.

    Returns:
        Exit code.
    """
    if is_named(source.scene):
        scene = load_with_progress(source, console)
        views, sparse, warnings = scene.views, scene.sparse_points, scene.warnings
        mesh, mesh_file = (scene.unweld(scene.mesh.vertices), scene.original_faces), None
    else:
        capture = read_capture(source.scene, source.choice)
        given = Path(source.mesh) if source.mesh is not None else capture.mesh
        mesh_file = given or _mesh_beside(Path(source.scene))
        mesh = None if mesh_file is None else read_mesh(mesh_file)
        if mesh is not None:
            capture = in_frame_of_mesh(capture, Mesh(*mesh))
        views, sparse, warnings = capture.views, capture.sparse_points, capture.warnings
    with locked_output_folder(out):
        note_outside_photos(console, source.scene, views)
        notes = write_capture(out, format, views, sparse, mesh, mesh_file)
    for note in (*warnings, *notes):
        print_line(console, f"note: {note}")
    n_points = 0 if sparse is None else len(sparse.positions)
    parts = f"{len(views)} photos, {n_points} sparse points, {'a mesh' if mesh is not None else 'no mesh'}"
    print_line(console, f"wrote {parts} as {format} to {out}")
    return 0


def _mesh_beside(scene: Path) -> Path | None:
    """The only mesh in the scene's folder; None if there is none or more than one."""
    try:
        return only_mesh(scene if scene.is_dir() else scene.parent)
    except InputError:
        return None

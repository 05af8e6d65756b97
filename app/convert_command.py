"""`convert`: a scene of any format as a COLMAP model or scene.json."""

from pathlib import Path

from rich.console import Console

from app.loading import load_with_progress
from app.scene_source import SceneSource
from demo_scenes import is_demo
from fairing.errors import InputError
from fairing.io import prepare_output_folder, read_mesh
from fairing.io.convert import Format, write_capture
from fairing.io.load import only_mesh, read_capture


def convert_to_folder(source: SceneSource, out: Path, format: Format, console: Console) -> int:
    """Read a scene, with or without a mesh, and write it to a folder.

    Returns:
        Exit code.
    """
    if is_demo(source.scene):
        scene = load_with_progress(source, console)
        views, sparse, warnings = scene.views, scene.sparse_points, scene.warnings
        mesh = scene.unweld(scene.mesh.vertices), scene.original_faces
    else:
        capture = read_capture(source.scene, source.choice)
        views, sparse, warnings = capture.views, capture.sparse_points, capture.warnings
        path = Path(source.mesh) if source.mesh is not None else capture.mesh or _mesh_beside(Path(source.scene))
        mesh = None if path is None else read_mesh(path)
    prepare_output_folder(out)
    notes = write_capture(out, format, views, sparse, mesh)
    for note in (*warnings, *notes):
        console.print(f"note: {note}", highlight=False, soft_wrap=True, markup=False)
    n_points = 0 if sparse is None else len(sparse.positions)
    parts = f"{len(views)} photos, {n_points} sparse points, {'a mesh' if mesh is not None else 'no mesh'}"
    console.print(f"wrote {parts} as {format} to {out}", highlight=False, soft_wrap=True, markup=False)
    return 0


def _mesh_beside(scene: Path) -> Path | None:
    """The only mesh in the scene's folder; none where there is none or a choice would have to be made."""
    try:
        return only_mesh(scene if scene.is_dir() else scene.parent)
    except InputError:
        return None

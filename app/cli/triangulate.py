"""`triangulate`: a mesh from sparse points, or better edges for a given mesh, with a record of every flip."""

from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.progress import TimeElapsedColumn

from app.cli.arguments import ALL_PHOTOS, AroundArgument, PhotosArgument, PointsArgument, SceneArgument
from app.cli.interrupt import Interrupt
from app.cli.lines import print_line
from app.cli.loading import load_with_bar
from app.cli.photos_alone import with_cameras
from app.cli.progress_bar import progress_bar
from app.files.json_file import write_json
from app.files.run_files import FLIPS, POINTS
from app.files.scene_source import SceneSource, write_points_of_run
from fairing.errors import InputError
from fairing.io import read_mesh, write_mesh
from fairing.io.capture import naming
from fairing.mesh import Mesh
from fairing.scene import SparsePoints, View
from fairing.triangulation import Triangulation, TriangulationOptions, flip_progress, is_flip_record, triangulate
from fairing.triangulation.object_box import points_around

REPORT_SUFFIX = ".report.json"
DEFAULTS = TriangulationOptions()


def triangulate_command(
    scene: SceneArgument,
    out: Path,
    mesh: Annotated[Path | None, tyro.conf.arg(help="Flip the edges of this mesh instead.")] = None,
    max_vertices: int | None = None,
    spacing: float = DEFAULTS.spacing,
    points: PointsArgument = "automatic",
    photos: PhotosArgument = ALL_PHOTOS,
    around: AroundArgument = "automatic",
) -> int:
    """Make a start mesh from sparse points: the surface between tetrahedra inside and outside, then edge flips.

    Args:
        out: The mesh (.ply or .obj). Beside it go the record of flips (.flips) and a report (.report.json).
        max_vertices: Largest number of vertices; they stay where the surface bends most.
        spacing: Distance of vertices, pixels of a typical photo: about twice as far apart on walls, at least half as far at
            creases.
    """
    options = TriangulationOptions(max_vertices=max_vertices, spacing=spacing)
    if mesh is not None and points == "automatic":
        points = "given"  # the edges of a given mesh are flipped without points
    source = SceneSource.typed(scene, mesh, photos, points, around=around)
    return triangulate_to_file(source, out, options, Console(stderr=True))


def triangulate_to_file(source: SceneSource, out: Path, options: TriangulationOptions, console: Console) -> int:
    """Triangulate, and write the mesh, the record of flips and a report.

    Returns:
        Exit code: 0, or 130 if it was interrupted, with the mesh as it was by then.

    Raises:
        InputError: the input cannot be used, or the output would replace files that are not of an earlier triangulation.
    """
    check_triangulation_output(out)
    source = with_cameras(source, console)
    mesh = None
    capture = load_with_bar(source.scene, source.load_capture, console)
    if source.mesh is not None:
        mesh = read_mesh(Path(source.mesh))
        with naming(source.mesh):
            Mesh(*mesh)
    points, notes = capture.sparse_points, list(capture.warnings)
    if mesh is None and points is not None:
        points, _, note = points_around(capture.views, points, source.around)
        notes += [note] * bool(note)
    done, interrupted = triangulate_with_progress(source, capture.views, points, mesh, out, options, console)
    for note in notes:
        print_line(console, f"note: {note}")
    names = f"{out}, {out.with_suffix(FLIPS).name}, {out.with_suffix(REPORT_SUFFIX).name}"
    for line in [*summary_lines(done), f"wrote {names}"]:
        print_line(console, line)
    return 130 if interrupted else 0


def triangulate_with_progress(
    source: SceneSource,
    views: tuple[View, ...],
    points: SparsePoints | None,
    mesh: tuple[np.ndarray, np.ndarray] | None,
    out: Path,
    options: TriangulationOptions,
    console: Console,
) -> tuple[Triangulation, bool]:
    """Triangulate with a progress bar and write the files; also returns whether Ctrl-C ended it early."""
    header: dict = {}
    source.resolved(points).note_in(header)
    interrupt = Interrupt()
    with interrupt.listening(), progress_bar(console, TimeElapsedColumn()) as bar:
        task = bar.add_task("triangulating", total=1.0)

        def show(flips: int, open_edges: int, energy: float) -> None:
            line = f"{flips} flips, {open_edges} edges to flip, energy {energy:.5g}"
            bar.update(task, description=line, completed=flip_progress(flips, open_edges))
            if not console.is_terminal:
                console.print(line, highlight=False)

        name, record = Path(source.scene).name, out.with_suffix(FLIPS)
        done = triangulate(name, views, points, options, mesh, record, header, lambda: interrupt.requested, show)
    write_mesh(out, *done.mesh())
    write_points_of_run(points, record)
    write_json(out.with_suffix(REPORT_SUFFIX), done.report())
    return done, interrupt.requested and done.summary.inconsistent_after is None


def summary_lines(done: Triangulation) -> list[str]:
    """Summary lines: points, edges, energy and the stop reason."""
    summary, lines = done.summary, []
    if done.start is not None:
        reasons = "; ".join(f"{count} {reason}" for reason, count in done.start.left_out.items())
        lines.append(
            f"{done.start.n_points} points gave a surface of {len(done.start.vertices)} vertices; left out: {reasons or 'none'}"
        )
    after = "not counted" if summary.inconsistent_after is None else str(summary.inconsistent_after)
    lines.append(
        f"{len(done.faces)} faces, {len(done.trace)} flips; inconsistent edges {summary.inconsistent_before} -> "
        f"{after}; energy {summary.energy_before:.5g} -> {summary.energy_after:.5g}; {summary.stop_reason}"
    )
    return lines


def check_triangulation_output(out: Path) -> None:
    """Raises InputError for another suffix, a missing folder, or files that are not of an earlier triangulation."""
    record, report = out.with_suffix(FLIPS), out.with_suffix(REPORT_SUFFIX)
    if out.suffix.lower() not in (".ply", ".obj"):
        raise InputError(f"--out {out}: expected a mesh file (.ply, .obj), found {out.suffix or 'no suffix'}")
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: expected a folder to write to, found none; create {out.parent}")
    existing = [path for path in (out, record, report, out.with_suffix(POINTS)) if path.exists()]
    if existing and not is_flip_record(record):
        raise InputError(
            f"--out {out}: {existing[0].name} exists and is not of an earlier triangulation; choose another name"
        )

"""`triangulate`: a mesh from sparse points, or better edges for a given mesh, with a record of every split and flip."""

import shlex
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from rich.console import Console
from rich.progress import TimeElapsedColumn

from app.cli.arguments import (
    ALL_PHOTOS,
    AroundArgument,
    BoxArgument,
    CamerasArgument,
    PhotosArgument,
    PointsArgument,
    SceneArgument,
)
from app.cli.interrupt import Interrupt
from app.cli.lines import print_line
from app.cli.loading import load_with_bar
from app.cli.photos_alone import with_cameras
from app.cli.progress_bar import progress_bar
from app.cli.refined_cameras import write_cameras
from app.files.json_file import write_json
from app.files.run_files import CAMERAS, FLIPS, POINTS
from app.files.scene_source import SceneSource, write_points_of_run
from fairing.errors import InputError
from fairing.io import read_mesh, write_mesh
from fairing.io.capture import naming
from fairing.io.chosen_inputs import ChosenInputs
from fairing.mesh import Mesh
from fairing.run.trace_header import recorded_cameras
from fairing.scene import SparsePoints
from fairing.triangulation import Triangulation, TriangulationOptions, is_flip_record, triangulate
from fairing.triangulation.points_in_box import points_around

REPORT_SUFFIX = ".report.json"
DEFAULTS = TriangulationOptions()


def triangulate_command(
    scene: SceneArgument,
    out: Path,
    mesh: Annotated[Path | None, tyro.conf.arg(help="Flip the edges of this mesh instead.")] = None,
    max_vertices: int | None = None,
    spacing: float = DEFAULTS.spacing,
    splits: int = DEFAULTS.splits,
    points: PointsArgument = "automatic",
    photos: PhotosArgument = ALL_PHOTOS,
    cameras: CamerasArgument = "automatic",
    around: AroundArgument = "automatic",
    box: BoxArgument = None,
) -> int:
    """Make a start mesh from sparse points: the surface between tetrahedra inside and outside, then edge flips.

    Args:
        out: The mesh (.ply or .obj). Beside it go the record of flips (.flips), a report (.report.json) and corrected cameras
            (the folder .cameras).
        max_vertices: Largest number of vertices; they stay where the surface bends most.
        spacing: Distance of vertices, pixels of a typical photo: about twice as far apart on walls, at least half as far at
            creases.
        splits: Rounds in which faces larger than the spacing are divided where points near the surface contradict them. For a mesh
            that `fair` has refined, before it is faired again.
    """
    options = TriangulationOptions(max_vertices=max_vertices, spacing=spacing, splits=splits)
    if mesh is not None and points == "automatic":
        points = "given"  # the edges of a given mesh are flipped without points
    source = SceneSource.typed(scene, mesh, photos, points, cameras, around, box)
    return triangulate_to_file(source, out, options, Console(stderr=True))


def triangulate_to_file(source: SceneSource, out: Path, options: TriangulationOptions, console: Console) -> int:
    """Triangulate, and write the mesh, the record of flips and a report.

    Returns:
        Exit code: 0, or 130 if it was interrupted, with the mesh as it was by then.

    Raises:
        InputError: the input cannot be used, or the output would replace files that are not of an earlier triangulation.
    """
    check_triangulation_output(out)
    if source.mesh is not None and source.box is not None:
        raise InputError(f"--box: expected no mesh, found --mesh {source.mesh}; leave one of them out")
    source = with_cameras(source, console)
    mesh = None
    inputs = load_with_bar(source.scene, source.load_capture, console)
    if inputs.refinement is not None:
        print_line(console, inputs.refinement.reason)
    if source.mesh is not None:
        mesh = read_mesh(Path(source.mesh))
        with naming(source.mesh):
            Mesh(*mesh)
    points, notes = inputs.sparse_points, list(inputs.warnings)
    if mesh is None and points is not None:
        points, _, note = points_around(inputs.views, points, source.around, source.box)
        notes += [note] * bool(note)
    done, interrupted = triangulate_with_progress(source, inputs, points, mesh, out, options, console)
    for note in notes:
        print_line(console, f"note: {note}")
    names = f"{out}, {out.with_suffix(FLIPS).name}, {out.with_suffix(REPORT_SUFFIX).name}"
    for line in [*summary_lines(done), f"wrote {names}"]:
        print_line(console, line)
    is_corrected = inputs.refinement is not None and inputs.refinement.taken
    write_cameras(inputs.views if is_corrected else None, inputs.sparse_points, out.with_suffix(f".{CAMERAS}"), console)
    if is_corrected:
        print_line(console, f"`{fair_command_line(source, out)}` corrects the cameras alike")
    return 130 if interrupted else 0


def triangulate_with_progress(
    source: SceneSource,
    inputs: ChosenInputs,
    points: SparsePoints | None,
    mesh: tuple[np.ndarray, np.ndarray] | None,
    out: Path,
    options: TriangulationOptions,
    console: Console,
) -> tuple[Triangulation, bool]:
    """Triangulate with a progress bar and write the files; also returns whether Ctrl-C ended it early.

    Args:
        points: those of the inputs that become vertices.
        mesh: the one whose edges are flipped instead.
    """
    views, header = inputs.views, _header(source, inputs)
    interrupt = Interrupt()
    with interrupt.listening(), progress_bar(console, TimeElapsedColumn()) as bar:
        task, last = bar.add_task("triangulating", total=1.0), ""

        def show(part: float, line: str) -> None:
            nonlocal last
            bar.update(task, description=line, completed=part)
            if not console.is_terminal and line != last:
                console.print(line, highlight=False)
            last = line

        name, record = Path(source.scene).name, out.with_suffix(FLIPS)
        done = triangulate(name, views, points, options, mesh, record, header, lambda: interrupt.requested, show)
    write_mesh(out, *done.mesh())
    write_points_of_run(points, record)
    cameras = None if inputs.refinement is None else inputs.refinement.facts()
    write_json(out.with_suffix(REPORT_SUFFIX), done.report() | {"cameras": cameras})
    return done, interrupt.requested and done.summary.inconsistent_after is None


def fair_command_line(source: SceneSource, out: Path) -> str:
    """The command that fairs the mesh with the same cameras."""
    words = ["eigenfairing", "fair", source.scene, "--mesh", str(out)]
    if source.cameras != "automatic":
        words += ["--cameras", source.cameras]
    return shlex.join(words)


def _header(source: SceneSource, inputs: ChosenInputs) -> dict[str, Any]:
    """What the record of flips says about its scene: where it is, and its cameras if they are corrected."""
    header: dict[str, Any] = {}
    source.resolved(inputs.sparse_points, inputs.refinement is not None).note_in(header)
    if inputs.refinement is not None and inputs.refinement.taken:
        header |= {"views": list(inputs.refinement.names), "cameras": recorded_cameras(inputs.views)}
    return header


def summary_lines(done: Triangulation) -> list[str]:
    """Summary lines: points, edges, energy and the stop reason."""
    summary, lines = done.summary, []
    if done.start is not None:
        reasons = "; ".join(f"{count} {reason}" for reason, count in done.start.left_out.items())
        lines.append(
            f"{done.start.n_points} points gave a surface of {len(done.start.vertices)} vertices; left out: {reasons or 'none'}"
        )
    if done.vertices_of_splits:
        counts = " -> ".join(map(str, done.vertices_of_splits))
        lines.append(f"faces split where points near the surface contradict them: {counts} vertices")
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
    beside = (record, report, out.with_suffix(POINTS), out.with_suffix(f".{CAMERAS}"))
    existing = [path for path in (out, *beside) if path.exists()]
    if existing and not is_flip_record(record):
        raise InputError(
            f"--out {out}: {existing[0].name} exists and is not of an earlier triangulation; choose another name"
        )

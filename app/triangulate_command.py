"""`triangulate`: sparse points become a mesh, or a given mesh gets better edges; with a record of every flip."""

from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from app.headless import Interrupt, write_json
from app.loading import load_with_progress
from app.run_files import FLIPS
from app.scene_source import SceneSource
from demo_scenes import is_demo
from fairing.errors import InputError
from fairing.io import read_capture, read_mesh, write_mesh
from fairing.io.capture import naming
from fairing.mesh import Mesh
from fairing.scene import SparsePoints, View
from fairing.triangulation import Triangulation, TriangulationOptions, flip_progress, is_flip_record, triangulate

REPORT_SUFFIX = ".report.json"


def triangulate_to_file(source: SceneSource, out: Path, options: TriangulationOptions, console: Console) -> int:
    """Triangulate and write the mesh, and beside it the record of flips and a report.

    Returns:
        Exit code: 0, or 130 if it was interrupted, with the mesh as it was by then.

    Raises:
        InputError: whatever is wrong with the input, or the files would replace somebody else's.
    """
    check_triangulation_output(out)
    mesh = None
    if is_demo(source.scene):
        scene = load_with_progress(source, console)
        views, points, warnings = scene.views, scene.sparse_points, scene.warnings
    else:
        capture = read_capture(source.scene, source.choice)
        views, points, warnings = capture.views, capture.sparse_points, capture.warnings
    if source.mesh is not None:
        mesh = read_mesh(Path(source.mesh))
        with naming(source.mesh):
            Mesh(*mesh)
    done, interrupted = triangulate_with_progress(source, views, points, mesh, out, options, console)
    for warning in warnings:
        console.print(f"note: {warning}", highlight=False, soft_wrap=True, markup=False)
    names = f"{out}, {out.with_suffix(FLIPS).name}, {out.with_suffix(REPORT_SUFFIX).name}"
    for line in [*summary_lines(done), f"wrote {names}"]:
        console.print(line, highlight=False, soft_wrap=True, markup=False)
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
    """Triangulate with a bar, and write the mesh, the record of flips and the report; whether Ctrl-C ended it early."""
    header: dict = {}
    source.note_in(header)
    interrupt = Interrupt()
    with interrupt.listening(), _bar(console) as bar:
        task = bar.add_task("triangulating", total=1.0)

        def show(flips: int, open_edges: int, energy: float) -> None:
            line = f"{flips} flips, {open_edges} edges to flip, energy {energy:.5g}"
            bar.update(task, description=line, completed=flip_progress(flips, open_edges))
            if not console.is_terminal:
                console.print(line, highlight=False)

        name, record = Path(source.scene).name, out.with_suffix(FLIPS)
        done = triangulate(name, views, points, options, mesh, record, header, lambda: interrupt.asked, show)
    write_mesh(out, *done.mesh())
    write_json(out.with_suffix(REPORT_SUFFIX), done.report())
    return done, interrupt.asked and done.summary.inconsistent_after is None


def summary_lines(done: Triangulation) -> list[str]:
    """What became of points, edges and energy."""
    summary, lines = done.summary, []
    if done.start is not None:
        names = ", ".join(done.scene.views[v].name for v in done.start.central_views)
        lines.append(
            f"{len(done.start.vertices)} points are vertices, triangulated in {names}; left out: "
            + "; ".join(f"{count} {reason}" for reason, count in done.start.left_out.items())
        )
    after = "not searched for" if summary.inconsistent_after is None else str(summary.inconsistent_after)
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
    existing = [path for path in (out, record, report) if path.exists()]
    if existing and not is_flip_record(record):
        raise InputError(f"--out {out}: {existing[0].name} is there already and not of ours; choose another name")


def _bar(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"), TimeElapsedColumn(),
        console=console, transient=True, disable=not console.is_terminal,
    )  # fmt: skip

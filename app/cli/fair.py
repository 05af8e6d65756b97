"""`fair`: a run without a browser, from a scene to a folder of results."""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console

from app.cli.arguments import (
    ALL_PHOTOS,
    AroundArgument,
    BoxArgument,
    CamerasArgument,
    MeshArgument,
    OwnArgument,
    PhotosArgument,
    PointsArgument,
    Preset,
    SceneArgument,
)
from app.cli.interrupt import Interrupt
from app.cli.lines import note_outside_photos, print_line
from app.cli.loading import open_session
from app.cli.option_flags import flags_of, options_of
from app.cli.photos_alone import with_cameras
from app.cli.refined_cameras import write_cameras
from app.cli.run_extras import RunExtras, predict_left_out, write_models
from app.cli.run_progress import RunProgress
from app.debugger.option_fields import differing_fields
from app.files.json_file import write_json
from app.files.run_files import CAMERAS, CAPTURE, MESH, REPORT, TRACE
from app.files.scene_source import SceneSource, write_points_of_run
from fairing.check.memory import memory_warning
from fairing.errors import Cancelled, InputError
from fairing.io import locked_output_folder, write_mesh
from fairing.io.refined_mesh import write_refined_mesh
from fairing.judge.comparable_residual import stage_residuals
from fairing.judge.left_out import memory_of_left_out
from fairing.judge.metrics import quality_report
from fairing.judge.report import run_report
from fairing.mesh import Mesh
from fairing.norms.built_in import OWN
from fairing.option_check import check_options
from fairing.options import FairingOptions, options_from_dict
from fairing.run.own_plan import options_of_plan, recorded_plan
from fairing.run.recorded_norm import options_with_norm
from fairing.run.session import Session
from fairing.run.trace_header import REFINEMENT
from fairing.trace import Trace

START_MESH = "start.ply"
NO_EXTRAS = RunExtras()


def fair_command(default: FairingOptions) -> Callable[..., int]:
    """The command `fair`, with the options of the chosen preset as the defaults of its flags."""

    flags = flags_of(default)

    def fair(
        scene: SceneArgument,
        out: Path,
        mesh: MeshArgument = None,
        preset: Preset = "accurate",
        resume: bool = False,
        extras: Annotated[RunExtras, tyro.conf.arg(name="")] = NO_EXTRAS,
        points: PointsArgument = "automatic",
        photos: PhotosArgument = ALL_PHOTOS,
        cameras: CamerasArgument = "automatic",
        around: AroundArgument = "automatic",
        box: BoxArgument = None,
        own: OwnArgument = (),
        options: Annotated[type(flags), tyro.conf.arg(name="")] = flags,  # pyright: ignore[reportInvalidTypeForm]
    ) -> int:
        """Refine the mesh of a scene without a browser. Writes mesh.ply, report.json and run.trace.

        A start mesh of another format than PLY is also written in its format, with materials, groups and textures. Of photos
        without cameras a capture is made first, in the folder capture of `out`.

        Args:
            out: Folder for the results: new, empty, or of an earlier run.
            preset: Options to start from; further flags change single ones.
            resume: Continue the run in `out`, which was recorded on the same scene with the same options. Its cameras are used.
        """
        source = SceneSource.typed(scene, mesh, photos, points, cameras, around, box)
        return fair_to_folder(source, out, preset, options_of(options), resume, extras, Console(stderr=True), own)

    return fair


def fair_to_folder(
    source: SceneSource,
    out: Path,
    preset: str,
    options: FairingOptions,
    resume: bool,
    extras: RunExtras,
    console: Console,
    own: Sequence[Path] = (),
) -> int:
    """Run to the end or to Ctrl-C and write mesh, report and trace; after the end also the extras.

    Returns:
        Exit code: 0, or 130 if it was interrupted.

    Raises:
        InputError: the scene or an option is wrong, or no vertex could move; mesh, report and trace are written in that case.
    """
    check_options(options)
    beside = extras.other_mesh()
    with locked_output_folder(out):
        return _fair(source, out, preset, options, resume, extras, beside, console, own)


def _fair(
    source: SceneSource,
    out: Path,
    preset: str,
    options: FairingOptions,
    resume: bool,
    extras: RunExtras,
    beside: Mesh | None,
    console: Console,
    own: Sequence[Path],
) -> int:
    began = time.perf_counter()
    source = with_cameras(source, console, out / CAPTURE)
    trace = _earlier_run(out / TRACE, options) if resume else None
    if resume and source.mesh is None and (out / START_MESH).exists():
        source = _with_start_mesh(source, out)
    if trace is not None:
        source = source.resumed(trace.header, out / TRACE)
    if trace is not None and source.cameras.startswith("refine") and REFINEMENT not in trace.header:
        raise InputError(f"{out / TRACE}: was recorded with the given cameras; continue without --cameras refine")
    session = open_session(source, console, options, trace, own=own)
    scene = session.scene
    if trace is None and (refinement := session.trace.header.get(REFINEMENT)):
        print_line(console, refinement["reason"])
    n_states = 0 if not extras.left_out else 2 + (beside is not None)
    low_memory = memory_warning(
        scene, options, lambda scale: memory_of_left_out(scene, n_states, scale) if n_states else 0
    )
    if low_memory and low_memory.is_too_much:
        raise InputError(f"{source.scene}: {low_memory.line}")
    if scene.triangulated:  # kept, so that opening the run needs no triangulation
        write_mesh(out / START_MESH, scene.unweld(scene.mesh.vertices), scene.original_faces)
        source = _with_start_mesh(source, out)
    elif not resume:
        (out / START_MESH).unlink(missing_ok=True)  # of an earlier run
    if low_memory:
        print_line(console, f"note: {low_memory.line}")
    is_corrected = scene.cameras_origin == "corrected"
    write_cameras(scene.views if is_corrected else None, scene.sparse_points, out / CAMERAS, console)
    source.resolved(scene.sparse_points, REFINEMENT in session.trace.header).note_in(session.trace.header)
    write_points_of_run(scene.sparse_points, out / TRACE)
    session.trace.attach(out / TRACE)
    loading = time.perf_counter() - began
    interrupt = Interrupt()
    session.cancel_requested = lambda: interrupt.requested  # a step of a large mesh takes a minute
    try:
        with interrupt.listening(), RunProgress(console, session) as progress, suppress(Cancelled):
            session.run(should_stop=lambda: interrupt.requested, on_step=progress.show)
    except BaseException as error:
        if session.moment or not isinstance(error, InputError):  # an input that is refused has no results
            _save(session, out, preset, loading, console)
        raise
    session.cancel_requested = lambda: False
    report = _save(session, out, preset, loading, console)
    session.forget_computed()
    for warning in session.warnings:
        print_line(console, f"note: {warning}")
    if session.could_move_nothing:
        reason = session.stop_reason.removeprefix("finished: ")
        raise InputError(f"{source.scene}: {reason}; {out / MESH} holds the mesh as it was")
    stopped = interrupt.requested and not session.finished
    reason = f"interrupted; continue with --resume --out {out}" if stopped else session.stop_reason
    print_line(console, f"{reason}; wrote {out / MESH}, {REPORT}, {TRACE}")
    if stopped:
        return 130
    if report["residual"]["after"] is not None:
        print_line(
            console,
            "residual at the finest level: {before:.4g} -> {after:.4g} grey levels".format(**report["residual"]),
        )
    if points := report["quality"].get("sparse_points_to_surface"):
        print_line(console, _held_out_line(points))
    if extras.any:
        note_outside_photos(console, source.scene, scene.views)
    write_models(scene, session.trace.start, session.vertices, extras, out, console)
    if extras.left_out:
        report["left_out"] = predict_left_out(scene, session.trace.start, session.vertices, beside, out, console)
        write_json(out / REPORT, report)
    return 0


def _with_start_mesh(source: SceneSource, out: Path) -> SceneSource:
    """The source with the mesh that was triangulated for the run."""
    return replace(source, mesh=str((out / START_MESH).resolve()), around="automatic", box=None)


def _held_out_line(points: dict[str, Any]) -> str:
    """The line about the held-out points of `quality_report`."""
    line = f"held-out sparse points: {points['on_surface']} of {points['held_out']} belong to the surface"
    if points["on_surface"] == 0:
        return line
    before, after = (f"{points[state]['median_percent']:.3g}" for state in ("before", "after"))
    return f"{line}, median distance {before} -> {after} % of the diagonal"


def _save(session: Session, out: Path, preset: str, loading: float, console: Console) -> dict[str, Any]:
    """Write mesh, trace and report. One that fails does not keep the others from being written.

    Returns:
        The content of report.json.
    """
    report: dict[str, Any] = {}
    failures = []

    def save_mesh() -> None:
        written = write_refined_mesh(out / MESH, session.scene, session.vertices)
        for note in written.notes:
            print_line(console, f"note: {note}")
        if others := written.files[1:]:
            print_line(console, f"with all attributes of the start mesh: {', '.join(str(file) for file in others)}")

    def save_report() -> None:
        report.update(_report(session, preset, loading))
        write_json(out / REPORT, report)

    for write in (
        save_mesh,
        session.trace.detach,
        save_report,
    ):
        try:
            write()
        except InputError as error:
            failures.append(error)
    if failures:
        raise failures[0]
    return report


def _report(session: Session, preset: str, loading: float) -> dict[str, Any]:
    began = time.perf_counter()
    quality = quality_report(session.scene, session.trace.start, session.vertices)
    residuals = stage_residuals(session) if session.finished else {}
    seconds = {"loading": loading, "metrics": time.perf_counter() - began}
    return run_report(session, preset, seconds, quality, residuals)


def _earlier_run(path: Path, options: FairingOptions) -> Trace | None:
    """The trace to continue; None if there is none yet. Its own plan and norm hold, whatever the options say of these.

    Raises:
        InputError: it was recorded with other options.
    """
    if not path.exists():
        return None
    trace = Trace.load(path)
    recorded = options_from_dict(trace.header["options"])
    if plan := recorded_plan(trace):
        options = options_of_plan(plan, options)
    if recorded.robust.norm == OWN:
        options = options_with_norm(options)
    difference = _first_difference(recorded, options)
    if difference:
        raise InputError(
            f"{path}: was recorded with other options ({difference}); give the same options or another --out"
        )
    return trace


def _first_difference(recorded: FairingOptions, wanted: FairingOptions) -> str:
    for field in differing_fields(recorded, replace(wanted, threads=recorded.threads)):
        return f"{field.name} was {field.of(recorded)}, now {field.of(wanted)}"
    return ""

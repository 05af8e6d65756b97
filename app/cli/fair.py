"""`fair`: a run without a page, from a scene to a folder of results."""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass, replace
from datetime import timedelta
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from app.cli.loading import load_with_progress
from app.cli.run_extras import RunExtras, prove_on_left_out, write_models
from app.files.json_file import write_json
from app.files.run_files import MESH, REPORT, TRACE
from app.files.scene_source import SceneSource
from fairing.check.memory import memory_warning
from fairing.errors import Cancelled, InputError
from fairing.io import prepare_output_folder, write_mesh
from fairing.judge.metrics import quality_report
from fairing.judge.report import EnergyTally, run_report
from fairing.option_check import check_options
from fairing.options import FairingOptions, options_from_dict
from fairing.run.session import Session
from fairing.trace import SchedulePosition, StepRecord, Trace

START_MESH = "start.ply"
TELL_EVERY = 60.0  # seconds between lines where there is no terminal, within a level
SPEED_OVER = 3600.0  # seconds that the time remaining is judged by: a step of a large mesh takes minutes


class Interrupt:
    """Ctrl-C asks once for a tidy stop; a second one does not wait."""

    def __init__(self) -> None:
        self.asked = False

    @contextmanager
    def listening(self) -> Iterator["Interrupt"]:
        """Take over Ctrl-C for a while."""
        before = signal.signal(signal.SIGINT, self._ask)
        try:
            yield self
        finally:
            signal.signal(signal.SIGINT, before)

    def _ask(self, *_: object) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True


class RunProgress:
    """A bar with the time remaining, level, sweep and energy; plain lines where there is no terminal."""

    def __init__(self, console: Console, session: Session) -> None:
        self._console = console
        self._session = session
        self._tally = EnergyTally(len(session.scene.mesh.faces))
        for record in session.trace.steps:
            self._tally.add(record)
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:3.0f} %"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            disable=not console.is_terminal,
            speed_estimate_period=SPEED_OVER,
        )
        self._task = self._bar.add_task("starting", total=1.0)
        self._told = time.monotonic()

    def __enter__(self) -> "RunProgress":
        self._session.on_photo = self._show_photo
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()
        self._session.on_photo = lambda done, count: None

    def _show_photo(self, done: int, count: int) -> None:
        self._tell(f"preparing: photo {done + 1} of {count}" if done < count else "preparing the sweep")

    def show(self, record: StepRecord) -> None:
        """Tell of one step."""
        sweep = self._tally.add(record)
        levels = self._session.options.n_levels
        self._bar.update(self._task, completed=self._session.progress)
        self._tell(
            f"level {record.position.level + 1}/{levels} sweep {sweep.sweep + 1} energy {sweep.after:.5g}",
            is_due=record.next_position.level != record.position.level,
        )

    def _tell(self, text: str, is_due: bool = False) -> None:
        self._bar.update(self._task, description=text)
        if self._console.is_terminal or not (is_due or time.monotonic() > self._told + TELL_EVERY):
            return
        (task,) = self._bar.tasks
        left = "" if task.time_remaining is None else f", {timedelta(seconds=round(task.time_remaining))} left"
        self._console.print(f"{text} ({task.percentage:.0f} % done{left})", highlight=False)
        self._told = time.monotonic()


def run_to(session: Session, wanted: SchedulePosition, console: Console) -> None:
    """Run up to a position of the schedule, with a bar; where the run passes it by, to the next moment after it."""
    with RunProgress(console, session) as progress:
        while not session.finished and session.position < wanted:
            record = session.step()
            if record is not None:
                progress.show(record)


def fair_to_folder(
    source: SceneSource,
    out: Path,
    preset: str,
    options: FairingOptions,
    resume: bool,
    extras: RunExtras,
    console: Console,
) -> int:
    """Run to the end or to Ctrl-C and write mesh, report and trace; after the end also the extras.

    Returns:
        Exit code: 0, or 130 if it was interrupted.
    """
    check_options(options)
    beside = extras.other_mesh()
    began = time.perf_counter()
    if resume and source.mesh is None and (out / START_MESH).exists():
        source = replace(source, mesh=str((out / START_MESH).resolve()))
    scene = load_with_progress(source, console)
    low_memory = memory_warning(scene, options)
    if low_memory and low_memory.is_too_much:
        raise InputError(f"{source.scene}: {low_memory.line}")
    prepare_output_folder(out)
    if scene.triangulated:  # kept, so that the run can be opened without triangulating again
        write_mesh(out / START_MESH, scene.unweld(scene.mesh.vertices), scene.original_faces)
        source = replace(source, mesh=str((out / START_MESH).resolve()))
    elif not resume:
        (out / START_MESH).unlink(missing_ok=True)  # of an earlier run
    trace = _earlier_run(out / TRACE, options) if resume else None
    if low_memory:
        console.print(f"note: {low_memory.line}", highlight=False, soft_wrap=True)
    session = Session(scene, options, trace)
    source.note_in(session.trace.header)
    session.trace.attach(out / TRACE)
    loading = time.perf_counter() - began
    interrupt = Interrupt()
    session.cancel_requested = lambda: interrupt.asked  # a step of a large mesh takes a minute
    try:
        with interrupt.listening(), RunProgress(console, session) as progress, suppress(Cancelled):
            session.run(should_stop=lambda: interrupt.asked, on_step=progress.show)
    except BaseException:
        _save(session, out, preset, loading)
        raise
    session.cancel_requested = lambda: False
    report = _save(session, out, preset, loading)
    session.forget_computed()
    for warning in session.warnings:
        console.print(f"note: {warning}", highlight=False, soft_wrap=True)
    stopped = interrupt.asked and not session.finished
    reason = f"interrupted; go on with --resume --out {out}" if stopped else session.stop_reason
    console.print(f"{reason}; wrote {out / MESH}, {REPORT}, {TRACE}", highlight=False, soft_wrap=True)
    if stopped:
        return 130
    if points := report["quality"].get("sparse_points_to_surface"):
        before, after = (f"{points[state]['median_percent']:.3g}" for state in ("before", "after"))
        line = f"sparse points kept to judge by: median distance to the surface {before} -> {after} % of the diagonal"
        console.print(line, highlight=False, soft_wrap=True)
    write_models(scene, session.trace.start, session.vertices, extras, out, console)
    if extras.left_out:
        report["left_out"] = prove_on_left_out(scene, session.trace.start, session.vertices, beside, out, console)
        write_json(out / REPORT, report)
    return 0


def _save(session: Session, out: Path, preset: str, loading: float) -> dict[str, Any]:
    """Write all that can be written; on a full disk the mesh may still find its place where the trace did not.

    Returns:
        What report.json says.
    """
    report: dict[str, Any] = {}
    failures = []

    def save_report() -> None:
        report.update(_report(session, preset, loading))
        write_json(out / REPORT, report)

    for write in (
        lambda: write_mesh(out / MESH, session.scene.unweld(session.vertices), session.scene.original_faces),
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
    return run_report(session, preset, {"loading": loading, "metrics": time.perf_counter() - began}, quality)


def _earlier_run(path: Path, options: FairingOptions) -> Trace | None:
    """The trace to continue; None if there is none yet.

    Raises:
        InputError: it was recorded with other options.
    """
    if not path.exists():
        return None
    trace = Trace.load(path)
    difference = _first_difference(options_from_dict(trace.header["options"]), options, "")
    if difference:
        raise InputError(f"{path}: was recorded with other options ({difference}); give the same or another --out")
    return trace


def _first_difference(recorded: Any, wanted: Any, prefix: str) -> str:
    for field in fields(recorded):
        one, other = getattr(recorded, field.name), getattr(wanted, field.name)
        if one == other or field.name == "threads":
            continue
        name = prefix + field.name
        return _first_difference(one, other, name + ".") if is_dataclass(one) else f"{name} was {one}, now {other}"
    return ""

"""`experiment`: measures one vertex of a scene with known truth, and writes a table, a picture and a record."""

import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from app.arguments import Preset, SceneArgument, chosen_preset
from app.experiments.record import Record
from app.experiments.workers import measure_all
from app.headless import Interrupt
from app.loading import load_with_progress
from app.scene_source import SceneSource
from demo_scenes import DEMO_NAMES, is_demo
from fairing.errors import InputError
from fairing.experiments import EXPERIMENTS, Experiment, Row, Setting
from fairing.experiments.experiment import open_cases
from fairing.io import prepare_output_folder
from fairing.option_check import check_options
from fairing.options import FairingOptions

ABOUT = "Put one vertex of a scene off its true place, many times, and see what becomes of it."
MOST_WORKERS = 8
SAVE_EVERY = 2.0  # s


def list_experiments(console: Console) -> int:
    """What there is, a line each."""
    for name, experiment in EXPERIMENTS.items():
        console.print(f"{name:15}{experiment.question}", highlight=False, soft_wrap=True)
    console.print("\neigenfairing experiment NAME [SCENE] --out DIR   (SCENE: cube)", highlight=False)
    return 0


def experiment_commands(arguments: Sequence[str]) -> dict[str, Callable[..., int]]:
    """One for each of `EXPERIMENTS`; the defaults of options depend on the preset among the arguments."""
    return {name: _command(kind, chosen_preset(arguments)) for name, kind in EXPERIMENTS.items()}


def _command(kind: type[Experiment], default: FairingOptions) -> Callable[..., int]:
    """Its fields and the options of the chosen preset are flags."""

    def command(
        out: Path,
        scene: SceneArgument = "cube",
        vertex: int | None = None,
        preset: Preset = "accurate",
        resume: bool = False,
        experiment: Annotated[kind, tyro.conf.arg(name="")] = kind(),  # pyright: ignore[reportInvalidTypeForm]  # noqa: B008
        options: Annotated[FairingOptions, tyro.conf.arg(name="")] = default,
    ) -> int:
        """Args:
        scene: A demo's name (see `eigenfairing demos`): the truth must be known.
        out: Folder for the table (.csv), the picture (.png) and the record (.json): new, empty, or of an earlier run.
        vertex: The vertex that is put off its place. Default: the one that photos see best.
        preset: Options of every run, but for what the experiment varies; further flags change single ones.
        resume: Go on with an interrupted experiment in `out`.
        """
        if not is_demo(scene):
            raise InputError(
                f"{scene}: expected a demo ({DEMO_NAMES}), found another scene; experiments measure errors against "
                "the truth, which only demos know"
            )
        source = SceneSource.typed(scene, None)
        return experiment_to_folder(experiment, source, out, vertex, options, resume, Console(stderr=True))

    command.__doc__ = f"{kind.question}\n\n{command.__doc__}"
    return command


def experiment_to_folder(
    experiment: Experiment,
    source: SceneSource,
    out: Path,
    vertex: int | None,
    options: FairingOptions,
    resume: bool,
    console: Console,
) -> int:
    """Measure all cases, or as many as Ctrl-C allows, and write NAME.csv, NAME.png and NAME.json.

    Returns:
        Exit code: 0, or 130 if it was interrupted.
    """
    check_options(options)
    scene = load_with_progress(source, console)
    setting = Setting.of(scene, options, vertex)
    record = Record(experiment, setting, source.scene, experiment.cases(setting))
    prepare_output_folder(out)
    rows: list[Row] = record.earlier_rows(out) if resume else []
    interrupt, saved = Interrupt(), 0.0
    with interrupt.listening(), _bar(console) as bar:
        task = bar.add_task(experiment.title, total=len(record.cases), completed=len(rows))

        def take(row: Row) -> None:
            nonlocal saved
            rows.append(row)
            bar.update(task, completed=len(rows))
            if time.monotonic() - saved > SAVE_EVERY:
                record.save(out, rows, picture=False)
                saved = time.monotonic()
            if not console.is_terminal:
                console.print(_line(experiment, row), highlight=False, soft_wrap=True)

        cases = open_cases(experiment, setting, rows)
        workers = min(os.cpu_count() or 1, MOST_WORKERS)
        try:
            measure_all(experiment, setting, cases, workers, take, lambda: interrupt.asked)
        finally:
            record.save(out, rows, picture=True)
    for line in (experiment.finding(record.in_order(rows)), f"wrote {_names(record, out, rows)}"):
        if line:
            console.print(line, highlight=False, soft_wrap=True, markup=False)
    if len(rows) < len(record.cases):
        left = f"interrupted after {len(rows)} of {len(record.cases)}; go on with --resume --out {out}"
        console.print(left, highlight=False, soft_wrap=True, markup=False)
        return 130
    return 0


def _names(record: Record, out: Path, rows: list[Row]) -> str:
    return ", ".join([str(out / f"{record.stem}.csv"), *([".png"] if rows else []), ".json"])


def _line(experiment: Experiment, row: Row) -> str:
    return "  ".join(f"{name} {_short(row[name])}" for name in experiment.columns)


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _bar(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("left"),
        TimeRemainingColumn(), console=console, disable=not console.is_terminal,
    )  # fmt: skip

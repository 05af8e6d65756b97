"""`experiment`: repeated runs of one displaced vertex against the known truth, as a table, a chart and a record."""

import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from app.cli.arguments import CamerasArgument, Preset, SceneArgument, chosen_preset
from app.cli.interrupt import Interrupt
from app.cli.lines import print_line
from app.cli.loading import load_with_points
from app.cli.option_flags import flags_of, options_of
from app.experiments.record import Record
from app.experiments.workers import MOST_WORKERS, measure_all
from app.files.named_scenes import is_named, scene_names
from app.files.scene_source import SceneSource
from fairing.errors import InputError
from fairing.experiments import Experiment, Row, Setting, experiments
from fairing.experiments.experiment import open_cases
from fairing.io import locked_output_folder
from fairing.option_check import check_options
from fairing.options import FairingOptions

ABOUT = "Displace one vertex of a scene from its true position, many times, and measure where the engine brings it."
SAVE_EVERY = 2.0  # s


def experiment() -> int:
    """Measure accuracy and capture range: `experiment NAME [SCENE] --out DIR`. Without a name, list the experiments."""
    return list_experiments(Console())


def list_experiments(console: Console) -> int:
    """Print name and question of each experiment."""
    for name, experiment in experiments().items():
        print_line(console, f"{name:15}{experiment.question}")
    console.print("\neigenfairing experiment NAME [SCENE] --out DIR   (SCENE: cube)", highlight=False)
    return 0


def experiment_commands(arguments: Sequence[str]) -> dict[str, Callable[..., int]]:
    """One command for each of `experiments`; the defaults of options depend on the preset among the arguments."""
    return {name: _command(kind, chosen_preset(arguments)) for name, kind in experiments().items()}


def _command(kind: type[Experiment], default: FairingOptions) -> Callable[..., int]:
    """The command of one experiment: its fields and the options of the preset are flags."""

    flags = flags_of(default)

    def command(
        out: Path,
        scene: SceneArgument = "cube",
        vertex: int | None = None,
        preset: Preset = "accurate",
        resume: bool = False,
        cameras: CamerasArgument = "automatic",
        experiment: Annotated[kind, tyro.conf.arg(name="")] = kind(),  # pyright: ignore[reportInvalidTypeForm]  # noqa: B008
        options: Annotated[type(flags), tyro.conf.arg(name="")] = flags,  # pyright: ignore[reportInvalidTypeForm]
    ) -> int:
        """Args:
        out: Folder for the table (.csv), the chart (.png) and the record (.json): new, empty, or of an earlier run.
        vertex: The vertex that is displaced. Default: the one that the photos see best.
        preset: Options of every run, except those that the experiment varies; further flags change single ones.
        resume: Continue an interrupted experiment in `out`.
        """
        if not is_named(scene):
            raise InputError(
                f"{scene}: expected a demo ({scene_names()}), found another scene; experiments measure errors against "
                "the truth, which is known for demos only"
            )
        source = SceneSource.typed(scene, None, points="automatic", cameras=cameras)
        return experiment_to_folder(experiment, source, out, vertex, options_of(options), resume, Console(stderr=True))

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
    with locked_output_folder(out):
        return _experiment(experiment, source, out, vertex, options, resume, console)


def _experiment(
    experiment: Experiment,
    source: SceneSource,
    out: Path,
    vertex: int | None,
    options: FairingOptions,
    resume: bool,
    console: Console,
) -> int:
    scene = load_with_points(source, console)
    setting = Setting.of(scene, options, vertex)
    record = Record(experiment, setting, source.scene, experiment.cases(setting))
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
                print_line(console, _line(experiment, row))

        cases = open_cases(experiment, setting, rows)
        workers = min(os.cpu_count() or 1, MOST_WORKERS)
        try:
            measure_all(experiment, setting, cases, workers, take, lambda: interrupt.requested)
        finally:
            record.save(out, rows, picture=True)
    for line in (experiment.finding(record.in_order(rows)), f"wrote {_names(record, out, rows)}"):
        if line:
            print_line(console, line)
    if len(rows) < len(record.cases):
        left = f"interrupted after {len(rows)} of {len(record.cases)}; continue with --resume --out {out}"
        print_line(console, left)
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

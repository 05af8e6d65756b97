"""Progress of a run on the terminal: a bar, or plain lines where there is no terminal."""

import time
from datetime import timedelta

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from app.cli.lines import print_line
from fairing.judge.report import EnergyTally
from fairing.run.phases import schedule_of
from fairing.run.session import Session
from fairing.trace import SchedulePosition, StepRecord

LINE_EVERY = 60.0  # seconds between plain lines within a level
SPEED_OVER = 3600.0  # seconds over which the remaining time is estimated: a step of a large mesh takes minutes


class RunProgress:
    """Shows level, sweep and energy or the fit, the share done and the remaining time while the `with` block runs."""

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
        self._printed = time.monotonic()

    def __enter__(self) -> "RunProgress":
        self._session.on_photo = self._show_photo
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()
        self._session.on_photo = lambda done, count: None

    def show(self, record: StepRecord) -> None:
        """Show one step."""
        sweep = self._tally.add(record)
        levels = self._session.options.n_levels
        self._bar.update(self._task, completed=self._session.progress)
        what = record.stage.label if sweep is None else f"sweep {sweep.sweep + 1} energy {sweep.after:.5g}"
        self._update(
            f"level {record.position.level + 1}/{levels} {what}",
            is_due=record.next_position.level != record.position.level,
        )

    def _show_photo(self, done: int, count: int) -> None:
        self._update(f"preparing: photo {done + 1} of {count}" if done < count else "preparing the sweep")

    def _update(self, text: str, is_due: bool = False) -> None:
        self._bar.update(self._task, description=text)
        if self._console.is_terminal or not (is_due or time.monotonic() > self._printed + LINE_EVERY):
            return
        (task,) = self._bar.tasks
        left = "" if task.time_remaining is None else f", {timedelta(seconds=round(task.time_remaining))} left"
        print_line(self._console, f"{text} ({task.percentage:.0f} % done{left})")
        self._printed = time.monotonic()


def run_to(session: Session, wanted: SchedulePosition, console: Console) -> None:
    """Run up to a position of the schedule, or to the first moment after it where the run does not stop there."""
    with RunProgress(console, session) as progress:
        schedule = schedule_of(session.options, session.make_plan())  # the position at the start depends on the plan
        end = schedule.order_of(wanted)
        while not session.finished and schedule.order_of(session.position) < end:
            record = session.step()
            if record is not None:
                progress.show(record)

"""Run state: one consistent, immutable state of the debugger, as the pages show it."""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from app.debugger.bookmarks import Bookmark
from app.debugger.breakpoints import Breakpoint
from app.debugger.incidents import Incident
from app.debugger.runs import RunInfo
from app.debugger.work_report import WorkReport
from fairing.options import FairingOptions
from fairing.stage_kind import StageKind
from fairing.trace import SchedulePosition, StepRecord, Trace


class Activity(Enum):
    """What the engine thread is doing."""

    PAUSED = "paused"
    STEPPING = "stepping"
    RUNNING = "running"
    PLAYING = "playing"


@dataclass(frozen=True, eq=False)
class RunState:
    """A published state. Its arrays must not be changed.

    Attributes:
        serial: increases with every state.
        run_id: the current run.
        runs: all runs, the oldest first.
        rival: the run that races with the current one; None without a race.
        trace: the record, which may grow; this state covers its first `length` steps.
        moment: the present moment, 0 to `length`.
        length: number of recorded steps.
        vertices: (n, 3) float, positions at `moment`, world units.
        locked: (n,) bool: vertices that are never moved.
        position: where the next step belongs.
        next_stage: kind of stage of the next step; None if there is none, or before the plan.
        options: of this run.
        activity: what the engine thread is doing.
        finished: whether the schedule is completed at `moment`.
        reason: why the last command stopped, one line.
        problem: the error of the last command, or of a thread that was restarted; empty without.
        problems: number of errors so far.
        incident: the last failure of the debugger itself, which a problem report contains; None without.
        progress: fraction of the schedule, 0 to 1.
        step_seconds: mean computing time of the recent steps, s; 0 before the first.
        breakpoints: conditions that stop a run.
        bookmarks: of all runs.
        log: hits of breakpoints that only report, the newest last.
        work: what the engine does at present; None while it does nothing, or before a computation has taken noticeable time.
        waiting: labels of the commands that wait for the engine, the first first.
    """

    serial: int
    run_id: int
    runs: tuple[RunInfo, ...]
    rival: int | None
    trace: Trace
    moment: int
    length: int
    vertices: np.ndarray
    locked: np.ndarray
    position: SchedulePosition
    next_stage: StageKind | None
    options: FairingOptions
    activity: Activity
    finished: bool
    reason: str
    problem: str
    problems: int
    incident: Incident | None
    progress: float
    step_seconds: float
    breakpoints: tuple[Breakpoint, ...]
    bookmarks: tuple[Bookmark, ...]
    log: tuple[str, ...]
    work: WorkReport | None = None
    waiting: tuple[str, ...] = ()

    @property
    def is_working(self) -> bool:
        """Whether a command is in progress."""
        return self.activity is not Activity.PAUSED

    @property
    def is_moving(self) -> bool:
        """Whether the mesh changes continuously; details need not be shown."""
        return self.activity in (Activity.RUNNING, Activity.PLAYING)

    @property
    def record(self) -> StepRecord | None:
        """The step before `moment`; None at the start."""
        return self.trace.steps[self.moment - 1] if self.moment else None

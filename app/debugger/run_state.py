"""What pages are told about the engine."""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from app.debugger.bookmarks import Bookmark
from app.debugger.breakpoints import Breakpoint
from app.debugger.runs import RunInfo
from fairing.options import FairingOptions
from fairing.trace import SchedulePosition, StepRecord, Trace


class Activity(Enum):
    """What the engine is doing."""

    PAUSED = "paused"
    STEPPING = "stepping"
    RUNNING = "running"
    PLAYING = "playing"


@dataclass(frozen=True, eq=False)
class RunState:
    """What there is to show, consistent in itself and never changed afterwards.

    Attributes:
        serial: grows with every state.
        run_id: which of the runs is at hand; every record has a number of its own.
        runs: all runs that are kept, the oldest first.
        rival: the run that races with this one, if one does.
        trace: the record. It may grow; what belongs to this state are its first `length` steps.
        moment: where the run stands, 0 to `length`.
        length: recorded steps.
        vertices: (n, 3) float, positions at `moment`, world units.
        locked: (n,) bool: vertices that neither the engine nor a hand moves.
        position: where the next step belongs.
        options: of this run.
        activity: what the engine is doing.
        finished: whether the schedule is worked off at `moment`.
        reason: why it stopped, one line.
        problem: what went wrong with the last command, else empty.
        problems: how many commands went wrong so far.
        progress: fraction of the schedule, 0 to 1.
        step_seconds: computing time of a step, mean over the last ones; 0 before the first.
        breakpoints: what stops a run.
        bookmarks: moments with a note, of all runs.
        log: what breakpoints that only report had to say, the newest last.
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
    options: FairingOptions
    activity: Activity
    finished: bool
    reason: str
    problem: str
    problems: int
    progress: float
    step_seconds: float
    breakpoints: tuple[Breakpoint, ...]
    bookmarks: tuple[Bookmark, ...]
    log: tuple[str, ...]

    @property
    def is_moving(self) -> bool:
        """Whether the mesh moves by itself: details may wait."""
        return self.activity in (Activity.RUNNING, Activity.PLAYING)

    @property
    def record(self) -> StepRecord | None:
        """The step that led here; None at the start."""
        return self.trace.steps[self.moment - 1] if self.moment else None

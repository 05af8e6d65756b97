"""Commands: the requests that the controller accepts."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any

from app.debugger.condition import Condition
from fairing.options import FairingOptions
from fairing.run.session import Session


class Extent(IntEnum):
    """Length of a step. The value is the number of leading fields of `SchedulePosition` that stay equal within it; within a
    stage its kind and the level do, see `app.debugger.schedule_extents`."""

    STAGE = 0
    LEVEL = 1
    SWEEP = 2
    BLOCK = 3
    ITERATION = 4


@dataclass(frozen=True)
class Forward:
    """Step to the end of the present iteration, block, sweep, stage or level.

    Attributes:
        passes_breakpoints: breakpoints are not checked.
    """

    extent: Extent
    passes_breakpoints: bool = False


@dataclass(frozen=True)
class Back:
    """Step back to the beginning of the iteration, block, sweep, stage or level that the last step belongs to."""

    extent: Extent


@dataclass(frozen=True)
class Run:
    """Run to the end of the schedule, or until a breakpoint or `until` holds after a step, or another command arrives."""

    until: Condition | None = None
    passes_breakpoints: bool = False


@dataclass(frozen=True)
class RunBack:
    """Go back through the record to the last step after which a breakpoint holds, else to the start."""


@dataclass(frozen=True)
class Pause:
    """Stop the command in progress and drop the commands that wait."""


@dataclass(frozen=True)
class JumpTo:
    """Go to a recorded moment.

    Attributes:
        moment: negative, or beyond the record: its last moment.
    """

    moment: int


@dataclass(frozen=True)
class ToBeginning:
    """Go to the beginning of the block, sweep, stage or level that the next step belongs to."""

    extent: Extent


@dataclass(frozen=True)
class Play:
    """Play the recorded moments forward, to the end of the record.

    Attributes:
        moments_per_second: limited to the range of `app.debugger.playback`.
    """

    moments_per_second: float


@dataclass(frozen=True)
class Restart:
    """Start a new run from the start, with other options if given. The present run is kept."""

    options: FairingOptions | None = None


@dataclass(frozen=True)
class Branch:
    """Start a new run that shares the record up to the present moment and continues with other options.

    The present run is kept.
    """

    options: FairingOptions


@dataclass(frozen=True)
class LoadOwn:
    """Branch at the present moment with the terms and the norm that these files define now; the present run is kept."""

    files: tuple[Path, ...]


@dataclass(frozen=True)
class Place:
    """Move vertices manually and continue from there. At a past moment this branches a new run.

    Attributes:
        vertices: ids.
        positions: world units, one for each vertex.
    """

    vertices: tuple[int, ...]
    positions: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True)
class Reset:
    """Move vertices back to their start manually. At a past moment this branches a new run."""

    vertices: tuple[int, ...]


@dataclass(frozen=True)
class Lock:
    """Lock or unlock vertices: an option that holds from the present moment on."""

    vertices: tuple[int, ...]
    locked: bool


@dataclass(frozen=True)
class SwitchTo:
    """Switch to another run, at its present moment or at a given one."""

    run_id: int
    moment: int | None = None


@dataclass(frozen=True)
class DeleteRun:
    """Delete a run from the list; its file is kept."""

    run_id: int


@dataclass(frozen=True)
class Race:
    """Compute two runs from the start in turn, so that both have used the same computing time; both are kept."""

    first: FairingOptions
    second: FairingOptions


@dataclass(frozen=True)
class SaveReport:
    """Write a problem report, see `app.debugger.problem_report`."""


@dataclass(frozen=True)
class Query:
    """Compute something from the session on the engine thread. The session stays unchanged.

    Commands go first: a query in progress is cancelled when one arrives, and computed again afterwards.

    Attributes:
        key: a query replaces a waiting one with an equal key.
        compute: called with the session.
        callback: called on the engine thread with the result, or with the exception that `compute` raised; must be quick.
    """

    key: Hashable
    compute: Callable[[Session], Any]
    callback: Callable[[Any], None]


Command = (
    Forward
    | Back
    | ToBeginning
    | Run
    | RunBack
    | Play
    | Pause
    | JumpTo
    | Restart
    | Branch
    | LoadOwn
    | Place
    | Reset
    | Lock
    | SwitchTo
    | DeleteRun
    | Race
    | SaveReport
    | Query
)

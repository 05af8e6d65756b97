"""What a debugger can be asked to do."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from app.debugger.condition import Condition
from fairing.options import FairingOptions
from fairing.run.session import Session


class Extent(IntEnum):
    """How far a step goes. The value is the number of leading fields of `SchedulePosition` that stay the same within it."""

    LEVEL = 1
    SWEEP = 2
    UNIT = 3
    ITERATION = 4


@dataclass(frozen=True)
class Forward:
    """On to the end of the present iteration, unit, sweep or level."""

    extent: Extent


@dataclass(frozen=True)
class Back:
    """To the beginning of the iteration, unit, sweep or level that the last step belongs to."""

    extent: Extent


@dataclass(frozen=True)
class Run:
    """On until somebody pauses, a condition holds after a step, or the schedule is worked off."""

    until: Condition | None = None


@dataclass(frozen=True)
class RunBack:
    """Back through the record to the last step that a breakpoint holds for, else to the start."""


@dataclass(frozen=True)
class Pause:
    """Stop after the step in hand."""


@dataclass(frozen=True)
class JumpTo:
    """To a recorded moment; -1 is the last one."""

    moment: int


@dataclass(frozen=True)
class ToBeginning:
    """To the beginning of the unit, sweep or level that the next step belongs to."""

    extent: Extent


@dataclass(frozen=True)
class Play:
    """Forward through the recorded moments, so many a second, to the end of the record."""

    moments_per_second: float


@dataclass(frozen=True)
class Restart:
    """A new run from the start; with other options if given. The present one is kept."""

    options: FairingOptions | None = None


@dataclass(frozen=True)
class Branch:
    """A new run that shares the past up to the present moment and goes on with other options. The present one is kept."""

    options: FairingOptions


@dataclass(frozen=True)
class Place:
    """Put vertices elsewhere by hand and go on from there. At a past moment this forks a new run.

    Attributes:
        vertices: ids.
        positions: world units, one a vertex.
    """

    vertices: tuple[int, ...]
    positions: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True)
class Reset:
    """Put vertices back to their start by hand."""

    vertices: tuple[int, ...]


@dataclass(frozen=True)
class Lock:
    """Lock vertices, or unlock them: an option, from the present moment on."""

    vertices: tuple[int, ...]
    locked: bool


@dataclass(frozen=True)
class SwitchTo:
    """To another run, where it stands or at a moment of it."""

    run_id: int
    moment: int | None = None


@dataclass(frozen=True)
class DeleteRun:
    """Forget a run."""

    run_id: int


@dataclass(frozen=True)
class Race:
    """Two runs from the start in turn, each for as long as the other has computed; both are kept."""

    first: FairingOptions
    second: FairingOptions


@dataclass(frozen=True)
class Query:
    """Look something up in the session, on its own thread. Changes nothing; a newer question of the same asker
    replaces it.

    Attributes:
        asker: who wants to know.
        question: reads the session; what it raises is its answer, too.
        answer: told the result on the engine's thread, so it only keeps it.
    """

    asker: object
    question: Callable[[Session], Any]
    answer: Callable[[Any], None]


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
    | Place
    | Reset
    | Lock
    | SwitchTo
    | DeleteRun
    | Race
    | Query
)

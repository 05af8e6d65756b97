"""Engine actions of a lesson step."""

from dataclasses import dataclass
from typing import Any

from app.debugger.commands import Command
from fairing.options import FairingOptions

Changes = tuple[tuple[tuple[str, ...], Any], ...]
"""Changed options: path and value of each."""


@dataclass(frozen=True)
class PlaceVertex:
    """Place a vertex at an offset (dx, dy, dz), world units, from its true position."""

    vertex: int
    offset: tuple[float, float, float]


@dataclass(frozen=True)
class StartRun:
    """Start a named run. An existing run with the same options and placed vertices is reused."""

    name: str
    options: FairingOptions
    puts: tuple[PlaceVertex, ...] = ()


@dataclass(frozen=True)
class Continue:
    """Branch a named run from the current moment, with changed options."""

    name: str
    changes: Changes


@dataclass(frozen=True)
class Advance:
    """Post commands that step, run or jump, one after another."""

    commands: tuple[Command, ...]


@dataclass(frozen=True)
class RacedRuns:
    """Run two named runs from the start alternately, with equal computing time."""

    first: StartRun
    second: StartRun


@dataclass(frozen=True)
class SwitchRun:
    """Switch to a run of this lesson: at its start (0), at its end (-1), or at its current moment (None)."""

    name: str
    moment: int | None = None


EngineAction = StartRun | Continue | PlaceVertex | Advance | RacedRuns | SwitchRun

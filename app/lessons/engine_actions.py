"""What a step of a lesson makes the engine do."""

from dataclasses import dataclass
from typing import Any

from app.debugger.commands import Command
from fairing.options import FairingOptions


@dataclass(frozen=True)
class PlaceVertex:
    """A vertex is put by hand so far from its true place (dx, dy, dz), world units."""

    vertex: int
    offset: tuple[float, float, float]


@dataclass(frozen=True)
class StartRun:
    """A run from the start, named; one that was made before with these options serves again."""

    name: str
    options: FairingOptions
    puts: tuple[PlaceVertex, ...] = ()


@dataclass(frozen=True)
class Continue:
    """A branch of the run at hand, named, that goes on from here with some options changed, by their paths."""

    name: str
    changes: tuple[tuple[tuple[str, ...], Any], ...]


@dataclass(frozen=True)
class Advance:
    """Commands that step, run or jump, one after another."""

    commands: tuple[Command, ...]


@dataclass(frozen=True)
class RacedRuns:
    """Two named runs from the start, in turn, each for as long as the other has computed."""

    first: StartRun
    second: StartRun


@dataclass(frozen=True)
class SwitchRun:
    """A run of this lesson to hand: at its start (0), at its end (-1), or where it stands (None)."""

    name: str
    moment: int | None = None


EngineAction = StartRun | Continue | PlaceVertex | Advance | RacedRuns | SwitchRun

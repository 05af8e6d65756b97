"""Where a run stops by itself: after a step for which a condition holds."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from app.condition import Condition, Quantities, parse_condition
from app.outcome import short_reason, slot_of
from fairing.errors import InputError
from fairing.trace import StepReason, StepRecord

MAX_BREAKPOINTS = 50

VALUES: dict[str, str] = {
    "moment": "the moment the step leads to",
    "level": "level, from 1",
    "sweep": "sweep within the level, from 1",
    "unit": "unit within the sweep, from 1",
    "iteration": "iteration of the unit, from 1",
    "energy": "energy of the unit's faces after the step",
    "change": "change of that energy by the step",
    "percent": "the same in percent",
    "step_px": "longest step tried, pixels in a photo",
    "damping": "largest damping",
    "rejected": "number of vertices whose step was rejected",
    "accepted": "number of vertices that moved",
    "weakest": "smallest ratio of a vertex's weakest to its strongest eigenvalue",
}
FUNCTIONS: dict[str, str] = {
    "about": "1 if the step is about this vertex",
    "moved": "how far the step moved this vertex, pixels in a photo",
    "view": "change of the energy in this view, from 0",
    "abs": "without its sign",
}


@dataclass(frozen=True)
class Breakpoint:
    """Attributes:
    condition: stops the run after a step for which it holds.
    number: its name.
    enabled: whether it is asked at all.
    hits: how often it has held.
    logs: report and go on instead of stopping.
    """

    condition: Condition
    number: int
    enabled: bool = True
    hits: int = 0
    logs: bool = False


def understand(text: str) -> Condition:
    """A condition over `VALUES` and `FUNCTIONS`.

    Raises:
        InputError: it cannot be understood.
    """
    return parse_condition(text, set(VALUES), set(FUNCTIONS))


class Breakpoints:
    """An unchangeable list of them; every change gives a new one."""

    def __init__(self, items: tuple[Breakpoint, ...] = (), following: int = 1) -> None:
        self.items, self._following = items, following

    def added(self, text: str) -> "Breakpoints":
        """With one more.

        Raises:
            InputError: the condition cannot be understood, is there already, or there are too many.
        """
        condition = understand(text)
        if any(item.condition.text == condition.text for item in self.items):
            raise InputError(f"breakpoint {condition.text}: is there already")
        if len(self.items) >= MAX_BREAKPOINTS:
            raise InputError(f"expected at most {MAX_BREAKPOINTS} breakpoints; remove some first")
        return Breakpoints((*self.items, Breakpoint(condition, self._following)), self._following + 1)

    def removed(self, number: int) -> "Breakpoints":
        return Breakpoints(tuple(item for item in self.items if item.number != number), self._following)

    def changed(self, number: int, change: Callable[[Breakpoint], Breakpoint]) -> "Breakpoints":
        return Breakpoints(
            tuple(change(item) if item.number == number else item for item in self.items), self._following
        )

    def asked(self, record: StepRecord, moment: int) -> tuple["Breakpoints", list[Breakpoint]]:
        """With the hits of a step counted, and those that were hit."""
        if not self.items:
            return self, []
        quantities = quantities_of(record, moment)
        hit = [item for item in self.items if item.enabled and item.condition.holds(quantities)]
        counted = tuple(replace(item, hits=item.hits + 1) if item in hit else item for item in self.items)
        return Breakpoints(counted, self._following), hit


def quantities_of(record: StepRecord, moment: int) -> Quantities:
    """What a condition may ask about a step, computed when asked."""
    names = [short_reason(StepReason(int(reason))) for reason in record.reasons]
    before, after = record.energy_before, record.energy_after

    def weakest() -> float:
        known = record.eigenvalues[record.eigenvalues[:, 2] > 0]
        return float((known[:, 0] / known[:, 2]).min()) if len(known) else float("nan")

    def moved(vertex: float) -> float:
        slot = slot_of(record, int(vertex)) if vertex == vertex and abs(vertex) < 1e9 else None
        made = slot is not None and (record.before[slot] != record.after[slot]).any()
        return float(record.step_px[slot]) if slot is not None and made else 0.0

    def view(index: float) -> float:
        if not 0 <= index < len(record.view_energy_after):
            return float("nan")
        return float(record.view_energy_after[int(index)] - record.view_energy_before[int(index)])

    values: dict[str, Callable[[], float]] = {
        "moment": lambda: float(moment),
        "level": lambda: record.position.level + 1.0,
        "sweep": lambda: record.position.sweep + 1.0,
        "unit": lambda: record.position.unit + 1.0,
        "iteration": lambda: record.position.iteration + 1.0,
        "energy": lambda: after,
        "change": lambda: after - before,
        "percent": lambda: 100 * (after - before) / before if before else float("nan"),
        "step_px": lambda: float(record.step_px.max(initial=0)),
        "damping": lambda: float(record.damping.max(initial=0)),
        "rejected": lambda: float(sum(name.startswith("rejected") for name in names)),
        "accepted": lambda: float(np.count_nonzero((record.before != record.after).any(axis=1))),
        "weakest": weakest,
    }
    functions: dict[str, Callable[[float], float]] = {
        "about": lambda vertex: float((record.vertices == vertex).any()),
        "moved": moved,
        "view": view,
        "abs": abs,
    }
    return Quantities(values, functions)

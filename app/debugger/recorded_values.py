"""Recorded values: the quantities of a step record with names and units, and where each last changed."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.debugger.history import last_step_about
from app.html import number, numbers, text
from fairing.trace import StepReason, StepRecord


@dataclass(frozen=True)
class Item:
    """One recorded quantity.

    Attributes:
        name: with its unit, if it has one.
        read: reads it from a record; the second argument is the index of the vertex in the record.
        of_vertex: whether it belongs to a vertex, else to the step.
        shown: formats it as markup.
    """

    name: str
    read: Callable[[StepRecord, int], Any]
    of_vertex: bool = True
    shown: Callable[[Any], str] = lambda value: number(float(value))


def _length(vectors: np.ndarray) -> float:
    return float(np.linalg.norm(vectors))


def _pair(values: tuple[float, float]) -> str:
    return f"{number(values[0])} → {number(values[1])}"


def _whole(value: Any) -> str:
    return text(int(value))


ITEMS: tuple[Item, ...] = (
    Item("position", lambda r, i: r.after[i], shown=lambda p: ", ".join(f"{x:.5g}" for x in p)),
    Item("step in the photos, px", lambda r, i: r.step_px[i]),
    Item("step proposed, world units", lambda r, i: _length(r.proposed[i])),
    Item("step made, world units", lambda r, i: _length(r.after[i] - r.before[i])),
    Item("damping", lambda r, i: r.damping[i]),
    Item("damping next", lambda r, i: r.damping_next[i]),
    Item("rejections in a row", lambda r, i: r.rejections[i], shown=_whole),
    Item("eigenvalues", lambda r, i: r.eigenvalues[i], shown=lambda value: numbers(value, 2)),
    Item(
        "smallest / largest eigenvalue",
        lambda r, i: r.eigenvalues[i, 0] / r.eigenvalues[i, 2] if r.eigenvalues[i, 2] > 0 else 0.0,
        shown=lambda value: number(float(value), 3),
    ),
    Item("reason", lambda r, i: int(r.reasons[i]), shown=lambda reason: text(StepReason(reason).text)),
    Item("level", lambda r, i: r.position.level + 1, of_vertex=False, shown=_whole),
    Item("sweep of the level", lambda r, i: r.position.sweep + 1, of_vertex=False, shown=_whole),
    Item("place in the sweep", lambda r, i: r.position.block + 1, of_vertex=False, shown=_whole),
    Item("iteration", lambda r, i: r.position.iteration + 1, of_vertex=False, shown=_whole),
    Item("sweep began at moment", lambda r, i: r.sweep_moment, of_vertex=False, shown=_whole),
    Item("vertices of this step", lambda r, i: len(r.vertices), of_vertex=False, shown=_whole),
    Item("faces around these vertices", lambda r, i: len(r.faces), of_vertex=False, shown=_whole),
    Item("energy of these faces", lambda r, i: (r.energy_before, r.energy_after), of_vertex=False, shown=_pair),
    Item(
        "energy with priors, as tried",
        lambda r, i: (r.objective_before, r.objective_after),
        of_vertex=False,
        shown=_pair,
    ),
    Item(
        "rejected vertices",
        lambda r, i: int(np.isin(r.reasons, [StepReason.REJECTED_ENERGY, StepReason.REJECTED_FOLD]).sum()),
        of_vertex=False,
        shown=_whole,
    ),
    Item(
        "photo with the largest energy decrease",
        lambda r, i: _photo_of_largest_decrease(r),
        of_vertex=False,
        shown=lambda photo: text(photo) if photo else "none",
    ),
)


def _photo_of_largest_decrease(record: StepRecord) -> int:
    """Number of a photo, from 1 as everywhere in the page; 0 if the energy fell in no photo."""
    change = record.view_energy_after - record.view_energy_before
    return int(np.argmin(change)) + 1 if (change < 0).any() else 0


def value_at(item: Item, steps: list[StepRecord], moment: int, vertex: int) -> Any:
    """The value at a moment, from the last step (that includes the vertex); None before the first one."""
    found = _last(item, steps, moment, vertex)
    return None if found is None else item.read(found[1], found[2])


def last_change(item: Item, steps: list[StepRecord], moment: int, vertex: int) -> int | None:
    """The last moment before `moment` at which the value changed; None if it never did.

    Its first value counts as a change. Applied to the result, this returns the change before it.
    """
    found = _last(item, steps, moment, vertex)
    while found is not None:
        led_to, record, slot = found
        before = _last(item, steps, led_to - 1, vertex)
        is_new = before is None or not np.array_equal(item.read(record, slot), item.read(before[1], before[2]))
        if is_new and led_to < moment:
            return led_to
        found = before
    return None


def _last(item: Item, steps: list[StepRecord], moment: int, vertex: int) -> tuple[int, StepRecord, int] | None:
    if item.of_vertex:
        return last_step_about(steps, moment, vertex)
    return (moment, steps[moment - 1], 0) if moment > 0 else None

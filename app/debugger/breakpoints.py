"""Breakpoints: conditions that stop a run after the step for which they hold."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from app.debugger.condition import Condition
from app.debugger.quantities import StepContext, parse_step_condition, quantities_of
from fairing.errors import InputError
from fairing.terms.names import TERMS
from fairing.trace import StepRecord

MAX_BREAKPOINTS = 50


@dataclass(frozen=True)
class Breakpoint:
    """A condition that is checked after every step.

    Attributes:
        condition: checked after every step.
        number: identifies the breakpoint.
        enabled: whether it is checked.
        hits: how often it has held.
        logs: add a line to the log instead of stopping.
    """

    condition: Condition
    number: int
    enabled: bool = True
    hits: int = 0
    logs: bool = False


class Breakpoints:
    """An immutable list of breakpoints; every change returns a new list."""

    def __init__(self, items: tuple[Breakpoint, ...] = (), next_number: int = 1) -> None:
        self.items, self._next_number = items, next_number

    def added(
        self, text: str, limits: Mapping[str, int] = MappingProxyType({}), terms: Iterable[str] = TERMS
    ) -> "Breakpoints":
        """With one more; `limits` and `terms` as for `parse_step_condition`.

        Raises:
            InputError: the condition cannot be parsed, exists already, or there are too many breakpoints.
        """
        condition = parse_step_condition(text, limits, terms)
        if any(item.condition.text == condition.text for item in self.items):
            raise InputError(f"breakpoint {condition.text}: exists already")
        if len(self.items) >= MAX_BREAKPOINTS:
            raise InputError(f"expected at most {MAX_BREAKPOINTS} breakpoints; remove some first")
        return Breakpoints((*self.items, Breakpoint(condition, self._next_number)), self._next_number + 1)

    def removed(self, number: int) -> "Breakpoints":
        return Breakpoints(tuple(item for item in self.items if item.number != number), self._next_number)

    def changed(self, number: int, change: Callable[[Breakpoint], Breakpoint]) -> "Breakpoints":
        return Breakpoints(
            tuple(change(item) if item.number == number else item for item in self.items), self._next_number
        )

    def checked(self, record: StepRecord, moment: int, context: StepContext) -> tuple["Breakpoints", list[Breakpoint]]:
        """With the hits of a step counted, and the breakpoints that were hit."""
        if not self.items:
            return self, []
        quantities = quantities_of(record, moment, context)
        hit = [item for item in self.items if item.enabled and item.condition.holds(quantities)]
        counted = tuple(replace(item, hits=item.hits + 1) if item in hit else item for item in self.items)
        return Breakpoints(counted, self._next_number), hit

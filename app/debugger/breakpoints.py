"""Where a run stops by itself: after a step for which a condition holds."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from app.debugger.condition import Condition
from app.debugger.quantities import Around, quantities_of, understand
from fairing.errors import InputError
from fairing.trace import StepRecord

MAX_BREAKPOINTS = 50


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


class Breakpoints:
    """An unchangeable list of them; every change gives a new one."""

    def __init__(self, items: tuple[Breakpoint, ...] = (), following: int = 1) -> None:
        self.items, self._following = items, following

    def added(self, text: str, limits: Mapping[str, int] = MappingProxyType({})) -> "Breakpoints":
        """With one more; `limits` as for `understand`.

        Raises:
            InputError: the condition cannot be understood, is there already, or there are too many.
        """
        condition = understand(text, limits)
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

    def asked(self, record: StepRecord, moment: int, around: Around) -> tuple["Breakpoints", list[Breakpoint]]:
        """With the hits of a step counted, and those that were hit."""
        if not self.items:
            return self, []
        quantities = quantities_of(record, moment, around)
        hit = [item for item in self.items if item.enabled and item.condition.holds(quantities)]
        counted = tuple(replace(item, hits=item.hits + 1) if item in hit else item for item in self.items)
        return Breakpoints(counted, self._following), hit

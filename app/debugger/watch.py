"""Watch expressions: formulas over the recorded quantities of a step, shown for every step."""

from collections.abc import Iterable

from app.debugger.condition import Condition, parse_condition
from app.debugger.moment_pulls import MomentPulls
from app.debugger.quantities import (
    FUNCTIONS,
    ITEMS,
    OF_PULLS,
    PREDICATES,
    VALUES,
    item_words,
    limits_of,
    quantities_of,
)
from app.debugger.series import Series
from fairing.errors import InputError
from fairing.scene import Scene
from fairing.terms.names import TERMS
from fairing.trace import StepRecord

MAX_WATCHES = 12
# Quantities that are computed and not recorded: for breakpoints only, since a watch is evaluated at every moment.
COMPUTED = {"seen_changes", "travelled", "displaced", "outliers"}


def parse_watch(expression: str, scene: Scene, terms: Iterable[str] = TERMS) -> Condition:
    """An expression over the recorded quantities of a step.

    Args:
        terms: as for `parse_step_condition`.

    Raises:
        InputError: it cannot be parsed; the message shows the position.
    """
    if not expression.strip():
        raise InputError("watch: expected an expression such as energy / 1000 or moved(0)")
    names, functions = set(VALUES) - COMPUTED, set(FUNCTIONS) - COMPUTED
    watch = parse_condition(
        expression, names, functions, limits_of(scene), "watch", ITEMS, PREDICATES, COMPUTED, item_words(terms)
    )
    if watch.is_constant:
        raise InputError(
            f"watch, column 1: it is constant; expected a quantity such as energy / 1000 (at: ⟨here⟩{expression})"
        )
    return watch


def with_watch(watches: tuple[Condition, ...], new: Condition) -> tuple[Condition, ...]:
    """The expressions with one more.

    Raises:
        InputError: it exists already, or there are too many.
    """
    if any(watch.text == new.text for watch in watches):
        raise InputError(f"watch {new.text}: exists already")
    if len(watches) >= MAX_WATCHES:
        raise InputError(f"expected at most {MAX_WATCHES} watch expressions; remove some first")
    return (*watches, new)


def needs_pulls(watch: Condition) -> bool:
    """Whether the expression uses pulls, which are computed for the moment shown alone and not for every step."""
    return bool(watch.names & OF_PULLS)


def value_with_pulls(watch: Condition, record: StepRecord, moment: int, pulls: MomentPulls) -> float:
    """The value of an expression on pulls at the moment after a step."""
    return watch.evaluate(quantities_of(record, moment, pulls=pulls))


def watch_series(watch: Condition) -> Series:
    """The value of the expression after every step."""
    return Series(lambda record, moment: watch.evaluate(quantities_of(record, moment)))

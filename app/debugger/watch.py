"""Watch expressions: what a browser wants to see of every step."""

from app.debugger.condition import Condition, parse_condition
from app.debugger.quantities import FUNCTIONS, VALUES, limits_of, quantities_of
from app.debugger.series import Series
from fairing.errors import InputError
from fairing.scene import Scene

MAX_WATCHES = 12
# What is not in the record but must be computed is for breakpoints; a watch is asked at every moment.
COMPUTED = {"seen_changes", "travelled", "displaced", "outliers"}


def understand_watch(expression: str, scene: Scene) -> Condition:
    """An expression over what is recorded of a step.

    Raises:
        InputError: it cannot be understood; the message points at the place.
    """
    if not expression.strip():
        raise InputError("watch: expected an expression such as energy / 1000 or moved(0)")
    return parse_condition(expression, set(VALUES) - COMPUTED, set(FUNCTIONS) - COMPUTED, limits_of(scene), "watch")


def with_watch(watches: tuple[Condition, ...], new: Condition) -> tuple[Condition, ...]:
    """The expressions with one more.

    Raises:
        InputError: it is there already, or there are too many.
    """
    if any(watch.text == new.text for watch in watches):
        raise InputError(f"watch {new.text}: is there already")
    if len(watches) >= MAX_WATCHES:
        raise InputError(f"expected at most {MAX_WATCHES} watch expressions; remove some first")
    return (*watches, new)


def watch_series(watch: Condition) -> Series:
    """The expression's value after every step."""
    return Series(lambda record, moment: watch.evaluate(quantities_of(record, moment)))

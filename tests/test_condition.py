"""Conditions of breakpoints: a small grammar that points at mistakes and can do no harm."""

import pytest

from app.debugger.breakpoints import Breakpoints
from app.debugger.condition import Quantities, parse_condition
from app.debugger.quantities import FUNCTIONS, VALUES, parse_step_condition
from app.page_state.page_state import PageState
from app.page_state.selection import Selection
from fairing.errors import InputError

QUANTITIES = Quantities(
    {"a": lambda: 2.0, "b": lambda: -3.0, "missing": lambda: float("nan")},
    {"abs": abs, "double": lambda x: 2 * x},
)


def value(text: str) -> float:
    limits = {"double": 5}
    return parse_condition(text, set(QUANTITIES.values), set(QUANTITIES.functions), limits).evaluate(QUANTITIES)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 + 2 * 3", 7),
        ("(1 + 2) * 3", 9),
        ("10 - 4 - 3", 3),
        ("-a - -b", -5),
        ("abs(b) == 3", 1),
        ("double(a + 1) / 4", 1.5),
        ("double(4)", 8),
        ("double(4 + 9)", 26),
        ("a > 1 and b > 1", 0),
        ("a > 1 or b > 1", 1),
        ("not a > 1", 0),
        ("not not a > 1", 1),
        ("1e-3 < .5", 1),
        ("a != 2 or not (b >= 0)", 1),
    ],
)
def test_conditions_mean_what_they_say(text: str, expected: float):
    assert value(text) == expected


@pytest.mark.parametrize("text", ["missing > 0", "missing", "1 / 0", "not missing and 1 / 0", "missing == missing"])
def test_what_does_not_exist_is_never_true(text: str):
    condition = parse_condition(text, set(QUANTITIES.values), set(QUANTITIES.functions))
    assert not condition.holds(QUANTITIES)


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("", 1),
        ("a >", 4),
        ("a > 1 b", 7),
        ("a & b", 3),
        ("(a > 1", 7),
        ("abs a", 5),
        ("foo > 1", 1),
        ("a.__class__", 2),
        ("__import__('os')", 12),
        ("a > 1; b", 6),
        ("a < b < a", 7),
        ("1 + double(5)", 12),
        ("double(1.5) > 1", 8),
    ],
)
def test_mistakes_are_pointed_at(text: str, column: int):
    with pytest.raises(InputError, match=rf"column {column}\b"):
        value(text)


def test_endless_conditions_are_refused():
    with pytest.raises(InputError, match="deeply nested"):
        value("(" * 60 + "a" + ")" * 60)
    with pytest.raises(InputError, match="at most 200"):
        value("a + " * 100 + "a")
    assert value("-" * 150 + "a") == 2


def test_a_breakpoint_cannot_be_added_twice():
    breakpoints = Breakpoints().added("level == 2")
    with pytest.raises(InputError, match="already"):
        breakpoints.added(" level == 2 ")
    assert breakpoints.removed(breakpoints.items[0].number).items == ()


def test_every_word_that_is_offered_is_understood():
    from app.panels.breakpoints_panel import ready_made

    for name in VALUES:
        parse_step_condition(f"{name} > 0")
    for name in FUNCTIONS:
        parse_step_condition(f"{name}(1) > 0")
    for condition in ready_made(PageState(Selection((3,)), entered=2)).values():
        parse_step_condition(condition)

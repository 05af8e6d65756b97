"""Conditions of breakpoints: a small grammar that points at mistakes and can do no harm."""

import pytest

from app.debugger.breakpoints import Breakpoints
from app.debugger.condition import ANY, Quantities, parse_condition
from app.debugger.quantities import (
    FUNCTIONS,
    OF_PULLS,
    PREDICATES,
    STAGE_WORDS,
    VALUES,
    limits_of,
    parse_step_condition,
)
from app.debugger.watch import COMPUTED, parse_watch
from app.page_state.page_state import PageState
from app.page_state.selection import Selection
from app.panels.condition_field import mistake_html, words_for
from fairing.errors import InputError
from fairing.terms.names import TERMS
from tests.small_scene import corner_scene

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


def test_the_word_vertex_or_view_means_any_of_them():
    seen = []

    def largest(number: float) -> float:
        seen.append(number)
        return {ANY: 9.0}.get(number, 1.0)

    quantities = Quantities({"a": lambda: 2.0}, {"moved": largest, "view": largest})
    items = {"moved": "vertex", "view": "view"}

    def parse(text: str):
        return parse_condition(text, {"a"}, {"moved", "view"}, {"moved": 5, "view": 3}, items=items)

    assert parse("moved(vertex) > 8").holds(quantities)
    assert parse("view(view) == 9 and moved(3) == 1").holds(quantities)
    assert seen == [ANY, ANY, 3.0]
    for wrong in ("moved(view) > 1", "view(vertex) > 1", "moved(vertex + 1) > 1", "vertex > 1"):
        with pytest.raises(InputError, match=r"expected|not known"):
            parse(wrong)
    parse("view(3) > 0")
    for wrong in ("view(0) > 0", "view(4) > 0"):
        with pytest.raises(InputError, match=r"view\(\) expects a whole number from 1 to 3"):
            parse(wrong)


@pytest.mark.parametrize(
    "text", ["rejected", "energy / 2", "rejected and level == 2", "not moved(3)", "moved(3) or sweep"]
)
def test_a_breakpoint_on_a_number_without_a_comparison_is_refused(text: str):
    with pytest.raises(InputError, match="expected a comparison"):
        parse_step_condition(text)


@pytest.mark.parametrize("text", ["1", "1 > 0", "2 == 1 + 1", "not 3 < 4"])
def test_a_constant_is_neither_a_breakpoint_nor_a_watch(text: str):
    with pytest.raises(InputError, match="constant"):
        parse_step_condition(text)
    with pytest.raises(InputError, match="constant"):
        parse_watch(text, corner_scene())


def test_watches_and_breakpoints_have_one_grammar():
    scene = corner_scene()
    for text in ("about(0)", "abs(percent) < 0.01", "moved(vertex) > 2", "view(1) > 0 and not about(2)"):
        parse_step_condition(text, limits_of(scene))
        parse_watch(text, scene)
    assert parse_watch("100 * weakest", scene).text == "100 * weakest"
    for name in sorted(COMPUTED):
        with pytest.raises(InputError, match="cannot be watched"):
            parse_watch(name, scene)


def test_a_mistake_is_shown_with_a_caret_below_its_place():
    with pytest.raises(InputError) as caught:
        parse_step_condition("rejected >> 0")
    shown = mistake_html(str(caught.value))
    typed, caret = shown.partition("<pre>")[2].partition("</pre>")[0].split("\n")
    assert typed == "rejected &gt;&gt; 0"
    assert caret == " " * len("rejected >") + "<b class='rejected'>^</b>"


def test_names_are_offered_with_the_selected_vertex_and_the_photo_looked_through():
    words = {word for word, _ in words_for(PageState(Selection((17,)), entered=2), TERMS)}
    assert {"rejected", "travelled(17)", "outliers(3)"} <= words
    assert {"travelled(vertex)", "outliers(view)"} <= {word for word, _ in words_for(PageState(), TERMS)}


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
    for kind in STAGE_WORDS:
        parse_step_condition(f"stage({kind}) and accepted > 0")
    for name in FUNCTIONS.keys() - OF_PULLS - {"stage"}:
        parse_step_condition(f"{name}(change) > 0" if name not in PREDICATES else f"{name}(1)")
    for condition in ready_made(PageState(Selection((3,)), entered=2)).values():
        parse_step_condition(condition)

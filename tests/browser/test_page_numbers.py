"""Numbers are written in the same way by the pages' JavaScript and by Python."""

import random
from pathlib import Path

import pytest
from playwright.sync_api import Page

import app
from app.html import number
from tests.browser.driver import IN_BROWSER

pytestmark = [*IN_BROWSER, pytest.mark.slow]

MODULE = Path(app.__file__).parent / "web" / "numbers.js"


def written(page: Page, function: str, values: list[float], digits: int) -> list[str]:
    source = MODULE.read_text(encoding="utf-8").replace("export ", "")
    return page.evaluate(
        f"([values, digits]) => {{ {source}; return values.map(value => {function}(value, digits)); }}",
        [values, digits],
    )


@pytest.mark.parametrize("digits", [2, 3, 4, 5])
def test_numbers_are_those_of_python(page: Page, digits: int):
    draw = random.Random(digits)
    drawn = [draw.choice((-1, 1)) * 10 ** draw.uniform(-9, 12) for _ in range(500)]
    values = [0.0, 17.0, 0.5, 9.9999999, 99999.99, 1e-4, 9.9e-5, 1e7, 9999999.0, *drawn]
    assert written(page, "brief", values, digits) == [number(value, digits) for value in values]


def test_ticks_have_no_zeros_at_their_end(page: Page):
    values = [17.0, 0.5, 2.25, 100.0, 1200.0, 1e-5, -3.0, 0.0]
    assert written(page, "tickLabel", values, 3) == ["17", "0.5", "2.25", "100", "1\u2009200", "1e-05", "\u22123", "0"]

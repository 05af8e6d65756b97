"""The page of a run with corrected cameras: the table of photos, the steps of the adjustment, the given places."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from app.page.server import App, start
from fairing.run.session import Session
from tests.browser.driver import IN_BROWSER, WINDOW, Visitor, page_of
from tests.browser.page_fit import SIZES, too_wide
from tests.waiting import wait_for
from tests.wrong_cameras import exact_scene, turned

pytestmark = [*IN_BROWSER, pytest.mark.slow]


@pytest.fixture(scope="module")
def app() -> Iterator[App]:
    app = start(Session(replace(turned(exact_scene(), 1.0), cameras_choice="refine")), port=0)
    yield app
    app.stop()


def open_tab(visitor: Visitor) -> None:
    visitor.page.get_by_role("tab", name="Cameras", exact=True).click()
    visitor.page.locator(".photos tr").nth(9).wait_for()


def test_every_photo_has_its_correction_and_errors(visitor: Visitor):
    open_tab(visitor)
    rows = visitor.page.locator(".photos tr").all_inner_texts()[1:]
    assert len(rows) == 9
    assert visitor.page.locator(".lens").count() == 0, "no intrinsics were refined"
    numbers = np.array([[float(cell) for cell in row.split("\t")[-3:]] for row in rows])
    assert (numbers[:, 0] > 0).all()
    assert np.median(numbers[:, 2]) < 0.5 * np.median(numbers[:, 1])


def test_the_slider_goes_through_the_steps_of_the_adjustment(visitor: Visitor):
    open_tab(visitor)
    state = page_of(visitor.app).page_state
    try:
        for step, head in ((2, "Error step 2, px"), (0, "Error given, px")):
            state.adjustment_step = step
            visitor.app.controller.republish()
            visitor.page.get_by_role("columnheader", name=head).wait_for()
    finally:
        state.adjustment_step = 0


def test_a_click_looks_through_the_camera_of_a_photo(visitor: Visitor):
    open_tab(visitor)
    visitor.page.locator(".photos button").nth(4).click()
    wait_for(lambda: page_of(visitor.app).page_state.entered == 4)
    visitor.page.keyboard.press("0")
    wait_for(lambda: page_of(visitor.app).page_state.entered is None)


def test_the_table_fits(visitor: Visitor):
    open_tab(visitor)
    for size in SIZES:
        visitor.resize(size)
        assert too_wide(visitor) == [], size
    visitor.resize(WINDOW)

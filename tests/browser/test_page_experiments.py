"""Experiments in a real browser: start, see the chart fill, cancel, take the results away."""

import csv
import re
from pathlib import Path

import pytest
from PIL import Image

from app.page.server import start
from fairing.run.session import Session
from tests.browser.driver import IN_BROWSER, Visitor
from tests.small_scene import corner_scene, small_options
from tests.waiting import wait_for

pytestmark = IN_BROWSER

OPTIONS = small_options(schedule={"blur": [1.2], "max_sweeps": [3]}, cells={"size": [32]})


@pytest.fixture(scope="module")
def app():
    app = start(Session(corner_scene(), OPTIONS), port=0)
    yield app
    app.stop()


def test_an_experiment_fills_its_chart_beside_the_run_and_can_be_taken_away(visitor: Visitor, tmp_path: Path):
    page, controller = visitor.page, visitor.app.controller
    page.get_by_role("tab", name="Experiments").click()
    page.get_by_text("Warps and solvers", exact=True).click()
    visitor.button("Start the experiment").click()
    chart = page.get_by_role("img", name="End error of each start")
    page.wait_for_function(
        "() => document.querySelectorAll(\"svg[aria-label='End error of each start'] circle\").length >= 3",
    )
    before = controller.state.length
    assert visitor.press("Step one iteration").length == before + 1  # the engine is free
    visitor.button("Cancel (finished runs are kept)").click()  # the debug bar has a Cancel of its own
    page.get_by_text(re.compile(r"cancelled after \d+ of 24 runs")).wait_for()
    drawn = chart.locator("circle").count()
    assert 3 <= drawn < 24

    with page.expect_download() as table:
        visitor.button("Download the table").click()
    table.value.save_as(tmp_path / "warps.csv")
    lines = list(csv.DictReader((tmp_path / "warps.csv").open()))
    assert len(lines) == drawn
    shown = {title.split()[-1] for title in chart.locator("circle title").all_text_contents()}
    assert all(f"{float(line['end_percent']):.3g}"[:4] in "".join(shown) for line in lines)

    with page.expect_download() as picture:
        visitor.button("Download the picture").click()
    picture.value.save_as(tmp_path / "warps.png")
    assert Image.open(tmp_path / "warps.png").width > 1500


def test_one_experiment_at_a_time(visitor: Visitor):
    page = visitor.page
    page.get_by_text("Capture range", exact=True).click()
    visitor.button("Start the experiment").click()
    page.get_by_text("Accuracy against noise", exact=True).click()
    page.get_by_text("Capture range is running; only one experiment runs at a time.").wait_for()
    page.get_by_text("Capture range", exact=True).click()
    visitor.button("Cancel (finished runs are kept)").click()
    wait_for(lambda: visitor.app.resources.experiments.working is None)
    visitor.button("Start the experiment").wait_for()

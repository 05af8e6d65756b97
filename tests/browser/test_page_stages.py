"""Stages of a run in the page: band, keys, status line, plots; the table of pulls in a small window."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import expect

from app.debugger.commands import JumpTo
from app.page.server import App, start
from fairing.run.recorded_stages import RecordedStage, recorded_stages
from fairing.run.session import Session
from fairing.stage_kind import StageKind
from tests.browser.driver import IN_BROWSER, WINDOW, Visitor, page_of
from tests.browser.page_fit import serious_findings, show, switch_theme, themes_and_sizes, too_wide
from tests.small_scene import corner_scene, small_options
from tests.staged_run import staged_trace

pytestmark = [*IN_BROWSER, pytest.mark.slow]

LOOKED_AT = (StageKind.POINTS, StageKind.JUDGE, StageKind.PHOTOS)


@pytest.fixture(scope="module")
def app() -> Iterator[App]:
    scene = corner_scene()
    session = Session(scene, small_options(schedule={"order": "joint", "max_sweeps": [2], "max_iterations": [3]}))
    session.run()
    app = start(Session(scene, trace=staged_trace(session)), port=0)
    yield app
    app.stop()


@pytest.fixture
def stages(visitor: Visitor) -> list[RecordedStage]:
    return recorded_stages(visitor.app.controller.state.trace)


def go_to(visitor: Visitor, moment: int) -> None:
    visitor.app.controller.post(JumpTo(moment))
    visitor.app.controller.wait_until_idle()


def first_of(stages: list[RecordedStage], kind: StageKind) -> RecordedStage:
    return next(stage for stage in stages if stage.kind is kind)


def test_keys_and_buttons_step_over_stages_forwards_and_back(visitor: Visitor, stages: list[RecordedStage]):
    go_to(visitor, 3)
    assert visitor.key("Shift+N").moment == stages[0].end
    assert visitor.press("Step one stage").moment == stages[1].end
    assert visitor.key("Shift+U").moment == stages[1].begin
    assert visitor.press("Step back one stage").moment == stages[0].begin


def test_the_band_names_the_stages_and_leads_to_them(visitor: Visitor, stages: list[RecordedStage]):
    go_to(visitor, 1)
    parts = visitor.page.get_by_role("list", name="Stages").get_by_role("listitem")
    expect(parts).to_have_count(len(stages))
    axes = first_of(stages, StageKind.AXES)
    part = parts.nth(stages.index(axes))
    hint = part.get_attribute("title")
    assert hint is not None
    assert hint.startswith(f"Axes: level {axes.level + 1} of 3, blur ")
    assert f"{axes.end - axes.begin} steps. {StageKind.AXES.text}" in hint
    before = visitor.serial()
    part.click()
    assert visitor.settle(before).moment == axes.begin
    # It lies below the strip and covers what the strip covers: both count moments alike.
    band = visitor.box_of(visitor.page.locator(".ef .stages"))
    strip = visitor.box_of(visitor.page.locator(".ef .strip"))
    assert abs(band["x"] - strip["x"]) < 0.6
    assert abs(band["width"] - strip["width"]) < 0.6


def test_the_status_line_names_the_stage_and_leads_to_its_beginning(visitor: Visitor, stages: list[RecordedStage]):
    go_to(visitor, 5)
    line = visitor.page.locator(".ef button.in-stage")
    line.get_by_text("points · gate 3 of 20", exact=True).wait_for()
    visitor.page.locator("[title*='Objective of the fit']").wait_for()
    before = visitor.serial()
    line.click()
    assert visitor.settle(before).moment == 0
    go_to(visitor, first_of(stages, StageKind.JUDGE).end)
    line.get_by_text("judge · 4 vertices go back", exact=True).wait_for()
    visitor.page.locator("[title*='not measured in this step']").first.wait_for()


def test_the_plots_of_energy_leave_fits_out_and_the_plot_of_fits_photos(visitor: Visitor, stages: list[RecordedStage]):
    go_to(visitor, 5)
    chips, page = visitor.page.locator(".ef .quantities"), visitor.page
    chips.get_by_role("button", name="fit", exact=True).click()
    page.get_by_role("img", name="Fit plot").wait_for()
    fits = [stage for stage in stages if stage.kind.is_fit]
    lines = page.get_by_role("img", name="Fit plot").locator("polyline")
    expect(lines, "the line of the first one is pale from the current moment on").to_have_count(len(fits) + 1)
    chips.get_by_role("button", name="energy", exact=True).click()
    plot = page.get_by_role("img", name="Sweep energy plot")
    plot.wait_for()
    expect(plot.locator("circle[r='4']"), "no value is marked where no photo was read").to_have_count(0)
    photos = [stage for stage in stages if stage.kind is StageKind.PHOTOS]
    go_to(visitor, photos[0].begin + 1)
    plot.locator("circle[r='4']").wait_for()


def test_energies_of_terms_are_drawn_at_the_moments_visited(visitor: Visitor, stages: list[RecordedStage]):
    photos = first_of(stages, StageKind.PHOTOS)
    go_to(visitor, photos.begin + 1)
    chips, page = visitor.page.locator(".ef .quantities"), visitor.page
    chips.get_by_role("button", name="energy", exact=True).click()
    chips.get_by_role("button", name="terms", exact=True).click()
    chips.get_by_text("photos").wait_for()
    visitor.press("Step one iteration")
    source = page_of(visitor.app).panels._pulls
    page.wait_for_function("() => document.querySelectorAll('.ef svg.plot polyline').length > 0")
    assert set(source.energies(visitor.app.controller.state.run_id)) >= {photos.begin + 1, photos.begin + 2}
    chips.get_by_role("button", name="terms", exact=True).click()


@pytest.mark.parametrize("kind", LOOKED_AT)
def test_everything_fits_both_windows_in_both_themes(visitor: Visitor, stages: list[RecordedStage], kind: StageKind):
    go_to(visitor, first_of(stages, kind).end)
    page_of(visitor.app).interaction.select(0)
    table = visitor.page.locator(".ef table.pulls")
    table.wait_for()
    show(visitor, "Timeline")
    show(visitor, "Vertex")
    for theme, size in themes_and_sizes(LOOKED_AT.index(kind)):
        switch_theme(visitor, theme)
        visitor.resize(size)
        assert too_wide(visitor) == [], f"{theme}, {size}"
        box = visitor.box_of(table)
        assert box["y"] + box["height"] <= size["height"], f"the table of pulls ends below the window, {theme}, {size}"
        band = visitor.box_of(visitor.page.locator(".ef .stages"))
        assert band["y"] + band["height"] <= size["height"], f"{theme}, {size}"
        assert serious_findings(visitor) == [], f"{theme}, {size}"
    visitor.resize(WINDOW)

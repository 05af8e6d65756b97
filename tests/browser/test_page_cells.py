"""What the page says of a vertex: cells, photos, plots, recorded values, watches; in a real browser."""

import pytest

from app.debugger.commands import JumpTo
from app.page.server import start
from app.page_state.cells_state import PARTS
from demo_scenes import load_demo
from fairing.run.session import Session
from tests.browser.driver import IN_BROWSER, Visitor, page_of
from tests.two_levels import two_levels
from tests.waiting import wait_for

pytestmark = IN_BROWSER

STEPS = 8


@pytest.fixture(scope="module")
def app():
    session = Session(load_demo("cube"), two_levels("sequential", sweeps=2, iterations=3))
    for _ in range(STEPS):
        session.step()
    app = start(session, port=0)
    yield app
    app.stop()


@pytest.fixture(autouse=True)
def selected(visitor: Visitor):
    """A vertex whose cells there are to look at."""
    if page_of(visitor.app).page_state.selected != 0:
        page_of(visitor.app).interaction.select(0)


def lens_events(visitor: Visitor) -> str:
    """The CSS property pointer-events of the lens."""
    window = visitor.page.locator("[data-floating-window]", has=visitor.page.get_by_alt_text("enlarged cell"))
    return window.evaluate("window => getComputedStyle(window).pointerEvents")


def test_a_cell_is_enlarged_and_says_its_values_under_the_pointer(visitor: Visitor):
    page, view = visitor.page, page_of(visitor.app).page_state
    name = visitor.app.controller.scene.views[2].name
    strip = page.get_by_role("button", name=f"Enlarge a cell in {name}", exact=True)
    strip.scroll_into_view_if_needed()
    box = visitor.box_of(strip)
    page.mouse.click(box["x"] + 3, box["y"] + 5)
    picture = page.get_by_alt_text("enlarged cell")
    picture.wait_for()
    assert view.cells.enlarged == (2, view.cells.columns[0])
    wait_for(lambda: lens_events(visitor) == "auto")
    box = visitor.box_of(picture)
    page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.3 * box["height"])
    page.get_by_text("U c", exact=False).last.wait_for()
    page.get_by_text("weight 0").or_(page.get_by_text("weight 1")).or_(
        page.get_by_text("not seen here")
    ).first.wait_for()
    visitor.button("Close the lens").click()
    wait_for(lambda: view.cells.enlarged is None)


def test_a_cell_is_enlarged_as_long_as_the_mouse_rests_on_it(visitor: Visitor):
    page, view = visitor.page, page_of(visitor.app).page_state
    name = visitor.app.controller.scene.views[1].name
    box = visitor.box_of(page.get_by_role("button", name=f"Enlarge a cell in {name}", exact=True))
    page.mouse.move(box["x"] + 3, box["y"] + 5)
    wait_for(lambda: view.cells.in_lens == (1, view.cells.columns[0]))
    page.get_by_alt_text("enlarged cell").wait_for()
    assert lens_events(visitor) == "none", "a picture that the user did not choose must not catch clicks"
    page.mouse.move(box["x"] + box["width"] - 3, box["y"] + 5)
    wait_for(lambda: view.cells.in_lens == (1, view.cells.columns[-1]))
    page.mouse.move(box["x"] + box["width"] + 300, box["y"] + 5)
    page.get_by_alt_text("enlarged cell").wait_for(state="hidden")
    assert view.cells.in_lens is None


def test_a_picture_of_a_pair_is_enlarged_and_changed_for_another(visitor: Visitor):
    page, view = visitor.page, page_of(visitor.app).page_state
    visitor.button("Page: Pair").click()
    visitor.button("Enlarge average, at the start").click()
    lens = page.locator(".ef", has=page.get_by_role("button", name="Close the lens"))
    lens.locator("img").wait_for()
    assert lens.locator("img").evaluate("image => image.naturalWidth") == 332, "not the picture it was closed with"
    before = lens.locator("img").get_attribute("src")
    visitor.button("Enlarge: i warped into j").press("Enter")  # the viewer's own notice may lie over it
    wait_for(lambda: view.cells.enlarged == (0, "start warped"))
    wait_for(lambda: lens.locator("img").get_attribute("src") not in (before, None))
    assert lens.locator("img").evaluate("image => image.naturalWidth") == 332
    visitor.button("Close the lens").click()
    wait_for(lambda: view.cells.enlarged is None)
    visitor.button("Page: Cells").click()


def test_columns_are_switched_and_another_k_is_looked_at_without_a_change_of_the_run(visitor: Visitor):
    page, view = visitor.page, page_of(visitor.app).page_state
    before = visitor.app.controller.state
    visitor.button("ρ").click()
    wait_for(lambda: "norm" in view.cells.columns)
    page.locator("svg.bars g[onclick]").nth(4).click()
    page.get_by_text("k = 5 instead of").wait_for()
    visitor.button("Back to the k of the run").click()
    wait_for(lambda: view.cells.dimensions is None)
    after = visitor.app.controller.state
    assert (after.run_id, after.moment, after.options) == (before.run_id, before.moment, before.options)


def test_photos_and_pairs_are_shown(visitor: Visitor):
    page = visitor.page
    name = visitor.app.controller.scene.views[1].name
    visitor.button("Page: In the photos").click()
    page.get_by_role("button", name=f"Enlarge {name}", exact=True).wait_for()
    visitor.button("Page: Pair").click()
    page.get_by_text("i warped into j").first.wait_for()
    visitor.button(f"Photo i: {name}").click()
    wait_for(lambda: page_of(visitor.app).page_state.cells.pair[0] == 1)
    visitor.button("Page: Cells").click()


def test_a_plot_of_the_vertex_is_chosen_and_clicked(visitor: Visitor):
    page, controller = visitor.page, visitor.app.controller
    controller.post(JumpTo(STEPS))
    controller.wait_until_idle()
    visitor.button("Plot longest step tried, px in a photo").click()
    visitor.button("Plot the selected vertex").click()
    plot = page.get_by_role("img", name="Step plot")
    plot.wait_for()
    box = visitor.box_of(plot)
    page.mouse.click(box["x"] + 0.56 * box["width"], box["y"] + 0.5 * box["height"])
    wait_for(lambda: 0 < controller.state.moment < STEPS)


def test_a_recorded_value_leads_to_its_last_change(visitor: Visitor):
    controller = visitor.app.controller
    controller.post(JumpTo(STEPS))
    controller.wait_until_idle()
    entry = visitor.button("Last change of position")
    entry.click()
    steps = controller.state.trace.steps
    moved = [n + 1 for n in range(STEPS) if 0 in steps[n].vertices and (steps[n].before != steps[n].after).any()]
    wait_for(lambda: controller.state.moment == moved[-1])


def test_a_watch_is_added_shows_its_value_and_is_removed(visitor: Visitor):
    page, view = visitor.page, page_of(visitor.app).page_state
    entry = visitor.input_of("Watch")
    entry.fill("energy *")
    entry.press("Enter")
    page.get_by_text("watch, column 9").first.wait_for()
    wait_for(lambda: entry.input_value() == "energy *")  # to be put right
    entry.fill("moment * 2")
    entry.press("Enter")
    wait_for(lambda: len(view.watches) == 1)
    moment = visitor.app.controller.state.moment
    page.locator("b.value", has_text=f"{2 * moment}").wait_for()
    visitor.button("Stop watching moment * 2").click()
    wait_for(lambda: not view.watches)


def test_the_parts_of_an_iteration_are_walked_by_keys_and_by_buttons(visitor: Visitor):
    page, view = visitor.page, page_of(visitor.app).page_state
    visitor.app.controller.post(JumpTo(1))
    visitor.app.controller.wait_until_idle()
    page.keyboard.press("Shift+I")
    for k, title in enumerate(PARTS.values()):
        page.get_by_text(f"{k + 1} of {len(PARTS)} · {title}", exact=True).wait_for()
        if k + 1 < len(PARTS):
            page.keyboard.press("Shift+J")
    page.get_by_text("recorded, to moment 2", exact=False).wait_for()
    page.keyboard.press("Shift+J")
    page.get_by_text("this is the last part of the iteration", exact=False).wait_for()
    visitor.button("Previous part").click()
    wait_for(lambda: view.cells.part == "limit")
    visitor.button("Part 5: Jacobian").click()
    page.get_by_text(f"5 of {len(PARTS)} · Jacobian", exact=True).wait_for()
    page.get_by_text("Eq. 5 and 6", exact=False).wait_for()
    visitor.button("Page: Cells").click()

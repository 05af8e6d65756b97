"""The presenter layout in a real browser: large at the left, folded at the right, and what a lesson shows is in sight."""

import pytest
from playwright.sync_api import ViewportSize

from app.lessons.reader import load_lesson
from app.lessons.scenes import load_lesson_scene
from app.page.server import start
from fairing.run.session import Session
from tests.browser.driver import IN_BROWSER, WINDOW, Visitor
from tests.browser.lesson_visit import arrive, choose_lesson, close_lesson, player_of
from tests.browser.page_fit import serious_findings, show, switch_theme, too_wide
from tests.waiting import wait_for

pytestmark = [*IN_BROWSER, pytest.mark.slow, pytest.mark.usefixtures("remembered_steps")]

LARGE: ViewportSize = {"width": 1920, "height": 1080}
IN_SIGHT = """selector => {
    const picture = document.querySelector(selector), text = document.querySelector('.ef .lesson');
    if (!picture || !text) return false;
    const box = picture.getBoundingClientRect();
    for (let around = picture.parentElement; around; around = around.parentElement)
        if (getComputedStyle(around).overflowY !== 'visible') {
            const room = around.getBoundingClientRect();
            if (box.top < room.top - 1 || box.bottom > room.bottom + 1 || box.right > room.right + 1) return false;
        }
    return box.width > 100 && box.bottom <= Math.min(innerHeight, text.getBoundingClientRect().top);
}"""
PAIR, STRIPS = ".ef .crops [aria-label^='Enlarge average']", "[aria-label^='Enlarge a cell'], [title^='Enlarge a cell']"


@pytest.fixture(scope="module")
def app():
    app = start(Session(load_lesson_scene("cube")), port=0)
    yield app
    app.stop()


def usual_widths(visitor: Visitor) -> tuple[float, float, float]:
    """The widths once the panels have come to rest."""
    visitor.wait_until_still()
    return widths(visitor)


def widths(visitor: Visitor) -> tuple[float, float, float]:
    """Of what is left of the view, of the view, and of what is right of it, px."""
    view, window = visitor.canvas_box(), visitor.page.evaluate("innerWidth")
    return view["x"], view["width"], window - view["x"] - view["width"]


def size_of_type(visitor: Visitor, selector: str) -> float:
    """Height of the letters as drawn, px: a font's size times the zoom around it."""
    return visitor.page.evaluate(
        """selector => {
            const element = [...document.querySelectorAll(selector)].find(found => found.checkVisibility());
            return parseFloat(getComputedStyle(element).fontSize) * element.currentCSSZoom;
        }""",
        selector,
    )


def test_key_button_and_palette_switch_the_layout_and_restore_it(visitor: Visitor):
    page = visitor.page
    usual, tabs = usual_widths(visitor), page.get_by_role("tab", name="Breakpoints", exact=True)
    leave = visitor.button("Leave presenter layout")

    def is_presenting() -> None:
        leave.wait_for()
        wait_for(lambda: widths(visitor)[0] > 1.25 * usual[0] and widths(visitor)[2] < 0.8 * usual[2])
        tabs.wait_for(state="hidden")
        visitor.button("Step one iteration").wait_for()

    def is_usual() -> None:
        leave.wait_for(state="hidden")
        tabs.wait_for()
        wait_for(lambda: widths(visitor) == pytest.approx(usual, abs=1))

    page.keyboard.press("Shift+P")
    is_presenting()
    leave.click()
    is_usual()
    show(visitor, "Layers")
    visitor.button("Large text and pictures at the left, the step buttons at the right").click()
    is_presenting()
    page.keyboard.press("Control+k")
    page.get_by_placeholder("Search").fill("Presenter layout")
    page.locator(".mantine-Spotlight-action", has_text="Presenter layout").first.wait_for()
    page.keyboard.press("Enter")
    is_usual()


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_type_grows_with_the_window_and_nothing_overflows(visitor: Visitor, theme: str):
    choose_lesson(visitor, "model")
    arrive(visitor, 0)
    switch_theme(visitor, theme)
    try:
        sizes = {}
        for size in (WINDOW, LARGE):
            visitor.resize(size)
            wait_for(lambda size=size: widths(visitor)[0] == pytest.approx(0.38 * size["width"], abs=6))
            assert widths(visitor)[1] > 0.38 * size["width"], "the 3D view is in the middle"
            sizes[size["width"]] = size_of_type(visitor, ".ef .lesson p")
            for name in ("#eigenfairing-overlay span", ".ef .extent > span"):
                assert size_of_type(visitor, name) > 0.0109 * size["width"], name
            assert too_wide(visitor) == []
            assert serious_findings(visitor) == []
        assert sizes[1280] > 15, "px"
        assert sizes[1920] == pytest.approx(1.5 * sizes[1280], rel=0.02)
    finally:
        visitor.resize(WINDOW)
        close_lesson(visitor)


def test_a_lesson_is_presented_with_its_pictures_in_sight_and_leaves_the_layout_as_it_was(visitor: Visitor):
    usual = usual_widths(visitor)
    choose_lesson(visitor, "model")
    arrive(visitor, 0)
    visitor.button("Leave presenter layout").wait_for()
    for n in range(1, len(load_lesson("model").steps)):
        visitor.page.keyboard.press("PageDown")
        arrive(visitor, n)
        if n + 1 in (3, 5, 6, 8):
            picture = PAIR if n + 1 in (3, 8) else STRIPS
            visitor.page.wait_for_function(IN_SIGHT, arg=picture)
    close_lesson(visitor)
    visitor.button("Leave presenter layout").wait_for(state="hidden")
    wait_for(lambda: widths(visitor) == pytest.approx(usual, abs=1))


def test_who_chose_the_layout_keeps_it_after_a_lesson(visitor: Visitor):
    visitor.page.keyboard.press("Shift+P")
    visitor.button("Leave presenter layout").wait_for()
    choose_lesson(visitor, "model")
    arrive(visitor, 0)
    close_lesson(visitor)
    assert player_of(visitor.app).lesson is None
    visitor.button("Leave presenter layout").click()
    visitor.button("Leave presenter layout").wait_for(state="hidden")

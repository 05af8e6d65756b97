"""Lessons in a real browser: every step shows its text, leads the page, and ends where the engine's record says."""

import pytest

from app.debugger.commands import JumpTo
from app.lessons.reader import lesson_names, load_lesson
from app.lessons.scenes import load_lesson_scene
from app.page.server import start
from fairing.run.session import Session
from tests.browser.driver import IN_BROWSER, Visitor, page_of
from tests.browser.lesson_visit import SLOW, WALKS_ALL_LESSONS, arrive, choose_lesson, close_lesson, player_of
from tests.waiting import wait_for

pytestmark = [*IN_BROWSER, pytest.mark.usefixtures("remembered_steps")]

PHOTOS = 300.0  # s: for a scene's photos, which are taken on first use
CUBE_LESSONS = [name for name in lesson_names() if load_lesson(name).scene == "cube"]
# `tests/test_lessons.py` runs all of them without a page.
WALKED = CUBE_LESSONS[1:] if WALKS_ALL_LESSONS else ("cells",)


@pytest.fixture(scope="module")
def app():
    app = start(Session(load_lesson_scene("cube")), port=0)
    yield app
    app.stop()


def choose_lesson_by_palette(visitor: Visitor, name: str) -> None:
    title = load_lesson(name).title
    visitor.page.keyboard.press("Control+k")
    visitor.page.get_by_placeholder("Search").fill(title[:20])
    visitor.page.get_by_role("button", name=f"Lesson: {title}").filter(visible=True).first.wait_for()
    visitor.page.keyboard.press("Enter")


def finish(visitor: Visitor) -> None:
    """From the first step to the last."""
    lesson = player_of(visitor.app).lesson
    assert lesson is not None
    for n in range(1, len(lesson.steps)):
        visitor.page.keyboard.press("PageDown")
        arrive(visitor, n)


def wait_for_scene(visitor: Visitor, name: str) -> None:
    """Wait until the page has come anew with another scene and its lesson."""
    wait_for(lambda: visitor.app.controller.scene.name == name, PHOTOS)
    wait_for(lambda: bool(visitor.app.pages) and player_of(visitor.app).lesson is not None, SLOW)
    arrive(visitor, 0)
    visitor.wait_for_page()


def test_the_first_lesson_is_read_with_the_mouse(visitor: Visitor):
    lesson, app, page = load_lesson("model"), visitor.app, visitor.page
    choose_lesson(visitor, "model")
    arrive(visitor, 0)
    page.get_by_role("tab", name="Cells", selected=True).wait_for()
    visitor.button("Answer 2").click()
    page.get_by_text("The wrong mesh puts their pixels in the wrong place.").wait_for()
    for n in range(1, len(lesson.steps)):
        visitor.button("Next step of the lesson").click()
        arrive(visitor, n)
        if "$$" in lesson.steps[n].text:
            formula = page.locator(".lesson math[display=block]")
            wait_for(lambda formula=formula: (formula.bounding_box() or {"height": 0})["height"] > 15)
    state = app.controller.wait_until_idle()
    visitor.sees_vertices(app.resources.stage.page_from_world(state.vertices))
    assert page_of(app).page_state.cells.page == "pair"
    visitor.button("Begin the next lesson").wait_for()


def test_a_walk_of_ones_own_is_noticed_and_the_lesson_resumed(visitor: Visitor):
    app, page = visitor.app, visitor.page
    choose_lesson(visitor, "model")
    arrive(visitor, 0)
    page_of(app).frame.toasts(player_of(app).go)(5)
    arrive(visitor, 5)
    app.controller.post(JumpTo(0))
    visitor.button("Resume lesson").wait_for()
    assert app.controller.wait_until_idle().moment == 0
    visitor.button("Resume lesson").click()
    visitor.button("Resume lesson").wait_for(state="hidden")
    assert app.controller.wait_until_idle().moment == 1
    page.keyboard.press("PageUp")
    arrive(visitor, 4)
    assert app.controller.wait_until_idle().moment == 0


def test_a_lesson_is_resumed_after_the_page_was_reloaded(visitor: Visitor):
    app = visitor.app
    choose_lesson(visitor, "beyond")
    arrive(visitor, 0)
    visitor.page.keyboard.press("PageDown")
    arrive(visitor, 1)
    left, page = app.controller.wait_until_idle(), page_of(app)
    assert left.locked.any()
    visitor.open()
    wait_for(lambda: bool(app.pages) and page_of(app) is not page)
    visitor.page.get_by_role("tab", name="Lesson", exact=True).wait_for(state="hidden")
    visitor.page.get_by_role("tab", name="Lessons").click()
    resume = visitor.button("Go on with the lesson where it was left")
    visitor.page.get_by_text("step 2 of").wait_for()
    visitor.wait_until_at_rest(resume)
    resume.click()
    arrive(visitor, 1)
    resume.wait_for(state="hidden")
    state = app.controller.wait_until_idle()
    assert (state.run_id, state.moment) == (left.run_id, left.moment)
    assert (state.locked == left.locked).all()
    visitor.page.keyboard.press("PageDown")
    arrive(visitor, 2)


@pytest.mark.parametrize("name", WALKED)
def test_a_lesson_on_the_cube_runs_to_its_end(visitor: Visitor, name: str):
    choose_lesson(visitor, name)
    arrive(visitor, 0)
    finish(visitor)


def test_the_palette_opens_a_lesson_and_the_cross_closes_it(visitor: Visitor):
    choose_lesson_by_palette(visitor, "model")
    arrive(visitor, 0)
    close_lesson(visitor)


def test_the_lesson_on_photographs_says_what_to_open_and_runs_on_what_there_is(visitor: Visitor):
    choose_lesson(visitor, "capture")
    visitor.page.get_by_text("This lesson is about real photographs.").wait_for()
    visitor.button("Open the demo archway").wait_for()
    visitor.button("Stay with the cube").click()
    wait_for(lambda: player_of(visitor.app).lesson is load_lesson("capture"))
    arrive(visitor, 0)
    finish(visitor)


def test_the_lesson_on_photographs_opens_the_archway_in_their_place(visitor: Visitor):
    choose_lesson(visitor, "capture")
    visitor.button("Open the demo archway").click()
    wait_for_scene(visitor, "archway")
    assert player_of(visitor.app).lesson is load_lesson("capture")
    visitor.page.keyboard.press("PageDown")
    arrive(visitor, 1)


def test_a_lesson_on_another_scene_opens_that_and_runs_there(visitor: Visitor):
    choose_lesson(visitor, "robust")
    wait_for_scene(visitor, "occluded-cube")
    visitor.page.keyboard.press("PageDown")
    arrive(visitor, 1)


def test_runs_of_ones_own_are_not_left_unasked(visitor: Visitor):
    app = visitor.app
    close_lesson(visitor)
    visitor.press("Step one iteration")
    choose_lesson_by_palette(visitor, "model")
    visitor.page.get_by_text("The runs on this scene are closed").wait_for()
    visitor.button("Stay here").click()
    assert app.controller.scene.name == "occluded-cube"

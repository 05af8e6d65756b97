"""Exported lessons, opened from disk without a network: driven by keyboard, pointer and touch, compared with the engine."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, ViewportSize

from app.html import number
from app.lesson_pages import page as lesson_page
from app.lesson_pages.playing import PlayedLesson, play_lesson
from app.lessons.reader import lesson_names
from app.pictures.photo_crops import mean_difference
from fairing.judge.inspect import energies_by_dimension, face_cells
from tests.browser.driver import IN_BROWSER, WINDOW
from tests.browser.lesson_reader import (
    ENERGY_TOLERANCE,
    Reader,
    check_every_k_by_keyboard,
    check_moved_vertex,
    check_scrubbed_by_keyboard,
    check_step,
    show_cells_by_keyboard,
)
from tests.browser.lesson_visit import WALKS_ALL_LESSONS

pytestmark = [*IN_BROWSER, pytest.mark.usefixtures("remembered_steps")]

PHONE: ViewportSize = {"width": 390, "height": 844}
MAX_BYTES = 8_000_000
WALKED = lesson_names() if WALKS_ALL_LESSONS else ("model",)
READ_BY_FINGER = lesson_names() if WALKS_ALL_LESSONS else ("displacement",)


@pytest.fixture(scope="module")
def lessons(tmp_path_factory, remembered_steps) -> dict[str, tuple[Path, PlayedLesson]]:
    """Each lesson's file and what the engine showed, made on first use."""

    class Made(dict):
        def __missing__(self, name: str) -> tuple[Path, PlayedLesson]:
            found: list[PlayedLesson] = []

            def play(*args) -> PlayedLesson:
                found.append(play_lesson(*args))
                return found[-1]

            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(lesson_page, "play_lesson", play)
                out = tmp_path_factory.mktemp("lessons") / f"{name}.html"
                lesson_page.write_lesson(name, out, lambda fraction, line: None, with_experiment=WALKS_ALL_LESSONS)
            self[name] = out, found[0]
            return self[name]

    return Made()


@pytest.fixture
def desk(browser: Browser) -> Iterator[Reader]:
    reader = Reader(browser.new_context(viewport=WINDOW, offline=True))
    yield reader
    reader.close()


@pytest.fixture
def phone(browser: Browser) -> Iterator[Reader]:
    reader = Reader(
        browser.new_context(
            viewport=PHONE, device_scale_factor=2, offline=True, has_touch=True, is_mobile=True, color_scheme="light"
        )
    )
    yield reader
    reader.close()


@pytest.mark.slow
@pytest.mark.parametrize("name", WALKED)
def test_a_lesson_is_walked_and_tried_by_keyboard_alone(name, lessons, desk):
    path, played = lessons[name]
    assert path.stat().st_size < MAX_BYTES
    desk.open(path)
    keys, page, claims, checked = desk.page.keyboard, desk.page, 0, set[tuple[int, int, int]]()
    for n, step in enumerate(played.steps):
        if n:
            keys.press("PageDown")
        desk.at_step(n)
        claims += check_step(desk, played, n)
        if page.evaluate("state.cells.page") == "pair":
            box = page.locator("#pair canvas").first.bounding_box()
            assert box["y"] + box["height"] <= page.viewport_size["height"], "the picture is in sight"
        if played.lesson.steps[n].question is not None:
            desk.tab_to("#question button")
            keys.press("Enter")
            page.locator("#verdict").wait_for()
            assert page.evaluate("document.activeElement.id") == "verdict"
        show_cells_by_keyboard(desk)
        cells = step.run, step.moment, page.evaluate("shownFace()")
        if cells in checked:
            continue
        if check_every_k_by_keyboard(desk, played, step):
            checked.add(cells)
        desk.tab_to("[data-move='+x']")
        keys.press("Enter")
        check_moved_vertex(desk, played, step)
        check_scrubbed_by_keyboard(desk, played, step)
    assert page.locator("#next").is_disabled()
    assert claims == sum(len(step.claims) for step in played.lesson.steps)
    assert checked
    keys.press("PageUp")
    desk.at_step(len(played.steps) - 2)
    check_step(desk, played, len(played.steps) - 2)


@pytest.mark.slow
@pytest.mark.parametrize("name", READ_BY_FINGER)
def test_a_lesson_is_read_and_tried_with_a_finger(name, lessons, phone):
    path, played = lessons[name]
    phone.open(path)
    page, dragged = phone.page, 0
    for n, step in enumerate(played.steps):
        if n:
            page.locator("#next").tap()
        phone.at_step(n)
        check_step(phone, played, n)
        assert phone.wide() == [], f"step {n + 1}"
        if played.lesson.steps[n].question is not None:
            page.locator("#question button").last.tap()
            page.locator("#verdict").wait_for()
        if page.evaluate("viewer.through") is None:
            if page.evaluate("shownFace()") is None:
                page.locator("#nothing button").first.tap()
            place, box = page.evaluate("viewer.place(state.vertices.at(-1))"), page.locator("#scene").bounding_box()
            assert box["height"] > 0.3 * PHONE["height"]
            phone.drag_by_touch(box["x"] + place[0], box["y"] + place[1], 12, 9)
            after = page.evaluate("(viewer.draw(), viewer.place(state.vertices.at(-1)))")
            moved, reach = np.abs(page.evaluate("state.offset.by")).max(), page.evaluate("data.reach")
            assert moved <= reach
            check_moved_vertex(phone, played, step)
            # Seen from afar, the drag is longer than the vertex may move.
            is_limited = "as far as the photos in this file reach" in page.locator("#try").inner_text()
            assert is_limited == (moved > 0.999 * reach), f"step {n + 1}"
            if not is_limited:
                assert after[:2] == pytest.approx([place[0] + 12, place[1] + 9], abs=1.5), f"step {n + 1}"
            dragged += 1
    assert dragged


@pytest.mark.slow
@pytest.mark.parametrize("name", WALKED)
def test_every_step_has_names_and_contrast_for_everybody(name, lessons, desk, phone):
    """Both themes at both sizes if all lessons are walked, else each theme at one size: colours do not depend on it."""
    path, played = lessons[name]
    for reader, theme, other in ((desk, "dark", "light"), (phone, "light", "dark")):
        reader.open(path)
        for n in range(len(played.steps)):
            reader.page.evaluate("goToStep", n)
            assert reader.serious_findings(*((theme, other) if WALKS_ALL_LESSONS else (theme,))) == [], f"step {n + 1}"
    small = phone.page.evaluate(
        """() => [...document.querySelectorAll('button, summary, a, input')]
            .filter((node) => node.checkVisibility() && !node.closest('#steps, .bars') && node.getBoundingClientRect().height < 38)
            .map((node) => node.outerHTML.slice(0, 160))"""
    )
    assert small == [], "large enough for a thumb"
    phone.page.emulate_media(color_scheme="light")
    phone.page.reload()
    phone.page.wait_for_selector("body[data-ready]")
    assert phone.page.evaluate("Math.min(...viewer.colors.background)") > 0.8, "the light theme"


def test_cells_of_a_moved_vertex_and_any_k_are_those_of_the_engine(lessons, desk):
    path, played = lessons["model"]
    desk.open(path)
    desk.page.evaluate("goToStep(5)")
    step = played.steps[5]
    facts = played.runs[step.run].facts
    session, stage = facts.session, facts.stage
    desk.page.get_by_role("button", name="Move vertex 0 by 1 % along +x", exact=True).click()
    desk.page.get_by_role("button", name="Move vertex 0 by 1 % along −z", exact=True).press("Enter")
    offset = np.array(desk.page.evaluate("state.offset.by")) / stage.scale
    assert offset == pytest.approx([0.01, 0, -0.01])
    check_moved_vertex(desk, played, step)
    profile = desk.page.evaluate("step().profile.lines")
    for axis, way, energy in ((0, -1, profile[0][0]), (2, 1, profile[2][-1])):
        found = desk.page.evaluate(
            """([axis, way]) => {
                const moved = run().record.verticesAt(state.moment);
                moved[axis] += way * data.reach;
                return ringEnergy(0, moved);
            }""",
            [axis, way],
        )
        assert found == pytest.approx(energy, rel=ENERGY_TOLERANCE), "as far as the vertex can be moved"
    desk.page.get_by_role("button", name="Back to the run").click()
    wanted = energies_by_dimension(session, 2, step.moment)
    found = desk.page.evaluate("[...Array(10).keys()].map((i) => run().cells.energyWith(cellsOf(2), i + 1))")
    # Energies of large k are small differences that the engine computes in single precision (ledger: energies for k = 1 to 10).
    assert found == pytest.approx(wanted, rel=ENERGY_TOLERANCE, abs=5e-4 * wanted[2])
    desk.page.locator("#k").fill("1")
    assert desk.energy() == pytest.approx(wanted[0], rel=ENERGY_TOLERANCE)
    profile = desk.page.evaluate("step().profile.lines[0]")
    assert profile[len(profile) // 2] == pytest.approx(
        sum(face_cells(session, f, step.moment).energy for f in range(6))
    )
    desk.page.get_by_role("button", name="Pair", exact=True).click()
    i, j = desk.page.evaluate("chosenPair(run().cells.viewsOf(2), state.cells.pair)")
    photos, cameras = zip(
        *((view.photo.load(), view.camera) for view in (played.scene.views[v] for v in (i, j))), strict=True
    )
    shown = [text.rpartition("|i − j| ")[2] for text in desk.page.locator("#pair figure > .dim").all_inner_texts()]
    moments = (facts.trace.start, facts.trace.vertices_at(step.moment))
    corners = [vertices[played.scene.mesh.faces[2]] for vertices in moments]
    debugger = [number(mean_difference(photos, cameras, at, affine=False), 3) for at in corners]
    assert [float(text) for text in shown] == [float(text) for text in debugger], "as in the debugger"


def test_a_vertex_is_dragged_and_the_lesson_resumed(lessons, desk):
    path, played = lessons["model"]
    desk.open(path)
    desk.page.evaluate("goToStep(1)")
    box, place = desk.page.locator("#scene").bounding_box(), desk.page.evaluate("(viewer.draw(), viewer.place(0))")
    x, y = box["x"] + place[0], box["y"] + place[1]
    desk.page.mouse.move(x, y)
    desk.page.mouse.down()
    desk.page.mouse.move(x + 12, y + 9, steps=3)
    desk.page.mouse.up()
    after = desk.page.evaluate("(viewer.draw(), viewer.place(0))")
    assert after[:2] == pytest.approx([place[0] + 12, place[1] + 9], abs=1.5)
    desk.page.keyboard.press("End")
    assert desk.page.evaluate("state.offset") is None
    assert desk.page.evaluate("state.moment") == played.runs[0].facts.length
    desk.page.get_by_role("button", name="Resume lesson").press("Enter")
    check_step(desk, played, 1)
    assert desk.page.evaluate("document.activeElement.tagName") == "ARTICLE", "the button has gone"
    desk.page.locator("#steps button").nth(2).press("Enter")
    check_step(desk, played, 2)
    assert desk.page.evaluate("document.activeElement.getAttribute('aria-current')") == "step"


def test_without_3d_the_rest_of_a_lesson_works(lessons, browser):
    path, played = lessons["model"]
    context = browser.new_context(viewport=WINDOW, offline=True)
    context.add_init_script(
        """const get = HTMLCanvasElement.prototype.getContext;
        HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
            return kind === 'webgl2' ? null : get.call(this, kind, ...rest);
        };"""
    )
    reader = Reader(context)
    reader.open(path)
    reader.page.get_by_text("No 3D view").wait_for()
    for _ in played.steps[1:]:
        reader.page.keyboard.press("PageDown")
    reader.at_step(len(played.steps) - 1)
    assert reader.page.locator("#title").inner_text() == played.lesson.steps[-1].title
    assert reader.troubles == []
    context.close()


def test_a_page_opens_at_the_step_in_its_address(lessons, desk):
    path, _ = lessons["model"]
    desk.page.goto(f"{path.as_uri()}#4")
    desk.page.wait_for_selector("body[data-ready]")
    assert desk.page.evaluate("state.step") == 3

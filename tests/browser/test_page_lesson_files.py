"""Exported lessons, opened from disk without a network: driven by keyboard, pointer and touch, compared with the engine."""

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext, Page, ViewportSize

from app.export.page_data import GRID
from app.lesson_pages import page as lesson_page
from app.lesson_pages.playing import PlayedLesson, PlayedStep, play_lesson
from app.lessons.reader import lesson_names, numbers_in
from fairing.judge.inspect import cells_in_context, energies_by_dimension, face_cells
from tests.browser.driver import IN_BROWSER, WINDOW, chromium
from tests.waiting import PATIENCE, wait_for

pytestmark = [*IN_BROWSER, pytest.mark.usefixtures("remembered_steps")]

PHONE: ViewportSize = {"width": 390, "height": 844}
MAX_BYTES = 8_000_000
WALKED = lesson_names() if os.environ.get("EIGENFAIRING_ALL_LESSONS") else ("model", "displacement")
# Cells of the page and the engine differ at the border of parts blurred by Fourier transform (see test_page_export).
ENERGY_TOLERANCE = 0.02


class Reader:
    """A browser tab without a network that collects requests and everything that goes wrong."""

    def __init__(self, context: BrowserContext) -> None:
        self.page: Page = context.new_page()
        self.page.set_default_timeout(1000 * PATIENCE)
        self.troubles: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.troubles.append(message.text) if message.type == "error" else None)
        self.page.on("pageerror", lambda error: self.troubles.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))

    def open(self, path: Path) -> None:
        self.page.goto(path.as_uri())
        self.page.wait_for_selector("body[data-ready]")
        assert {url for url in self.requests if not url.startswith(("data:", "blob:"))} == {path.as_uri()}

    def at_step(self, number: int) -> None:
        wait_for(lambda: self.page.evaluate("state.step") == number)

    def energy(self) -> float:
        """Energy of the face shown, as the page computes it."""
        return self.page.evaluate("cellsOf(shownFace(), state.cells.dimensions).energy")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


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
                lesson_page.write_lesson(name, out, lambda fraction, line: None, with_experiment=False)
            self[name] = out, found[0]
            return self[name]

    return Made()


@pytest.fixture
def desk(browser) -> Iterator[Reader]:
    context = browser.new_context(viewport=WINDOW, offline=True)
    reader = Reader(context)
    yield reader
    assert reader.troubles == []
    context.close()


@pytest.fixture
def phone(browser) -> Iterator[Reader]:
    context = browser.new_context(viewport=PHONE, offline=True, has_touch=True, is_mobile=True, color_scheme="light")
    reader = Reader(context)
    yield reader
    assert reader.troubles == []
    context.close()


def checked(reader: Reader, played: PlayedLesson, step: PlayedStep) -> None:
    """The step in sight is that of the engine: vertices, cells and every number of the text."""
    facts, page = played.runs[step.run].facts, reader.page
    wanted = facts.stage.page_from_world(facts.trace.vertices_at(step.moment))
    found = np.array(page.evaluate("Array.from(viewer.now)"), dtype=np.float32).reshape(-1, 3)
    assert np.abs(found - wanted).max() <= 0.51 * GRID
    shown = [
        float(value.replace("\u2009", "").replace("\u2212", "-")) for value in page.locator("#text b").all_inner_texts()
    ]
    text = played.lesson.steps[page.evaluate("state.step")].text
    wanted_numbers = [step.findings.numbers[name] for name in numbers_in(text)]
    assert shown == pytest.approx(wanted_numbers, rel=5e-3), text
    face = page.evaluate("shownFace()")
    if face is not None and page.evaluate("state.cells.page") == "cells":
        dimensions = step.settings.cells.get("dimensions")
        engine = face_cells(facts.session, face, step.moment, dimensions)
        assert reader.energy() == pytest.approx(engine.energy, rel=ENERGY_TOLERANCE), (face, step.moment)


# EIGENFAIRING_ALL_LESSONS=1 walks all of them.
@pytest.mark.slow
@pytest.mark.parametrize("name", WALKED)
def test_a_lesson_is_walked_by_keyboard_alone_and_shows_what_the_engine_computed(name, lessons, desk):
    path, played = lessons[name]
    assert path.stat().st_size < MAX_BYTES
    desk.open(path)
    keys = desk.page.keyboard
    for n, step in enumerate(played.steps):
        if n:
            keys.press("PageDown")
        desk.at_step(n)
        checked(desk, played, step)
        assert desk.page.locator("#title").inner_text() == played.lesson.steps[n].title
        if played.lesson.steps[n].question is not None:
            desk.page.locator("#question button").first.focus()
            keys.press("Enter")
            desk.page.locator("#verdict").wait_for()
            assert desk.page.evaluate("document.activeElement.id") == "verdict"
    assert desk.page.locator("#next").is_disabled()
    keys.press("PageUp")
    desk.at_step(len(played.steps) - 2)


def test_nothing_is_cut_off_at_a_desk_or_on_a_phone_and_everything_has_a_name(lessons, desk, phone):
    path, played = lessons["model"]
    for reader in (desk, phone):
        reader.open(path)
        for n in range(len(played.steps)):
            if n and reader is phone:
                reader.page.locator("#next").tap()
            elif n:
                reader.page.locator("#next").click()
            reader.at_step(n)
            wide = reader.page.evaluate(
                """() => [...document.querySelectorAll('body, main, article, #cells-panel, #below, header')]
                    .filter((node) => node.scrollWidth > node.clientWidth + 1).map((node) => node.id || node.tagName)"""
            )
            assert wide == [], f"step {n + 1}"
            nameless = reader.page.evaluate(
                """() => [...document.querySelectorAll('button, input, [role=img], a')].filter((node) =>
                    node.checkVisibility() && !(node.getAttribute('aria-label') || node.textContent.trim()
                    || node.labels?.length)).map((node) => node.outerHTML)"""
            )
            assert nameless == [], f"step {n + 1}"
    small = phone.page.evaluate(
        "() => [...document.querySelectorAll('#next, #previous, [data-page], #play')].map((n) => n.getBoundingClientRect().height)"
    )
    assert min(small) >= 38, "large enough for a thumb"
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
    vertices = facts.trace.vertices_at(step.moment)
    vertices[0] += offset
    sweep = session.sweep_state(step.moment)
    total = 0.0
    for face in range(6):
        sigma, scale = float(sweep.sigma[face]), float(sweep.scale[face])
        wanted = cells_in_context(session, sweep.context, vertices, face, step.moment, sigma, scale).energy
        found = desk.page.evaluate("face => cellsOf(face).energy", face)
        assert found == pytest.approx(wanted, rel=ENERGY_TOLERANCE)
        total += wanted
    assert desk.page.evaluate("ringEnergy(0, positions())") == pytest.approx(total, rel=ENERGY_TOLERANCE)
    assert "Moved by hand" in desk.page.locator("#try").inner_text()
    desk.page.get_by_role("button", name="Back to the run").click()
    wanted = energies_by_dimension(session, 2, step.moment)
    found = desk.page.evaluate("[...Array(10).keys()].map((i) => run().cells.energyWith(cellsOf(2), i + 1))")
    assert found == pytest.approx(wanted, rel=ENERGY_TOLERANCE)
    desk.page.locator("#k").fill("1")
    assert desk.energy() == pytest.approx(wanted[0], rel=ENERGY_TOLERANCE)
    profile = desk.page.evaluate("step().profile.lines[0]")
    assert profile[len(profile) // 2] == pytest.approx(
        sum(face_cells(session, f, step.moment).energy for f in range(6))
    )


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
    desk.page.get_by_role("button", name="Resume lesson").click()
    checked(desk, played, played.steps[1])


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

"""The first minute and long work in a real browser: what is done is shown, keys wait, the texture stays on the mesh."""

import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from app.debugger.actions import ACTIONS
from app.debugger.commands import JumpTo, Pause, Restart, Run
from app.debugger.run_state import Activity
from app.debugger.work_report import WorkReport
from app.page.server import App
from app.page_state.selection import Selection
from app.viser_bridge.error_toasts import TOAST_SECONDS
from app.viser_bridge.server import start_viewer
from demo_scenes import load_demo
from fairing.errors import Cancelled
from fairing.run.session import Session
from tests.browser.driver import IN_BROWSER, WINDOW, Visitor, input_of, page_of
from tests.two_levels import two_levels
from tests.waiting import PATIENCE, wait_for

pytestmark = IN_BROWSER

OPTIONS = two_levels("joint", sweeps=9, iterations=9)

TEXTURED = """() => {
    const {nodeRefFromName} = window.__viserMutable;
    const meshOf = name => {
        let found = null;
        nodeRefFromName[name]?.traverse(node => {
            if (!found && node.isMesh && node.geometry?.attributes?.position) found = node;
        });
        return found;
    };
    const plain = meshOf('/mesh/now');
    for (const side of 'ab') {
        const node = nodeRefFromName[`/mesh/textured_now_${side}`], mesh = meshOf(`/mesh/textured_now_${side}`);
        if (node?.visible && mesh) {
            const middle = mesh.position.toArray();
            return {
                plain: Array.from(plain.geometry.attributes.position.array), faces: Array.from(plain.geometry.index.array),
                corners: Array.from(mesh.geometry.attributes.position.array).map((value, k) => value + middle[k % 3]),
                hasTexture: !!mesh.material.map, plainVisible: nodeRefFromName['/mesh/now'].visible,
            };
        }
    }
    return null;
}"""
TOO_WIDE = """() => {
    const found = [];
    for (let node = document.querySelector('.ef .pinned'); node; node = node.parentElement)
        if (node.scrollWidth > node.clientWidth + 1 && node.clientWidth) found.push(node.className);
    return found;
}"""


@pytest.fixture
def slow_steps(visitor: Visitor, monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Semaphore]:
    """Steps wait at a gate, as parts of a work that can be cancelled."""
    controller, gate, step = visitor.app.controller, threading.Semaphore(0), Session.step
    controller.post(JumpTo(0))
    controller.post(Restart())
    controller.wait_until_idle(PATIENCE)

    def gated(session: Session):
        with session.work.doing("searching 81 vertices", 15) as work:
            for _ in range(4):
                work.advance()
            while not gate.acquire(timeout=0.05):
                if session.cancel_requested():
                    raise Cancelled
        return step(session)

    with monkeypatch.context() as patch:
        patch.setattr(Session, "step", gated)
        yield gate
        controller.post(Pause())  # a key of the page might arrive in the next test only, and stop its run
        gate.release(10_000)
        controller.wait_until_idle(PATIENCE)


def test_while_a_step_runs_the_main_button_cancels_and_the_status_says_how_far_it_is(
    visitor: Visitor, slow_steps: threading.Semaphore
):
    controller, page = visitor.app.controller, visitor.page
    page.keyboard.press("F11")
    visitor.button("Cancel").wait_for()
    page.get_by_text("Searching 81 vertices, 4 of 15").wait_for()
    page.get_by_text("s left").first.wait_for()
    page.get_by_role("progressbar", name="Searching 81 vertices").wait_for()
    expect(page.get_by_text("Ready", exact=True)).to_have_count(0)
    page.keyboard.press("]")
    page.get_by_text("Next: Step one sweep").wait_for()
    visitor.button("Cancel").click()
    wait_for(lambda: controller.state.activity is Activity.PAUSED)
    assert controller.wait_until_idle(PATIENCE).moment == 0
    visitor.button("Run").wait_for()
    expect(page.get_by_text("Next: Step one sweep")).to_have_count(0)


def test_the_texture_stays_on_the_moving_mesh_and_is_painted_again(visitor: Visitor, slow_steps: threading.Semaphore):
    controller, page = visitor.app.controller, visitor.page
    page.wait_for_function(f"() => ({TEXTURED})()")
    texturer = visitor.app.resources.texturer.draft
    painted: list[np.ndarray] = []
    paint = texturer._paint

    def texture_lies_on_the_mesh() -> bool:
        found = page.evaluate(TEXTURED)
        assert found is not None, "the texture is gone"
        assert found["hasTexture"]
        assert not found["plainVisible"]
        plain = np.array(found["plain"]).reshape(-1, 3)[found["faces"]]
        return np.linalg.norm(np.array(found["corners"]).reshape(-1, 3) - plain, axis=1).max() < 0.01

    texturer._paint = lambda vertices: painted.append(vertices) or paint(vertices)
    try:
        controller.post(Run())
        wait_for(lambda: controller.state.activity is Activity.RUNNING)
        for moment in range(1, 8):
            slow_steps.release()
            wait_for(lambda moment=moment: controller.state.moment >= moment)
            visitor.sees_vertices(visitor.app.resources.stage.page_from_world(controller.state.vertices))
            wait_for(texture_lies_on_the_mesh)
            assert controller.state.activity is Activity.RUNNING
        wait_for(lambda: painted)  # while the next step waits
        wait_for(texture_lies_on_the_mesh)
        assert controller.state.activity is Activity.RUNNING
    finally:
        texturer._paint = paint


def test_the_plot_shows_what_compares_first_and_says_what_energies_compare(visitor: Visitor):
    visitor.press("Step one sweep")
    visitor.page.get_by_role("img", name="Residual plot").wait_for()
    visitor.page.get_by_text("RMS at the finest level, grey levels", exact=True).wait_for()
    visitor.page.locator(".quantities").get_by_text("error", exact=True).click()
    visitor.page.get_by_role("img", name="Error plot").wait_for()
    visitor.page.get_by_text("RMS distance to the truth, % of diagonal", exact=True).wait_for()
    visitor.page.locator(".quantities").get_by_text("energy", exact=True).click()
    visitor.page.get_by_role("img", name="Sweep energy plot").wait_for()
    visitor.page.get_by_text("Expert: only connected points compare", exact=True).wait_for()
    visitor.page.locator(".quantities").get_by_text("residual", exact=True).click()


def test_slider_and_strip_have_one_extent(visitor: Visitor):
    visitor.press("Step one sweep")
    track = visitor.box_of(visitor.page.locator("[class*='Slider-trackContainer']").last)
    marks = visitor.page.locator("[class*='Slider-markWrapper']")
    strip = visitor.box_of(visitor.page.get_by_role("img", name="Recorded moments"))
    first = visitor.box_of(marks.first)
    assert abs(first["x"] - strip["x"]) < 8, "moment 0"
    assert abs(track["x"] - strip["x"]) < 8
    assert abs(track["x"] + track["width"] - strip["x"] - strip["width"]) < 8


def test_cells_of_another_moment_carry_its_number(visitor: Visitor, slow_steps: threading.Semaphore):
    controller, page = visitor.app.controller, visitor.page
    page_of(visitor.app).interaction.set_selection(Selection((0,)))
    # A chosen face: that with the largest energy is shown as soon as energies are known, which may be later.
    visitor.button("Cells of face 1").click()
    page.locator("button[title='Cells of face 1'][aria-pressed='true']").wait_for()
    page.get_by_text("Cells by photo").wait_for()
    controller.post(Run())
    wait_for(lambda: controller.state.activity is Activity.RUNNING)
    slow_steps.release()
    page.get_by_text("Shows moment 0; it follows when the run pauses.").wait_for()
    page.keyboard.press("p")
    controller.wait_until_idle(PATIENCE)
    wait_for(lambda: page.locator(".stale").count() == 0)
    page_of(visitor.app).interaction.set_selection(Selection())


class Compilation:
    """Stands in for the first compilation of the engine."""

    def __init__(self) -> None:
        self.functions, self.finished = 9, threading.Event()

    @property
    def report(self) -> WorkReport | None:
        line = f"compiling the engine, first start: {self.functions} of 24 functions, 1234567890 s, a long line"
        return None if self.finished.is_set() else WorkReport(line, self.functions / 24)

    def wait(self, cancelled) -> None:
        while not self.finished.wait(0.05):
            if cancelled():
                raise Cancelled

    def wait_for_painting(self) -> None:
        self.finished.wait()

    def close(self) -> None:
        self.finished.set()


def test_the_opening_page_has_a_bar_and_keys_wait_for_the_scene_and_the_compilation(page: Page):
    server, compilation = start_viewer("127.0.0.1", 0), Compilation()
    app = None
    try:
        page.goto(server.url)
        server.opening.begin("Opening cube", lambda: compilation.report.line if compilation.report else "")
        server.opening.accept_keys((action.label, *key) for action in ACTIONS for key in action.keys)
        server.opening.show("Rendering the photos, 3 of 12", 0.25)
        page.get_by_text("Opening cube").wait_for()
        page.get_by_text("Rendering the photos, 3 of 12").wait_for()
        page.get_by_text("compiling the engine, first start: 9 of 24").wait_for()
        bar = page.get_by_role("progressbar", name="Opening").bounding_box()
        assert bar is not None
        assert abs(bar["x"] + bar["width"] / 2 - (WINDOW["width"] - 340) / 2) < 60, "the card is not in the middle"
        expect(page.get_by_text("Save Canvas")).to_be_hidden()
        page.keyboard.press("F11")
        page.get_by_text("Waits until the scene is open: Step one iteration").wait_for()
        app = App(server, Session(load_demo("cube"), OPTIONS), compilation=compilation)  # pyright: ignore[reportArgumentType]
        page.get_by_text("Next: Step one iteration").wait_for()
        page.get_by_text("Compiling the engine, first start: 9 of 24").wait_for()
        expect(page.get_by_text("Opening cube")).to_be_hidden()
        # A long line must not make the panel scroll sideways once it has taken its place.
        wait_for(lambda: page.evaluate(TOO_WIDE) == [])
        expect(page.locator(".ef-opening")).to_be_hidden()
        assert app.controller.state.moment == 0
        compilation.finished.set()
        wait_for(lambda: app.controller.state.moment == 1)
    finally:
        compilation.finished.set()
        if app is not None:
            app.stop()
        else:
            server.close()


def test_warnings_and_errors_close_by_themselves_but_can_be_read(visitor: Visitor, page: Page):
    visitor.close_notifications()
    pages = visitor.app.pages
    known = set(pages)
    page.goto(visitor.app.url)
    warning = page.get_by_text("Software WebGL rendering detected")
    warning.wait_for()
    wait_for(lambda: len(pages) > len(known))
    shown = time.monotonic()
    pages[next(iter(set(pages) - known))].frame.toasts.show("vertex 99: expected 0 to 6")
    error = page.get_by_text("vertex 99: expected 0 to 6")
    error.wait_for()
    typed = input_of(page, "Vertices")
    typed.click()
    page.wait_for_timeout(max(0.0, 1000 * (shown + TOAST_SECONDS - 1 - time.monotonic())))
    assert error.is_visible()
    assert warning.is_visible()
    error.wait_for(state="detached")
    warning.wait_for(state="detached")
    assert time.monotonic() - shown > TOAST_SECONDS - 0.5
    page.keyboard.type("0")
    assert typed.input_value() == "0", "closing a warning took the keyboard from a field"


def test_until_its_texture_is_painted_a_plain_surface_says_so(visitor: Visitor, page: Page):
    texturer, may_paint = visitor.app.resources.texturer.static, threading.Event()
    paint = texturer._paint
    texturer._kept.clear()
    texturer._paint = lambda vertices: paint(vertices) if may_paint.wait(PATIENCE) else None  # pyright: ignore[reportAttributeAccessIssue]
    try:
        page.goto(visitor.app.url)
        note = page.get_by_text("Painting the texture…")
        note.wait_for()
        may_paint.set()
        note.wait_for(state="detached")
        page.wait_for_function(f"() => ({TEXTURED})()")
    finally:
        may_paint.set()
        texturer._paint = paint

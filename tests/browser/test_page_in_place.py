"""Panels that change many times a second, in a real browser: clicks arrive, the focus stays, typed text is kept."""

import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import pytest

from app.debugger.commands import JumpTo, Pause, Run
from app.debugger.run_state import Activity
from app.page_state.selection import Selection
from fairing.run.session import Session
from tests.browser.driver import IN_BROWSER, Visitor, page_of
from tests.two_levels import two_levels
from tests.waiting import PATIENCE, wait_for

pytestmark = IN_BROWSER

OPTIONS = two_levels("sequential", sweeps=9, iterations=9)


@dataclass(frozen=True)
class Running:
    """A page with a run that makes a step whenever the test lets it."""

    visitor: Visitor
    gate: threading.Semaphore

    def hits(self) -> int:
        """As the list of breakpoints says: another number, and the panel was given other content."""
        return int(self.visitor.page.locator(".breakpoint .dim").first.inner_text().split()[0])

    def change(self) -> None:
        """Let the run go on until the panel has changed."""
        before = self.hits()
        while self.hits() == before:
            self.gate.release()
            time.sleep(0.3)

    def go_on_until_paused(self) -> None:
        """Let the run go on until it has paused."""
        while self.visitor.app.controller.state.activity is not Activity.PAUSED:
            self.gate.release()
            time.sleep(0.1)

    def press_slowly(self, name: str) -> None:
        """Press a button, and let it go when the panels have changed twice."""
        box, mouse = self.visitor.box_of(self.visitor.button(name)), self.visitor.page.mouse
        mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        mouse.down()
        self.change()
        self.change()
        mouse.up()


@pytest.fixture
def running(visitor: Visitor, monkeypatch: pytest.MonkeyPatch) -> Iterator[Running]:
    controller, gate, step = visitor.app.controller, threading.Semaphore(0), Session.step
    controller.edit_breakpoints(lambda b: b.added("moment > 0"))
    number = controller.state.breakpoints[0].number
    controller.edit_breakpoints(lambda b: b.changed(number, lambda item: replace(item, logs=True)))
    visitor.page.get_by_role("tab", name="Breakpoints").click()
    controller.post(JumpTo(0))
    controller.wait_until_idle()
    monkeypatch.setattr(Session, "step", lambda self: gate.acquire(timeout=PATIENCE) and step(self))
    controller.post(Run())
    wait_for(lambda: controller.state.activity is Activity.RUNNING)
    visitor.button("Pause").wait_for()
    yield Running(visitor, gate)
    controller.post(Pause())  # a key of the page might arrive in the next test only, and stop its run
    gate.release(10_000)
    controller.wait_until_idle()
    controller.edit_breakpoints(lambda b: b.removed(number))
    visitor.page.get_by_role("tab", name="Vertex").click()


def test_slow_clicks_arrive_while_their_panels_change(running: Running):
    controller, view = running.visitor.app.controller, page_of(running.visitor.app).page_state
    running.press_slowly("Stop the run or only log")
    wait_for(lambda: not controller.state.breakpoints[0].logs)
    running.visitor.button("Stop the run or only log").click()
    wait_for(lambda: controller.state.breakpoints[0].logs)
    for name, number in (("Play 20 moments a second", 5.0), ("Play 4 moments a second", 1.0)):
        running.press_slowly(name)
        wait_for(lambda number=number: view.speed == number)
    running.press_slowly("Pause")
    running.go_on_until_paused()
    assert not controller.state.finished


def test_the_focus_stays_on_a_button_whose_panel_changes(running: Running):
    controller = running.visitor.app.controller
    running.visitor.button("Stop the run or only log").focus()
    running.change()
    running.visitor.page.keyboard.press("Enter")
    wait_for(lambda: not controller.state.breakpoints[0].logs)
    running.visitor.page.keyboard.press("Enter")
    wait_for(lambda: controller.state.breakpoints[0].logs)


def test_a_button_that_changes_its_action_during_a_click_is_not_triggered(running: Running):
    """Run takes the place of Pause when a run ends: whoever was about to pause does not start it anew."""
    controller, visitor = running.visitor.app.controller, running.visitor
    box, mouse = visitor.box_of(visitor.button("Pause")), visitor.page.mouse
    mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    mouse.down()
    visitor.page.keyboard.press("p")
    running.go_on_until_paused()
    visitor.button("Run").wait_for()
    mouse.up()
    time.sleep(0.5)
    assert controller.state.activity is Activity.PAUSED


def test_a_quick_enter_sends_the_whole_line_and_the_next_can_be_typed_at_once(visitor: Visitor):
    """Of messages within 50 ms the viewer's own lines tell only the last, and write over what is being typed."""
    page, view = visitor.page, page_of(visitor.app).page_state
    entry = visitor.input_of("Vertices")
    for line, chosen in (("2, 4-6", (2, 4, 5, 6)), ("1", (1,)), ("0-3", (0, 1, 2, 3))):
        entry.click()
        page.keyboard.press("Control+a")
        page.keyboard.type(line)
        page.keyboard.press("Enter")
        wait_for(lambda chosen=chosen: set(view.selection.vertices) == set(chosen))
    watch = visitor.input_of("Watch")
    for line in ("moment", "2 * moment", "energy"):
        watch.click()
        page.keyboard.type(line)
        page.keyboard.press("Enter")
    wait_for(lambda: [watch.text for watch in view.watches] == ["moment", "2 * moment", "energy"])
    assert watch.input_value() == ""


def test_text_being_typed_is_not_overwritten(visitor: Visitor):
    page, hands, entry = visitor.page, page_of(visitor.app).interaction, visitor.input_of("Vertices")
    hands.set_selection(Selection((5,)))
    wait_for(lambda: entry.input_value() == "5")
    entry.click()
    page.keyboard.press("Control+a")
    page.keyboard.type("2")
    hands.set_selection(Selection((3,)))
    page.get_by_text("Vertex 3", exact=True).wait_for()
    page.keyboard.type(", 4")
    assert entry.input_value() == "2, 4"
    page.keyboard.press("Enter")
    wait_for(lambda: set(page_of(visitor.app).page_state.selection.vertices) == {2, 4})
    hands.set_selection(Selection((6,)))
    wait_for(lambda: entry.input_value() == "6")


def test_a_draft_survives_a_change_of_tabs_and_typing_does_not_move_the_camera(visitor: Visitor):
    page = visitor.page
    where = "() => window.__viserMutable.camera.position.toArray()"
    before = page.evaluate(where)
    visitor.input_of("Watch").click()
    page.keyboard.type("seed * we", delay=30)
    assert page.evaluate(where) == before
    page.get_by_role("tab", name="Layers").click()
    page.get_by_role("tab", name="Vertex").click()
    assert visitor.input_of("Watch").input_value() == "seed * we"
    visitor.input_of("Watch").fill("")

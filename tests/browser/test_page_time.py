"""Runs, bookmarks, comparison and playback in a real browser."""

import time

import numpy as np
import pytest

from app.debugger.commands import Extent, Forward, JumpTo, Run
from app.debugger.run_state import Activity
from app.page.server import start
from app.palette import REFERENCE, css
from demo_scenes import load_demo
from fairing.run.session import Session
from tests.browser.driver import IN_BROWSER, Visitor, page_of
from tests.two_levels import two_levels
from tests.waiting import wait_for

pytestmark = IN_BROWSER

OPTIONS = two_levels("sequential", sweeps=2, iterations=3)


@pytest.fixture(scope="module")
def app():
    app = start(Session(load_demo("cube"), OPTIONS), port=0)
    app.controller.post(Forward(Extent.SWEEP))
    app.controller.wait_until_idle()
    yield app
    app.stop()


def jump(visitor: Visitor, moment: int) -> None:
    visitor.app.controller.post(JumpTo(moment))
    visitor.app.controller.wait_until_idle()


def lines_of(visitor: Visitor, name: str) -> np.ndarray | None:
    """Ends (s, 2, 3) of the lines drawn under a name; None while they are hidden."""
    found = visitor.page.evaluate(
        """name => {
            const node = window.__viserMutable.nodeRefFromName[name];
            if (!node?.visible) return null;
            let lines = null;
            node.traverse(object => { if (object.geometry?.attributes?.instanceStart) lines = object.geometry });
            return lines && Array.from(lines.attributes.instanceStart.data.array);
        }""",
        name,
    )
    return None if found is None else np.array(found, dtype=np.float32).reshape(-1, 2, 3)


def test_a_bookmark_is_returned_to_and_compared_with(visitor: Visitor):
    controller = visitor.app.controller
    jump(visitor, 4)
    visitor.page.get_by_role("tab", name="Bookmarks").click()
    note = visitor.input_of("Note")
    note.fill("<b>here</b> it turns")
    note.press("Enter")
    visitor.page.get_by_text("<b>here</b> it turns").wait_for()
    (bookmark,) = controller.state.bookmarks
    assert (bookmark.moment, bookmark.note) == (4, "<b>here</b> it turns")
    jump(visitor, -1)
    visitor.button("Go to moment 4 of run 1").click()
    wait_for(lambda: controller.state.moment == 4)
    jump(visitor, -1)
    visitor.button("Compare with this moment").click()
    stage, scene = visitor.app.resources.stage, visitor.app.controller.scene
    then, now = (controller.state.trace.vertices_at(moment) for moment in (4, controller.state.length))
    edges = scene.mesh.edges[(then != now).any(axis=1)[scene.mesh.edges].any(axis=1)]
    expected = stage.page_from_world(then)[edges]

    def ghost_is_there() -> bool:
        found = lines_of(visitor, "/mesh/reference")
        return found is not None and len(found) > 0 and all((found == line).all((1, 2)).any() for line in expected[:3])

    wait_for(ghost_is_there)
    visitor.button("Remove this bookmark").click()
    wait_for(lambda: not controller.state.bookmarks)


def test_restart_keeps_the_run_and_a_click_on_its_name_switches_to_it(visitor: Visitor):
    controller = visitor.app.controller
    jump(visitor, -1)
    before = controller.state
    visitor.page.get_by_role("tab", name="Runs").click()
    after = visitor.press("Restart")
    assert (after.length, len(after.runs)) == (0, 2)
    visitor.press("Step one vertex")
    visitor.button("Compare with Run 1").click()
    # Both curves: that of A is drawn in A's colour.
    visitor.page.locator(f"svg[aria-label='Residual plot'] polyline[stroke='{css(REFERENCE)}']").first.wait_for(
        state="attached"
    )
    visitor.button("Switch to Run 1").click()
    wait_for(lambda: controller.state.run_id == 1)
    visitor.sees_vertices(visitor.app.resources.stage.page_from_world(before.vertices))
    visitor.button("Delete Run 2").click()
    wait_for(lambda: len(controller.state.runs) == 1)


def test_a_click_on_the_position_goes_to_the_beginning_of_that_part(visitor: Visitor):
    controller = visitor.app.controller
    jump(visitor, 8)
    at = controller.state.position
    visitor.button("To the beginning of this vertex").click()
    wait_for(lambda: controller.state.moment < 8)
    assert controller.state.position[:3] == at[:3]
    visitor.button("To the beginning of this level").click()
    wait_for(lambda: controller.state.moment == 0)


def test_the_record_plays_and_stops(visitor: Visitor):
    controller = visitor.app.controller
    visitor.page.get_by_role("tab", name="Timeline").click()
    jump(visitor, 0)
    visitor.button("Play 20 moments a second").click()
    visitor.button("Play the recorded steps").click()
    wait_for(lambda: controller.state.activity is Activity.PLAYING and controller.state.moment > 1)
    visitor.page.keyboard.press("t")
    wait_for(lambda: controller.state.activity is Activity.PAUSED)
    state = controller.wait_until_idle()
    visitor.sees_vertices(visitor.app.resources.stage.page_from_world(state.vertices))


def test_a_past_moment_can_be_shown_while_the_run_goes_on(visitor: Visitor, monkeypatch: pytest.MonkeyPatch):
    controller, stage = visitor.app.controller, visitor.app.resources.stage
    visitor.page.get_by_role("tab", name="Timeline").click()
    jump(visitor, -1)
    step = Session.step
    with monkeypatch.context() as patch:
        patch.setattr(Session, "step", lambda self: time.sleep(0.3) or step(self))
        controller.post(Run())
        wait_for(lambda: controller.state.activity is Activity.RUNNING)
        page = page_of(visitor.app)
        page.frame.toasts(page.run_controls.jump)(2)
        visitor.sees_vertices(stage.page_from_world(controller.state.trace.vertices_at(2)))
        assert controller.state.activity is Activity.RUNNING
        visitor.button("Follow live").click()
        wait_for(lambda: page.page_state.viewed_moment is None)
        visitor.page.keyboard.press("p")
        state = controller.wait_until_idle()
    visitor.sees_vertices(stage.page_from_world(state.vertices))

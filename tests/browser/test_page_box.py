"""The box of a mesh that was triangulated from points, in a real browser: its corners are dragged or typed."""

import re
from collections.abc import Iterator

import numpy as np
import pytest

from app.page.server import App, start
from fairing.features import find_points
from fairing.io import load_scene
from fairing.io.convert import write_capture
from fairing.run.session import Session
from fairing.triangulation.points_in_box import box_words
from tests.browser.driver import IN_BROWSER, Visitor, page_of
from tests.speckled_corner import views
from tests.two_levels import two_levels
from tests.waiting import wait_for

pytestmark = [*IN_BROWSER, pytest.mark.slow]

BOX = (0.3, 0.3, 0.3, 1.1, 1.1, 1.1)
ALONG_X = 0.36  # of the arrow, about 0.48 long: its middle
PLACES = """([name, x]) => {
    const {nodeRefFromName, camera, canvas} = window.__viserMutable, node = nodeRefFromName[name];
    const box = canvas.getBoundingClientRect();
    camera.updateMatrixWorld();
    node.updateWorldMatrix(true, false);
    return [0, x].map(along => {
        const place = node.localToWorld(new node.position.constructor(along, 0, 0)).project(camera);
        return [box.left + (place.x + 1) / 2 * box.width, box.top + (1 - place.y) / 2 * box.height];
    });
}"""


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> Iterator[App]:
    folder = tmp_path_factory.mktemp("captures") / "corner"
    write_capture(folder, "scene.json", views(), find_points(views()).sparse_points())
    scene = load_scene(folder, points="given", cameras="given", box=BOX)
    app = start(Session(scene, two_levels("sequential", sweeps=1, iterations=1)), port=0)
    yield app
    app.stop()


def drag_inwards(visitor: Visitor) -> None:
    """Drag the arrow along x of the high corner by half its length."""
    visitor.wait_until_still()
    mouse = visitor.page.mouse
    (origin, arrow) = np.array(visitor.page.evaluate(PLACES, ["/chosen_box/high", ALONG_X]))
    mouse.move(*arrow.tolist())
    mouse.down()
    mouse.move(*(arrow - 0.5 * (arrow - origin)).tolist(), steps=5)
    mouse.up()


def test_the_corners_of_a_box_are_dragged_and_its_words_are_those_of_the_command(visitor: Visitor):
    page, tab = page_of(visitor.app), visitor.page
    tab.get_by_role("tab", name="Layers", exact=True).click()
    visitor.button("Choose another box").click()
    words = tab.locator("code", has_text="--box")
    words.wait_for()
    assert page.page_state.box == BOX
    assert words.inner_text() == box_words(BOX)
    visitor.close_notifications()
    tab.wait_for_function("() => window.__viserMutable.nodeRefFromName['/chosen_box/high']?.visible")
    visitor.use_mouse(lambda: drag_inwards(visitor), lambda: page.page_state.box != BOX)
    wait_for(lambda: words.inner_text() == box_words(page.page_state.box or BOX))
    assert page.page_state.box is not None
    assert BOX[0] < page.page_state.box[3] < BOX[3]
    assert np.delete(page.page_state.box, 3).tolist() == np.delete(BOX, 3).tolist()

    visitor.button("Hide the box").click()
    words.wait_for(state="detached")
    assert page.page_state.box is None
    tab.wait_for_function("() => !window.__viserMutable.nodeRefFromName['/chosen_box/high']?.visible")


def test_the_corners_of_a_box_are_typed(visitor: Visitor):
    page, tab = page_of(visitor.app), visitor.page
    tab.get_by_role("tab", name="Layers", exact=True).click()
    field = visitor.input_of("Box")
    field.fill("0.5 0.5")
    field.press("Enter")
    visitor.toast("expected six numbers x0 y0 z0 x1 y1 z1, found 0.5 0.5").wait_for()
    visitor.close_notifications()
    field.fill("--box 0.9, 0.2 0.2 1.2 1.2 1.2")
    field.press("Enter")
    wait_for(lambda: page.page_state.box == (0.9, 0.2, 0.2, 1.2, 1.2, 1.2))
    positions = visitor.app.controller.scene.sparse_positions
    inside = int(((positions > (0.9, 0.2, 0.2)) & (positions < 1.2)).all(axis=1).sum())
    assert 0 < inside < len(positions)
    tab.get_by_text(re.compile(f"{inside} of {len(positions)} sparse points are in the box")).wait_for()
    visitor.button("Hide the box").click()

"""A flip record in a real browser."""

import numpy as np
import pytest
from playwright.sync_api import Page

from app.flips.server import FlipApp
from app.viser_bridge.server import start_viewer
from demo_scenes import load_demo
from fairing.scene import Scene
from tests.browser.driver import IN_BROWSER, button_of
from tests.flip_records import flipped_at_random, grid_mesh
from tests.waiting import wait_for

pytestmark = IN_BROWSER


@pytest.fixture(scope="module")
def flip_app():
    vertices, faces = grid_mesh(5)
    cube = load_demo("cube")
    # A patch within the cube, which its photos look at.
    low, high = cube.mesh.vertices.min(0), cube.mesh.vertices.max(0)
    scene = Scene.build("patch", low + vertices / 4 * (high - low), faces, cube.views)
    app = FlipApp(start_viewer("127.0.0.1", 0), scene, flipped_at_random(scene.mesh.vertices, scene.mesh.faces, 2, 4))
    yield app
    app.stop()


def drawn_faces(page) -> np.ndarray:
    """(m, 3) int: the faces of the mesh in the browser."""
    found = page.evaluate(
        """() => {
            const node = window.__viserMutable.nodeRefFromName['/mesh/now'];
            return Array.from((node.geometry ?? node.children[0].geometry).index.array);
        }"""
    )
    return np.array(found, dtype=int).reshape(-1, 3)


def test_flips_are_stepped_scrubbed_and_played(page: Page, flip_app: FlipApp):
    troubles: list[str] = []
    page.on("pageerror", lambda error: troubles.append(str(error)))
    page.goto(flip_app.url)
    step = button_of(page, "One flip")
    step.wait_for()
    page.wait_for_function("() => window.__viserMutable?.nodeRefFromName?.['/mesh/now']")
    trace = flip_app.story.film.trace

    def is_at(moment: int) -> None:
        page.get_by_text(f"Flip {moment} of 8", exact=True).wait_for()
        wait_for(lambda: np.array_equal(drawn_faces(page), trace.faces_at(moment)))

    is_at(0)
    step.click()
    is_at(1)
    page.keyboard.press("]")
    is_at(4)
    page.keyboard.press(",")
    is_at(3)
    new = page.evaluate("() => window.__viserMutable.nodeRefFromName['/edges/new'].visible")
    assert new, "the edge of the last flip is marked"
    plot = page.get_by_role("img", name="Energy plot")
    box = plot.bounding_box()
    assert box is not None
    plot.click(position={"x": box["width"] - 8, "y": 40})
    is_at(8)
    page.keyboard.press("t")  # from the start again, to the end
    button_of(page, "Play the flips, or stop").get_by_text("Pause").wait_for()
    is_at(8)
    page.keyboard.press("1")
    leave = button_of(page, "Leave the camera")
    leave.wait_for()
    page.keyboard.press("0")
    leave.wait_for(state="detached")
    assert troubles == []

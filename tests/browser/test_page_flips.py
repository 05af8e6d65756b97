"""A flip record in a real browser."""

import numpy as np
import pytest
from playwright.sync_api import Page

from app.flips.server import FlipApp
from app.viser_bridge.server import start_viewer
from demo_scenes import load_demo
from fairing.scene import Scene
from tests.bodies import AROUND, carved
from tests.browser.driver import IN_BROWSER, button_of
from tests.flip_records import flipped_at_random, grid_mesh, split_by_hand
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


def test_face_splits_are_stepped_both_ways(page: Page):
    troubles: list[str] = []
    page.on("pageerror", lambda error: troubles.append(str(error)))
    vertices, faces = grid_mesh(5)
    cube = load_demo("cube")
    low, high = cube.mesh.vertices.min(0), cube.mesh.vertices.max(0)
    trace = split_by_hand(low + vertices / 4 * (high - low), faces)
    scene = Scene.build("patch", trace.vertices, trace.faces_at(0), cube.views)
    app = FlipApp(start_viewer("127.0.0.1", 0), scene, trace)

    def has(name: str, expected: bool = True) -> None:
        shown = "([name, expected]) => !!window.__viserMutable?.nodeRefFromName?.[name]?.visible === expected"
        page.wait_for_function(shown, arg=[f"/splits/{name}", expected])

    try:
        page.goto(app.url)
        page.get_by_text("Candidates", exact=True).wait_for()
        has("candidate")
        has("split", False)
        button_of(page, "One step").click()
        page.get_by_text("Part 1 of 3: split", exact=True).wait_for()
        for name in ("split", "candidate", "part"):
            has(name)
        page.keyboard.press(",")
        page.get_by_text("Candidates", exact=True).wait_for()
        has("split", False)
        has("part", False)
        page.get_by_role("listitem", name="Flips").click()
        page.get_by_text("Flip 0 of 0", exact=True).wait_for()
        has("candidate", False)
        page.keyboard.press(",")
        page.get_by_text("Part 1 of 1: stays", exact=True).wait_for()
        has("stays")
    finally:
        app.stop()
    assert troubles == []


@pytest.fixture(scope="module")
def carving_app():
    trace = carved()
    scene = Scene.build("torus", trace.vertices, trace.faces_at(0), AROUND)
    app = FlipApp(start_viewer("127.0.0.1", 0), scene, trace)
    yield app
    app.stop()


def is_shown(page: Page, name: str, expected: bool = True) -> None:
    """Wait until a node of the carving is visible in the browser, or not."""
    page.wait_for_function(
        "([name, expected]) => !!window.__viserMutable?.nodeRefFromName?.[name]?.visible === expected",
        arg=[f"/carving/{name}", expected],
    )


def test_a_mesh_is_carved_out_of_its_points(page: Page, carving_app: FlipApp):
    troubles: list[str] = []
    page.on("pageerror", lambda error: troubles.append(str(error)))
    page.goto(carving_app.url)
    page.get_by_text("Photos", exact=True).wait_for()
    button_of(page, "One step").click()
    page.get_by_text("Points of photo 1 · p0", exact=True).wait_for()
    is_shown(page, "new_points")
    page.keyboard.press("]")
    page.get_by_text("Delaunay tetrahedra", exact=True).wait_for()
    is_shown(page, "none")
    is_shown(page, "new_points", False)
    page.keyboard.press("]")
    page.get_by_text("Rays of photo 1 · p0", exact=True).wait_for()
    page.keyboard.press("F11")
    page.get_by_text("Rays of photo 2 · p1", exact=True).wait_for()
    is_shown(page, "rays")
    page.keyboard.press("Shift+F11")
    page.get_by_text("Rays of photo 1 · p0", exact=True).wait_for()
    page.get_by_role("listitem", name="Cut").click()
    page.get_by_text("Minimum cut", exact=True).wait_for()
    is_shown(page, "cut_outside")
    page.get_by_role("button", name="Off", exact=True).click()
    is_shown(page, "cut_outside", False)
    # The middle of the window shows the body of the torus or its hole, a bit beside it surely the body.
    page.evaluate("() => document.querySelectorAll('.mantine-Notification-closeButton').forEach(b => b.click())")
    served = next(iter(carving_app.pages.values()))
    assert served._carving is not None
    box = page.locator("canvas[data-engine]").first.bounding_box()
    assert box is not None
    for share in (0.5, 0.45, 0.4, 0.55):
        page.mouse.click(box["x"] + share * box["width"], box["y"] + 0.45 * box["height"])
        page.wait_for_timeout(300)
        if served._carving._selected is not None:
            break
    page.get_by_role("heading", name=f"Tetrahedron {served._carving._selected}", exact=True).wait_for()
    page.get_by_text("the cut says").wait_for()
    is_shown(page, "selected")
    page.locator(".pulls button.link").first.click()
    page.get_by_role("button", name="Deselect").click()
    is_shown(page, "selected", False)
    page.keyboard.press("Shift+?")
    dialog = page.get_by_role("dialog")
    dialog.get_by_text("To the end of the chapter or round").wait_for()
    page.keyboard.press("Escape")
    dialog.wait_for(state="detached")
    page.get_by_role("listitem", name="Decimation").click()
    page.get_by_text("The seen surface", exact=True).wait_for()
    is_shown(page, "surface")
    is_shown(page, "cut_inside", False)
    button_of(page, "To the last step").click()
    page.get_by_text("Flip 0 of 0", exact=True).wait_for()
    is_shown(page, "surface", False)
    assert troubles == []

"""A large mesh with sparse points in a real browser: what is hidden at first, flights, standard views, tracks of points."""

import numpy as np
import pytest
import trimesh
from playwright.sync_api import ViewportSize

from app.layers.vertices import RING
from app.page.server import start
from app.page_state.selection import Selection
from demo_scenes import load_demo
from fairing.run.session import Session
from fairing.scene import Scene
from tests.browser.driver import IN_BROWSER, WINDOW, Visitor, page_of
from tests.two_levels import two_levels
from tests.waiting import wait_for

pytestmark = [*IN_BROWSER, pytest.mark.slow]

OPTIONS = two_levels("sequential", sweeps=1, iterations=1).with_levels(blur=2.0)


@pytest.fixture(scope="module")
def app():
    app = start(Session(large_archway(), OPTIONS), port=0)
    yield app
    app.stop()


def large_archway() -> Scene:
    """The archway with each face cut into four, so that its mesh counts as large."""
    scene = load_demo("archway")
    vertices, faces = trimesh.remesh.subdivide(scene.mesh.vertices, scene.mesh.faces)
    return Scene.build(
        scene.name, vertices, faces, scene.views, sparse_points=scene.sparse_points, points_choice="given"
    )


def test_wires_and_start_of_a_large_mesh_are_hidden_until_asked_for(visitor: Visitor):
    page_state = page_of(visitor.app).page_state
    assert len(visitor.app.controller.scene.mesh.vertices) > 200
    assert not page_state.shows("now")
    assert not page_state.shows("start")
    visitor.page.get_by_role("tab", name="Layers", exact=True).click()
    visitor.button("Show present mesh").click()
    visitor.page.wait_for_function("() => window.__viserMutable.nodeRefFromName['/mesh/now_edges']?.visible")
    visitor.page.locator("#eigenfairing-overlay", has_text="Now").wait_for()
    visitor.button("Hide present mesh").click()
    visitor.page.locator("#eigenfairing-overlay", has_text="Now").wait_for(state="hidden")


def test_a_vertex_chosen_by_number_is_flown_to_and_marked(visitor: Visitor):
    page, stage = page_of(visitor.app), visitor.app.resources.stage
    visitor.page.get_by_role("tab", name="Vertex", exact=True).click()
    field = visitor.input_of("Vertices")
    field.fill("17")
    field.press("Enter")
    target = stage.page_from_world(visitor.app.controller.state.vertices[17])
    wait_for(lambda: np.allclose(page._client.camera.look_at, target, atol=1e-3))
    middle = np.array(visitor.canvas_size()) / 2
    wait_for(lambda: np.abs(visitor.drawn_at(17) - middle).max() < 3)  # the browser draws what was sent a little later
    assert page.page_state.selection.vertices == (17,)


def test_standard_views_have_keys(visitor: Visitor):
    camera, stage = page_of(visitor.app)._client.camera, visitor.app.resources.stage
    for key, eye in (
        ("m", stage.eye),
        ("v", stage.overview()),
        ("Shift+F", stage.frontal()),
        ("Shift+T", stage.above()),
    ):
        visitor.page.keyboard.press(key)
        wait_for(lambda eye=eye: np.allclose(camera.position, eye, atol=1e-2))


def test_a_phone_shows_the_whole_mesh_and_whole_buttons(visitor: Visitor):
    width = 390
    visitor.resize({"width": width, "height": 844})
    try:
        visitor.page.keyboard.press("m")
        vertices = range(0, len(visitor.app.controller.scene.mesh.vertices), 7)
        title = visitor.box_of(visitor.page.get_by_text("EigenFairing ·"))  # of the panel that covers the rest
        free = (width, title["y"])
        wait_for(lambda: all((visitor.drawn_at(vertex) > 0).all() for vertex in vertices))
        wait_for(lambda: all((visitor.drawn_at(vertex) < free).all() for vertex in vertices))
        for name in ("Run", "Step one level"):
            box = visitor.box_of(visitor.button(name))
            assert box["x"] + box["width"] <= width, name
    finally:
        visitor.resize(WINDOW)
        visitor.page.keyboard.press("m")


def test_a_window_made_narrow_or_wide_shows_the_standard_view_anew_unless_the_user_has_moved_the_camera(
    visitor: Visitor,
):
    page, camera, stage = visitor.page, page_of(visitor.app)._client.camera, visitor.app.resources.stage
    narrow: ViewportSize = {"width": WINDOW["width"], "height": 900}  # wider by height than a phone

    def stands_at(eye: np.ndarray, target: np.ndarray) -> bool:
        """Whether the camera is where the view's width by height wants it: farther away by 0.7 / aspect in narrow views."""
        return np.allclose(camera.position, target + max(1.0, 0.7 / camera.aspect) * (eye - target), atol=1e-2)

    try:
        for key, eye, target in (
            ("m", stage.eye, stage.target),
            ("Shift+F", stage.frontal(), stage.target),
            ("Shift+T", stage.above(), stage.target_from_above()),
            ("v", stage.overview(), stage.target),
        ):
            page.keyboard.press(key)
            wait_for(lambda eye=eye, target=target: stands_at(eye, target))
            visitor.resize(narrow)
            wait_for(lambda: camera.aspect < 0.68)
            wait_for(lambda eye=eye, target=target: stands_at(eye, target))
            visitor.resize(WINDOW)
            wait_for(lambda: camera.aspect > 0.7)
            wait_for(lambda eye=eye: np.allclose(camera.position, eye, atol=1e-2))
        # A photo that is looked through meanwhile, and left, changes nothing about it.
        page.keyboard.press("m")
        wait_for(lambda: stands_at(stage.eye, stage.target))
        page.keyboard.press("3")
        wait_for(lambda: not stands_at(stage.eye, stage.target))
        visitor.resize(narrow)
        wait_for(lambda: camera.aspect < 0.68)
        page.keyboard.press("0")
        wait_for(lambda: stands_at(stage.eye, stage.target))
        visitor.resize(WINDOW)
        wait_for(lambda: np.allclose(camera.position, stage.eye, atol=1e-2))
        # Moved a little by the user.
        box = visitor.canvas_box()
        x, y = box["x"] + 0.1 * box["width"], box["y"] + 0.5 * box["height"]

        def drag() -> None:
            page.mouse.move(x, y)
            page.mouse.down()
            page.mouse.move(x + 25, y + 10, steps=5)
            page.mouse.up()

        visitor.use_mouse(drag, lambda: not stands_at(stage.eye, stage.target))
        own = np.array(camera.position)
        while True:  # the view comes to rest slowly, more so on a busy machine
            page.wait_for_timeout(1000)
            before, own = own, np.array(camera.position)
            if np.array_equal(before, own):
                break
        for size in (narrow, WINDOW):
            visitor.resize(size)
            wait_for(lambda size=size: (camera.aspect < 0.68) == (size == narrow))
            page.wait_for_timeout(500)  # what would move it anew
            assert np.array(camera.position) == pytest.approx(own, abs=1e-2), "the user's own pose stays"
    finally:
        visitor.resize(WINDOW)
        page.keyboard.press("m")


def test_no_frustum_with_a_photo_covers_the_mesh(visitor: Visitor):
    visitor.page.keyboard.press("Shift+F")
    layer = next(layer for layer in page_of(visitor.app).layers._layers if type(layer).__name__ == "CamerasLayer")
    stage = visitor.app.resources.stage
    wait_for(lambda: np.allclose(page_of(visitor.app)._client.camera.position, stage.frontal(), atol=1e-2))
    wait_for(lambda: any(outline.visible for outline in layer._outlines))
    for frustum, outline in zip(layer._frusta, layer._outlines, strict=True):
        assert frustum.visible != outline.visible
    visitor.page.keyboard.press("m")


def test_the_vertex_being_stepped_is_marked(visitor: Visitor):
    state = visitor.key("F11")
    assert state.record is not None
    while len(state.record.vertices) != 1:
        state = visitor.key("F11")
    visitor.page.wait_for_function("() => window.__viserMutable.nodeRefFromName['/vertices/stepped']?.visible")
    vertices = visitor.app.resources.stage.page_from_world(state.vertices).astype(np.float64)
    stepped = int(state.record.vertices[0])
    for come_nearer in (False, True):
        if come_nearer:
            page_of(visitor.app).camera.fly_to(stepped, vertices)
        wait_for(
            lambda: np.abs(np.linalg.norm(ring_drawn(visitor) - visitor.drawn_at(stepped), axis=1) - RING).max() < 1
        )
    visitor.page.keyboard.press("m")


def ring_drawn(visitor: Visitor) -> np.ndarray:
    """Where the ring around the stepped vertex is drawn within the canvas, pixels."""
    found = visitor.page.evaluate(
        """() => {
            const {camera, canvas, nodeRefFromName} = window.__viserMutable, box = canvas.getBoundingClientRect();
            let ring = null;
            nodeRefFromName['/vertices/stepped'].traverse(node => { if (node.isMesh) ring = node; });
            if (ring.material.depthTest) return [[0, 0]];
            const ends = ring.geometry.attributes.instanceStart, places = [];
            for (let k = 0; k < ends.count; k++) {
                const p = ring.position.clone().fromBufferAttribute(ends, k).applyMatrix4(ring.matrixWorld).project(camera);
                places.push([(p.x + 1) / 2 * box.width, (1 - p.y) / 2 * box.height]);
            }
            return places;
        }"""
    )
    return np.array(found)


def test_a_click_on_a_sparse_point_shows_its_track(visitor: Visitor):
    page, points = page_of(visitor.app), visitor.app.controller.scene.sparse_points
    assert points is not None
    page.interaction.set_selection(Selection())
    page.page_state.shown["points"], page.page_state.shown["vertices"] = True, False
    visitor.app.controller.republish()
    visitor.page.keyboard.press("m")
    visitor.page.wait_for_function("() => window.__viserMutable.nodeRefFromName['/points/all']?.visible")
    visitor.close_notifications()  # one over the point would take the click
    stage = visitor.app.resources.stage
    wait_for(lambda: np.allclose(page._client.camera.position, stage.eye, atol=1e-2))  # the view moves after the key
    point = int(np.argmax(np.bincount(points.observations[:, 0])))
    place = stage.page_from_world(points.positions[point])
    at = visitor.page.evaluate(
        """place => {
            const {camera, canvas, nodeRefFromName} = window.__viserMutable;
            const node = nodeRefFromName['/points/all'], box = canvas.getBoundingClientRect();
            camera.updateMatrixWorld();
            node.updateWorldMatrix(true, false);
            const p = node.position.clone().set(...place).applyMatrix4(node.matrixWorld).project(camera);
            return [box.x + (p.x + 1) / 2 * box.width, box.y + (1 - p.y) / 2 * box.height];
        }""",
        place.tolist(),
    )

    def is_found() -> bool:  # a busy page may not have drawn the points yet
        visitor.page.mouse.click(*at)
        visitor.page.wait_for_timeout(1000)
        return page.page_state.point is not None

    wait_for(is_found)
    found = page.page_state.point
    visitor.page.get_by_text(f"Sparse point {found}", exact=True).wait_for()
    views = points.observations[points.observations[:, 0] == found, 1]
    visitor.page.get_by_text(f"observed in {len(views)} photos", exact=False).wait_for()
    wait_for(lambda: visitor.page.locator(".ef .crops > div").count() == len(views))
    visitor.page.wait_for_function("() => window.__viserMutable.nodeRefFromName['/points/track']?.visible")
    page.interaction.select(3)
    assert page.page_state.point is None

"""Selection, dragging and locking of vertices, and the keyboard focus, in a real browser."""

from functools import partial

import numpy as np
import pytest

from app.debugger.commands import JumpTo
from app.layers.drag_handle import LARGEST as LARGEST_BALL
from app.layers.marks import ball
from app.page_state.selection import Selection
from app.page_state.vertex_marks import vertex_colors
from app.viser_bridge.instance_marks import LARGEST
from app.viser_bridge.linear_colors import linear_from_srgb
from app.viser_bridge.picking_camera import camera_of
from tests.browser.driver import IN_BROWSER, Visitor, page_of
from tests.two_levels import two_levels
from tests.waiting import wait_for

pytestmark = IN_BROWSER

OPTIONS = two_levels("sequential", sweeps=2, iterations=3)


@pytest.fixture
def visitor(visitor: Visitor) -> Visitor:
    """A page at the start of the recorded run, nothing selected."""
    visitor.app.controller.post(JumpTo(0))
    visitor.app.controller.wait_until_idle()
    interaction, page_state = page_of(visitor.app).interaction, page_of(visitor.app).page_state

    def nothing_is_selected() -> bool:
        if page_state.selection.vertices:  # a click of the test before may still be on its way
            interaction.set_selection(Selection())
        return visitor.input_of("Vertices").input_value() == ""

    wait_for(nothing_is_selected)
    return visitor


def page_vertices(visitor: Visitor, moment: int) -> np.ndarray:
    return visitor.app.resources.stage.page_from_world(visitor.app.controller.state.trace.vertices_at(moment))


def selected(visitor: Visitor) -> list[int]:
    return sorted(page_of(visitor.app).page_state.selection.vertices)


def test_a_click_selects_one_vertex_and_with_shift_several(visitor: Visitor):
    # At first the viewer's note on software rendering lies over vertices 2 and 3.
    view = page_of(visitor.app).page_state

    def click(vertex: int, *selected: int) -> None:
        visitor.use_mouse(lambda: visitor.click_vertex(vertex), lambda: view.selection.vertices == selected)

    click(0, 0)
    visitor.page.keyboard.down("Shift")
    click(4, 0, 4)
    click(0, 4)
    click(0, 4, 0)
    visitor.page.keyboard.up("Shift")
    visitor.page.get_by_text("and 1 more selected").wait_for()
    click(4, 4)


def test_the_energy_along_the_axes_is_drawn_for_the_selected_vertex_in_both_themes(visitor: Visitor):
    interaction, page = page_of(visitor.app).interaction, visitor.page
    plot = page.locator("ef-profile svg")

    def is_drawn_for(vertex: int) -> bool:
        words = plot.get_attribute("aria-label") if plot.count() else None
        return words is not None and f"around vertex {vertex} " in words

    for vertex in (0, 4):
        interaction.select(vertex)
        wait_for(partial(is_drawn_for, vertex))
    assert plot.locator("polyline").count() == plot.locator("circle").count() == 3
    assert plot.locator("text").first.text_content() == "E if vertex 4 moves along x y z "
    look = "line => getComputedStyle(line).stroke"
    before = plot.locator("polyline").first.evaluate(look)
    page.keyboard.press("y")
    wait_for(lambda: plot.locator("polyline").first.evaluate(look) != before)
    page.keyboard.press("y")
    wait_for(lambda: plot.locator("polyline").first.evaluate(look) == before)
    interaction.set_selection(Selection())
    wait_for(lambda: plot.count() == 0)


MARKS = """() => {
    let instances = null, mesh = null;
    window.__viserMutable.nodeRefFromName['/vertices/free'].traverse(part => {
        if (part.matricesTexture) instances = part;
        else if (part.isMesh && part.material.vertexColors) mesh = part;
    });
    const {position, color} = mesh.geometry.attributes;
    return [Array.from(position.array), Array.from(color.array), mesh.geometry.index.count / 3,
            instances.material.visible, mesh.material.visible];
}"""


def test_marks_are_drawn_as_one_mesh_in_place_of_the_instances(visitor: Visitor):
    state, selection = visitor.app.controller.state, (0, 5)
    page_of(visitor.app).interaction.set_selection(Selection(selection))
    n = len(state.vertices)
    expected = linear_from_srgb(vertex_colors(state, selection)) / 255

    def is_drawn() -> bool:
        positions, colors, triangles, shows_instances, shows_mesh = visitor.page.evaluate(MARKS)
        if len(positions) != 3 * n * len(ball(1)[0]) or shows_instances or not shows_mesh:
            return False
        by_mark, colors = np.reshape(positions, (n, -1, 3)), np.reshape(colors, (n, -1, 3))
        return (
            triangles == 80 * n
            and np.allclose(by_mark.mean(axis=1), page_vertices(visitor, 0), atol=1e-4)
            and np.allclose(colors, expected[:, None], atol=1e-6)
        )

    wait_for(is_drawn)


def test_a_vertex_without_a_mark_is_selected_by_a_click_on_it_and_a_click_elsewhere_deselects(visitor: Visitor):
    page, controller = page_of(visitor.app), visitor.app.controller
    page.page_state.shown["vertices"] = False
    controller.republish()
    try:
        visitor.page.wait_for_function("() => !window.__viserMutable.nodeRefFromName['/vertices/free'].visible")
        visitor.close_notifications()
        canvas, corner, other = visitor.canvas_box(), visitor.drawn_at(0), visitor.drawn_at(1)
        visitor.page.mouse.click(canvas["x"] + corner[0] + 4, canvas["y"] + corner[1] + 3)
        wait_for(lambda: selected(visitor) == [0])
        middle = (2 * corner + other) / 3
        visitor.page.mouse.click(canvas["x"] + middle[0], canvas["y"] + middle[1])
        wait_for(lambda: selected(visitor) == [])
    finally:
        page.page_state.shown["vertices"] = True
        controller.republish()


def test_from_nearby_a_mark_leaves_its_corner_visible(visitor: Visitor):
    page = page_of(visitor.app)
    camera, corner = page._client.camera, page_vertices(visitor, 0)[0]
    page.interaction.set_selection(Selection((0,)))
    before, target = np.array(camera.position), np.array(camera.look_at)

    def radius() -> float:
        """Of the mark of vertex 0, screen pixels."""
        return visitor.page.evaluate(
            """n => {
                const {camera, canvas, nodeRefFromName} = window.__viserMutable;
                let mesh = null;
                nodeRefFromName['/vertices/free'].traverse(part => {
                    if (part.isMesh && part.material.vertexColors && !part.matricesTexture) mesh = part;
                });
                const {array} = mesh.geometry.attributes.position, center = camera.position.clone().set(0, 0, 0);
                const points = Array.from({length: n}, (_, k) => center.clone().fromArray(array, 3 * k));
                for (const point of points) center.addScaledVector(point, 1 / n);
                const size = center.distanceTo(points[0]), depth = -center.clone().applyMatrix4(mesh.matrixWorld)
                    .applyMatrix4(camera.matrixWorldInverse).z;
                return size / depth * camera.projectionMatrix.elements[5] * canvas.clientHeight / 2;
            }""",
            len(ball(1)[0]),
        )

    try:
        wait_for(lambda: 0.9 * LARGEST < radius() <= 1.01 * LARGEST)
        camera.look_at = corner
        camera.position = corner + 0.15 * (before - corner)
        visitor.page.wait_for_function(
            """near => {
                const {camera, nodeRefFromName} = window.__viserMutable, ball = nodeRefFromName['/drag_handle/ball'];
                const place = camera.position.clone().setFromMatrixPosition(ball.matrixWorld);
                return ball.visible && Math.abs(camera.position.distanceTo(place) - near) < 0.01 * near;
            }""",
            arg=float(np.linalg.norm(0.15 * (before - corner))),
        )
        wait_for(lambda: 0.9 * LARGEST < radius() <= 1.01 * LARGEST)
        size = visitor.page.evaluate(
            """() => {
                const {camera, canvas, nodeRefFromName} = window.__viserMutable;
                let mesh = null;
                nodeRefFromName['/drag_handle/ball'].traverse(part => { if (part.isMesh) mesh = part; });
                const place = camera.position.clone().setFromMatrixPosition(mesh.matrixWorld);
                const depth = -place.applyMatrix4(camera.matrixWorldInverse).z;
                return mesh.matrixWorld.getMaxScaleOnAxis() / depth * camera.projectionMatrix.elements[5]
                    * canvas.clientHeight / 2;
            }"""
        )
        assert size == pytest.approx(LARGEST_BALL, rel=0.01)
    finally:
        camera.position, camera.look_at = before, target
        page.interaction.set_selection(Selection())


def test_a_rectangle_selects_the_vertices_in_it_and_a_click_on_the_background_deselects(visitor: Visitor):
    canvas = visitor.canvas_box()
    mouse = visitor.page.mouse
    x, y = visitor.drawn_at(0)
    visitor.page.keyboard.down("Shift")
    mouse.move(canvas["x"] + x - 25, canvas["y"] + y - 25)
    mouse.down()
    mouse.move(canvas["x"] + x + 10, canvas["y"] + y + 10)
    mouse.move(canvas["x"] + x + 25, canvas["y"] + y + 25)
    mouse.up()
    visitor.page.keyboard.up("Shift")
    wait_for(lambda: selected(visitor) == [0])
    mouse.click(canvas["x"] + 30, canvas["y"] + canvas["height"] / 2)
    wait_for(lambda: selected(visitor) == [])


def test_vertices_are_selected_by_number_and_the_field_shows_the_selection(visitor: Visitor):
    entry = visitor.input_of("Vertices")
    entry.fill("2, 4-6")
    entry.press("Enter")
    wait_for(lambda: selected(visitor) == [2, 4, 5, 6])
    assert page_of(visitor.app).page_state.selected == 2

    entry.fill("2, 400")
    entry.press("Enter")
    visitor.toast("expected numbers 0 to 6, found 400").wait_for()
    visitor.select_by_click(0)
    wait_for(lambda: entry.input_value() == "0")


def test_a_click_on_a_camera_keeps_the_selection(visitor: Visitor):
    """One click is reported for the node and for the scene; only the first may count."""
    page = page_of(visitor.app)
    page.interaction.set_selection(Selection((3,)))
    canvas, place, before = visitor.canvas_box(), page_vertices(visitor, 0), visitor.drawn_at(0)
    visitor.page.keyboard.press("v")

    def stands_at_overview() -> bool:
        """The photo may be in the canvas before the camera moves as well, so the browser's own drawing is compared."""
        uv, _ = camera_of(page._client).project(place[:1].astype(np.float64))
        expected = (uv[0] + 0.5) * canvas["height"] / camera_of(page._client).height
        drawn = visitor.drawn_at(0)
        return np.abs(drawn - before).max() > 10 and np.abs(drawn - expected).max() < 2

    wait_for(stands_at_overview)
    x, y = visitor.photo_drawn_at(2)
    assert 0 < x < canvas["width"]
    assert 0 < y < canvas["height"]
    visitor.page.mouse.click(canvas["x"] + x, canvas["y"] + y)
    wait_for(lambda: page.page_state.entered is not None)
    assert page.page_state.selected == 3
    visitor.page.keyboard.press("0")
    wait_for(lambda: page.page_state.entered is None)
    visitor.page.keyboard.press("m")


def test_a_vertex_is_dragged_and_the_move_is_part_of_the_record(visitor: Visitor):
    controller, canvas = visitor.app.controller, visitor.canvas_box()
    corner = np.array([canvas["x"], canvas["y"]])
    visitor.press("Step one iteration")
    controller.post(JumpTo(-1))
    began = controller.wait_until_idle()
    visitor.select_by_click(0)
    visitor.page.get_by_text("Drag the yellow ball").wait_for()
    x, y = visitor.drawn_at(0) + corner
    visitor.page.wait_for_function("() => window.__viserMutable.nodeRefFromName['/drag_handle/ball']?.visible")
    before = visitor.serial()
    visitor.page.mouse.move(x, y)
    visitor.page.mouse.down()
    visitor.page.mouse.move(x + 12, y + 4)
    visitor.page.mouse.move(x + 24, y + 8)
    visitor.page.wait_for_function("() => window.__viserMutable.nodeRefFromName['/drag_handle/edges']?.visible")
    visitor.page.mouse.up()
    state = visitor.settle(before)
    assert (state.moment, state.length) == (began.length + 1, began.length + 1)
    assert state.record is not None
    assert state.record.is_manual
    visitor.sees_vertices(page_vertices(visitor, state.moment))
    moved = visitor.drawn_at(0) + corner - [x, y]
    assert np.abs(moved - [24, 8]).max() < 4, f"dropped {moved} px from where it was taken"
    state = visitor.key(",")
    visitor.sees_vertices(page_vertices(visitor, began.length))
    state = visitor.key("z")  # at a past moment this forks a run
    assert np.array_equal(state.vertices[0], state.trace.start[0])
    visitor.sees_vertices(page_vertices(visitor, state.moment))


def test_locked_vertices_are_drawn_as_blocks_and_cannot_be_dragged(visitor: Visitor):
    page_of(visitor.app).interaction.set_selection(Selection((2, 4)))
    visitor.page.get_by_text("and 1 more selected").wait_for()
    state = visitor.press("Lock")
    assert np.flatnonzero(state.locked).tolist() == [2, 4]
    visitor.page.wait_for_function("() => window.__viserMutable.nodeRefFromName['/vertices/locked']?.visible")
    visitor.page.wait_for_function("() => !window.__viserMutable.nodeRefFromName['/drag_handle/ball']?.visible")
    visitor.page.get_by_text("shown as a block").wait_for()
    visitor.select_by_click(2)
    assert np.flatnonzero(visitor.key("f").locked).tolist() == [4]


def test_hotkeys_work_after_every_kind_of_widget_was_used(visitor: Visitor):
    """The browser gives no hotkeys while a text line, a checkbox or a dropdown has the focus."""
    page, slider = visitor.page, visitor.page.get_by_role("slider")

    def key_advances() -> None:
        visitor.app.controller.post(JumpTo(0))
        visitor.app.controller.wait_until_idle()
        assert visitor.key("n").moment > 0

    entry = visitor.input_of("Vertices")
    for ending in ("Enter", "Escape"):
        entry.fill("3")
        page.keyboard.type("n")  # in a text input it is a letter
        assert entry.input_value() == "3n"
        entry.fill("3")
        page.keyboard.press(ending)
        key_advances()
    page.get_by_role("tab", name="Layers").click()
    key_advances()
    slider.first.click()
    key_advances()
    visitor.button("Hide vertices").click()
    key_advances()
    visitor.button("Show vertices").click()
    page.get_by_role("tab", name="Options").click()
    page.get_by_text("Robust", exact=True).click()
    key_advances()
    page.get_by_role("combobox", name="norm").click()
    page.get_by_role("option", name="huber").click()
    key_advances()
    page.get_by_text("Step", exact=True).click()
    page.get_by_label("damping always").click()
    key_advances()
    visitor.input_of("max rejections").click()
    canvas = visitor.canvas_box()
    page.mouse.click(canvas["x"] + 30, canvas["y"] + canvas["height"] / 2)
    key_advances()
    page.get_by_role("tab", name="Vertex").click()

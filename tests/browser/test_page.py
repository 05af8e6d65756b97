"""The debugger's page in a real browser: it shows the recorded states, and survives errors, reloads and wrong values."""

import re
import socket
import time
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect

from app.debugger.commands import JumpTo
from app.debugger.run_state import Activity
from app.page.server import App, start
from demo_scenes import load_demo
from fairing.run.session import Session
from tests.browser.driver import IN_BROWSER, Visitor, letterboxed, page_of
from tests.two_levels import two_levels
from tests.waiting import PATIENCE, wait_for

pytestmark = IN_BROWSER

OPTIONS = two_levels("sequential", sweeps=2, iterations=3)


@pytest.fixture(scope="module")
def scene():
    return load_demo("cube")


@pytest.fixture(scope="module")
def app(scene):
    app = start(Session(scene, OPTIONS), port=0)
    yield app
    app.stop()


@pytest.fixture
def visitor(visitor: Visitor) -> Visitor:
    """A page at the start of the recorded run."""
    visitor.app.controller.post(JumpTo(0))
    visitor.app.controller.wait_until_idle()
    return visitor


def page_vertices(app: App, moment: int) -> np.ndarray:
    return app.resources.stage.page_from_world(app.controller.state.trace.vertices_at(moment))


def test_opens_paused_at_the_start(visitor: Visitor):
    assert visitor.app.controller.state.activity is Activity.PAUSED
    visitor.page.get_by_text("Paused", exact=True).wait_for()
    visitor.sees_vertices(page_vertices(visitor.app, 0))


def test_steps_forward_and_back_by_button(visitor: Visitor):
    for extent in ("iteration", "vertex", "sweep", "level"):
        began = visitor.app.controller.state.moment
        state = visitor.press(f"Step one {extent}")
        assert state.moment > began, f"step one {extent} did not move on"
        expect(visitor.page.get_by_text("steps/s"), "a speed while nothing runs").to_have_count(0)
        visitor.sees_vertices(page_vertices(visitor.app, state.moment))
    for extent in ("iteration", "vertex", "sweep", "level"):
        began = visitor.app.controller.state.moment
        state = visitor.press(f"Step back one {extent}")
        assert state.moment < began, f"back one {extent} did not go back"
        visitor.sees_vertices(page_vertices(visitor.app, state.moment))


def test_hotkeys_step_also_after_a_click_on_a_button(visitor: Visitor):
    assert visitor.key("i").moment == 1
    visitor.page.get_by_role("tab", name="Layers").click()
    visitor.button("Hide cameras").click()
    assert visitor.key("F11").moment == 2
    assert visitor.key(",").moment == 1
    visitor.button("Show cameras").click()


def test_runs_to_the_end_and_pauses_on_request(visitor: Visitor, monkeypatch: pytest.MonkeyPatch):
    controller = visitor.app.controller
    visitor.press("Restart")
    step = Session.step
    with monkeypatch.context() as patch:
        patch.setattr(Session, "step", lambda self: time.sleep(0.2) or step(self))
        visitor.button("Run").click()
        wait_for(lambda: controller.state.moment > 1)
        tab = visitor.page.get_by_role("tab", name="Layers", exact=True)
        tab.focus()  # it takes Space for itself, which stands for P in the viewer
        assert tab.evaluate("tab => tab === document.activeElement")
        visitor.page.keyboard.press("p")
        paused = controller.wait_until_idle()
    assert not paused.finished
    visitor.sees_vertices(page_vertices(visitor.app, paused.moment))
    visitor.button("Run").click()
    wait_for(lambda: controller.state.finished and controller.state.activity is Activity.PAUSED)
    visitor.page.get_by_text("Finished", exact=True).wait_for()
    visitor.sees_vertices(page_vertices(visitor.app, controller.state.moment))
    run, step = visitor.button("Run"), visitor.button("Step one iteration")
    assert run.is_disabled()
    color = "button => getComputedStyle(button).backgroundColor"
    assert run.evaluate(color) == step.evaluate(color)


def test_a_key_with_nothing_to_do_shows_one_notice_that_lies_below_the_dialog_of_keys(visitor: Visitor):
    page, controller = visitor.page, visitor.app.controller
    controller.post(JumpTo(0))
    controller.wait_until_idle()
    visitor.close_notifications()
    notices = page.locator(".mantine-Notification-root", has_text="this is the start")
    for key in (",", "[", ",", "u"):
        page.keyboard.press(key)
        notices.first.wait_for()
        page.wait_for_timeout(300)
    expect(notices).to_have_count(1)
    assert "Nothing to do" in notices.inner_text()
    page.keyboard.press("Shift+?")
    dialog = page.locator(".mantine-Modal-content")
    dialog.wait_for()
    layers = [element.evaluate("""element => {
        while (getComputedStyle(element).zIndex === 'auto') element = element.parentElement;
        return Number(getComputedStyle(element).zIndex);
    }""") for element in (notices, dialog)]  # fmt: skip
    assert layers[0] < layers[1]
    page.keyboard.press("Escape")
    dialog.wait_for(state="detached")


def test_scrubbing_shows_the_recorded_vertices(visitor: Visitor):
    visitor.press("Step one level")
    visitor.press("Go to the start")
    length = visitor.app.controller.state.length
    slider = visitor.page.get_by_role("slider").last
    wait_for(lambda: slider.get_attribute("aria-valuemax") == str(length))
    box = visitor.box_of(slider.locator("xpath=ancestor::*[contains(@class,'Slider-track')][1]"))
    for fraction in (0.3, 0.8, 0.5):
        visitor.page.mouse.click(box["x"] + fraction * box["width"], box["y"] + box["height"] / 2)
        # Not the next state: one may still be on its way from before the click.
        wait_for(lambda fraction=fraction: abs(visitor.app.controller.state.moment - fraction * length) <= 1)
        visitor.sees_vertices(page_vertices(visitor.app, visitor.app.controller.state.moment))


def test_a_click_on_the_plot_goes_to_that_moment_also_the_second_time(visitor: Visitor):
    length = visitor.press("Step one level").length
    for _ in range(2):
        visitor.app.controller.post(JumpTo(0))
        before = visitor.app.controller.wait_until_idle().serial
        time.sleep(0.3)  # a second click at once is the same click
        plot = visitor.page.get_by_role("img", name="Residual plot")
        box = visitor.box_of(plot)
        plot.click(position={"x": 0.6 * box["width"], "y": box["height"] / 2})  # scrolls to it where need be
        wait_for(lambda before=before: visitor.app.controller.state.serial > before)
        wait_for(lambda: abs(visitor.app.controller.state.moment - 0.53 * length) < 0.1 * length)


def test_a_click_selects_a_vertex_and_shows_its_variables(visitor: Visitor):
    state = visitor.press("Step one sweep")
    visitor.sees_vertices(page_vertices(visitor.app, state.moment))  # what is drawn anew under a click swallows it
    visitor.page.get_by_role("tab", name="Vertex").click()
    visitor.select_by_click(0)
    visitor.page.get_by_text("moved from the start").wait_for()
    visitor.page.get_by_text("step in the photos").wait_for()
    assert visitor.input_of("Vertices").input_value() == "0"


def test_the_cells_of_the_selected_vertex_are_shown_and_open_their_photo(visitor: Visitor, scene):
    page = page_of(visitor.app)
    page.interaction.select(0)
    visitor.press("Step one iteration")
    visitor.button("Cells of face 3").click()
    name = scene.views[1].name
    strip = visitor.page.get_by_role("button", name=f"Enlarge a cell in {name}", exact=True)
    strip.wait_for()
    assert visitor.page.get_by_alt_text(f"cells in {name}").evaluate(
        "image => image.complete && image.naturalWidth > 200"
    )
    visitor.button(f"Look through {name}").first.click()
    wait_for(lambda: page.page_state.entered == 1)
    visitor.button("Leave the camera").click()
    wait_for(lambda: page.page_state.entered is None)


def test_a_breakpoint_that_is_typed_in_stops_the_run(visitor: Visitor):
    controller = visitor.app.controller
    visitor.page.get_by_role("tab", name="Breakpoints").click()
    entry = visitor.input_of("Stop when")
    entry.fill("moment == ")
    entry.press("Enter")
    visitor.page.get_by_text("condition, column 11").first.wait_for()
    entry.fill("moment == 5")
    entry.press("Enter")
    wait_for(lambda: len(controller.state.breakpoints) == 1)
    visitor.button("Run").click()
    wait_for(lambda: controller.state.moment == 5 and controller.state.activity is Activity.PAUSED)
    visitor.page.get_by_text("Breakpoint: moment == 5").wait_for()
    visitor.button("Remove this breakpoint").click()
    wait_for(lambda: not controller.state.breakpoints)
    visitor.page.get_by_role("tab", name="Vertex").click()


def test_another_k_makes_a_branch_from_here(visitor: Visitor):
    began = visitor.press("Step one sweep")
    visitor.page.get_by_role("tab", name="Options").click()
    title = visitor.page.get_by_text("Eigenspace", exact=True)
    group = title.locator("..")
    assert visitor.box_of(group)["height"] < visitor.box_of(title)["height"], "a closed group is no empty box"
    assert group.evaluate("element => getComputedStyle(element).borderLeftWidth") == "0px"
    title.click()
    entry = visitor.input_of("dimensions")
    entry.fill("none")
    visitor.button("Continue from here").click()
    # The panel shows the error while it is typed, the toast once the button's press was handled.
    visitor.toast("option eigenspace.dimensions").wait_for()
    entry.fill("1")
    visitor.page.get_by_text("Changed: dimensions").wait_for()
    visitor.button("Continue from here").click()
    wait_for(lambda: visitor.app.controller.state.options.by_level("dimensions") == (1,))
    state = visitor.app.controller.wait_until_idle()
    assert state.moment == state.length == began.moment
    visitor.sees_vertices(page_vertices(visitor.app, state.moment))
    visitor.page.get_by_role("tab", name="Vertex").click()


def test_a_busy_page_loses_neither_what_was_typed_nor_the_press_after_it(visitor: Visitor):
    """A browser that was busy delivers keys and clicks at once; viser sends the last change of its widgets in 50 ms."""
    visitor.press("Step one sweep")
    visitor.page.get_by_role("tab", name="Options").click()
    entry = visitor.input_of("dimensions")
    if not entry.is_visible():
        visitor.page.get_by_text("Eigenspace", exact=True).click()
    visitor.button("Continue from here").evaluate(
        """(button, input) => {
            const {set} = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value');
            for (const value of ['4', '3']) {
                set.call(input, value);
                input.dispatchEvent(new Event('input', {bubbles: true}));
            }
            button.click();
        }""",
        arg=entry.element_handle(),
    )
    wait_for(lambda: visitor.app.controller.state.options.by_level("dimensions") == (3,))
    visitor.app.controller.wait_until_idle()
    visitor.page.get_by_role("tab", name="Vertex").click()


def test_the_key_list_is_shown(visitor: Visitor):
    visitor.page.keyboard.press("Shift+?")
    visitor.page.get_by_text("Look through a camera", exact=True).wait_for()
    visitor.button("Close").click()
    visitor.page.locator(".mantine-Modal-content").wait_for(state="detached")  # until then keys do nothing else


@pytest.mark.parametrize("size", [(1280, 720), (1500, 640)])
def test_through_a_camera_the_mesh_lies_on_its_photo(visitor: Visitor, scene, size):
    visitor.page.set_viewport_size({"width": size[0], "height": size[1]})
    page = page_of(visitor.app)
    try:
        visitor.wait_for_page()  # in its new size: Chromium may drop keys before it is painted
        visitor.page.keyboard.press("3")
        wait_for(lambda: page.page_state.entered == 2)
        visitor.button("Leave the camera").wait_for()
        camera = scene.views[2].camera
        vertices = visitor.app.controller.state.vertices
        offsets = np.inf
        deadline = time.monotonic() + PATIENCE  # the window's new size must have reached the server
        while offsets > 1.5 and time.monotonic() < deadline:
            width, height = visitor.canvas_size()
            expected = [letterboxed(camera, vertex, width, height) for vertex in vertices]
            drawn = [visitor.drawn_at(vertex) for vertex in range(len(vertices))]
            offsets = np.linalg.norm(np.subtract(drawn, expected), axis=1).max()
        assert offsets < 1.5, f"vertices are up to {offsets:.2f} px off their place in the photo"
        visitor.page.keyboard.press("0")
        wait_for(lambda: page.page_state.entered is None)
    finally:
        visitor.page.set_viewport_size({"width": 1280, "height": 720})


def test_two_browsers_share_the_run_but_not_the_selection(browser, visitor: Visitor):
    other = Visitor(browser, visitor.app)
    try:
        views = [page.page_state for page in visitor.app.pages.values()]
        assert len(views) == 2
        state = other.press("Step one vertex")
        for tab in (visitor, other):
            tab.sees_vertices(page_vertices(visitor.app, state.moment))
        other.use_mouse(lambda: other.click_vertex(6), lambda: views[1].selected == 6)
        assert views[0].selected != 6
        assert other.troubles == []
    finally:
        other.page.close()


def test_reload_and_reconnect_keep_the_state(visitor: Visitor):
    state = visitor.press("Step one sweep")
    page = page_of(visitor.app)
    page.interaction.select(3)
    visitor.open()
    visitor.sees_vertices(page_vertices(visitor.app, state.moment))
    wait_for(lambda: [page.page_state.selected for page in visitor.app.pages.values()] == [3])
    visitor.app._server._websock_server.disconnect_all_clients()
    wait_for(lambda: page not in visitor.app.pages.values())
    wait_for(lambda: len(visitor.app.pages) == 1)
    visitor.wait_for_page()
    visitor.wait_until_still()  # the buttons of the connection that was cut are replaced
    state = visitor.press("Step one iteration")
    visitor.sees_vertices(page_vertices(visitor.app, state.moment))
    # The browser reports the connection that was cut, and textures it no longer needed; that is the test's doing.
    visitor.troubles[:] = [trouble for trouble in visitor.troubles if not re.search("WebSocket|blob:", trouble)]


def test_an_exception_in_a_callback_is_shown_and_the_page_keeps_working(
    visitor: Visitor, monkeypatch: pytest.MonkeyPatch
):
    def fail(self: Session) -> None:
        raise RuntimeError("<b>the disk is on fire</b>")

    with monkeypatch.context() as patch:
        patch.setattr(Session, "step", fail)
        visitor.press("Step one iteration")
        visitor.toast("RuntimeError: <b>the disk is on fire</b>").wait_for()
    assert visitor.press("Step one iteration").moment == 1


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_dead_thread_is_one_notification_that_names_the_report_and_the_palette_saves_it(
    visitor: Visitor, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    def end(self: Session) -> None:
        raise SystemExit("out of luck")

    controller, page = visitor.app.controller, visitor.page
    monkeypatch.setattr(controller, "_report_path", tmp_path / "report.json")
    visitor.close_notifications()
    before = controller.state
    with monkeypatch.context() as patch:
        patch.setattr(Session, "step", end)
        page.keyboard.press("l")
        page.get_by_text("SystemExit: out of luck").wait_for()
    state = controller.wait_until_idle()
    assert (state.moment, state.trace) == (before.moment, before.trace)
    notifications = page.locator(".mantine-Notification-root")
    expect(notifications).to_have_count(1)
    assert "The command 'Save a problem report' writes the details to" in notifications.inner_text()
    page.keyboard.press("Control+k")
    page.get_by_placeholder("Search").fill("Save a problem report")
    page.keyboard.press("Enter")
    wait_for(lambda: (tmp_path / "report.json").exists())
    page.get_by_text("Problem report saved").first.wait_for()
    assert "out of luck" in (tmp_path / "report.json").read_text()


def test_values_that_make_no_sense_change_nothing(visitor: Visitor):
    page = page_of(visitor.app)
    length = visitor.app.controller.state.length
    for value in (float("nan"), 1e308, -7, "17", None, {"a": 1}, True):
        page.frame.toasts(page.run_controls.jump)(value)
        page.frame.toasts(page.interaction.select)(value)
        page.frame.toasts(page.camera.enter)(value)
    state = visitor.app.controller.wait_until_idle()
    assert (state.moment, state.length) == (0, length)


def test_stop_frees_the_port_and_closes_the_trace(scene, tmp_path):
    app = start(Session(scene, OPTIONS), port=0, save_to=tmp_path / "run.trace")
    app.stop()
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind(("127.0.0.1", app.port))
    assert (tmp_path / "run.trace").stat().st_size > 0

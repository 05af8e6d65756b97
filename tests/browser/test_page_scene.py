"""The 3D view in a real browser: colourings, shapes, photos behind the mesh, dark and light theme."""

import re
import threading
from typing import Any

import cv2
import numpy as np
import pytest
from playwright.sync_api import Browser, ViewportSize, expect

from app.layers.certainty import PIECES, CertaintyLayer
from app.page.server import App, start
from app.page_state import residual_source
from app.page_state.selection import Selection
from app.palette import NOW
from app.pictures.coloring import PER_PIXEL
from app.pictures.texel_picture import TexelPicture, texel_picture
from app.viser_bridge.line_node import LineNode
from demo_scenes import load_demo
from fairing.judge.face_residuals import FaceResiduals
from fairing.judge.texel_flow import texel_flow
from fairing.judge.texel_residuals import TexelResiduals, texel_residuals
from fairing.run.session import Session
from tests.browser.driver import IN_BROWSER, WINDOW, Visitor, page_of
from tests.two_levels import two_levels
from tests.waiting import PATIENCE, wait_for

pytestmark = IN_BROWSER

OPTIONS = two_levels("joint", sweeps=1, iterations=3)


@pytest.fixture(scope="module")
def scene():
    return load_demo("cube")


@pytest.fixture(scope="module")
def app(scene):
    session = Session(scene, OPTIONS)
    session.step()
    app = start(session, port=0)
    yield app
    app.stop()


@pytest.fixture
def visitor(visitor: Visitor) -> Visitor:
    visitor.page.get_by_role("tab", name="Layers").click()
    # The tests read the whole legend: once the user has chosen it, it stays.
    fold = visitor.page.locator("#eigenfairing-overlay .fold")
    fold.click()
    if fold.get_attribute("aria-expanded") == "false":
        fold.click()
    return visitor


# First: with another page open, the browser draws at a lower resolution.
def test_the_timeline_is_as_wide_as_the_view_whatever_the_pixels_of_the_screen(app: App, browser: Browser):
    context = browser.new_context(device_scale_factor=2, viewport=WINDOW)
    page = context.new_page()
    page.goto(app.url)
    page.wait_for_function(
        """() => {
            const canvas = window.__viserMutable?.canvas;
            const timeline = document.querySelector('.ef .strip')?.closest('.ef');
            if (!canvas || !timeline) return false;
            const view = canvas.getBoundingClientRect(), box = timeline.getBoundingClientRect();
            return canvas.width > 1.2 * view.width && box.left > view.left && box.right < view.right &&
                box.width > 0.85 * view.width;
        }""",
        timeout=1000 * PATIENCE,
    )
    context.close()


def test_the_theme_switches_and_the_browser_remembers_it(visitor: Visitor):
    def ground() -> str:
        return visitor.page.evaluate("getComputedStyle(document.querySelector('.ef')).getPropertyValue('--button')")

    dark = ground()
    visitor.page.keyboard.press("y")
    visitor.page.wait_for_selector("html[data-mantine-color-scheme=light]")
    assert ground() != dark
    visitor.open()
    visitor.page.wait_for_selector("html[data-mantine-color-scheme=light]")
    visitor.page.keyboard.press("y")
    visitor.page.wait_for_selector("html[data-mantine-color-scheme=dark]")
    assert ground() == dark


def drawn_colors(visitor: Visitor, node: str) -> bool:
    """Whether a drawn mesh of that name is visible."""
    return visitor.page.evaluate(
        """name => ['a', 'b'].some(side => {
            let node = window.__viserMutable.nodeRefFromName[`${name}_${side}`];
            let seen = false;
            node?.traverse?.(part => { seen = seen || Boolean(part.isMesh); });
            for (; node; node = node.parent) seen = seen && node.visible;
            return seen;
        })""",
        node,
    )


def test_lines_coloured_at_their_ends_look_like_those_of_one_colour(visitor: Visitor):
    page = page_of(visitor.app)
    eye, target = (np.array(place) for place in (page._client.camera.position, page._client.camera.look_at))
    near, across = eye + 0.5 * (target - eye), 0.1 * np.cross(target - eye, visitor.app.resources.stage.up)
    lines = [LineNode(page._client, name, color, 60.0) for name, color in (("/line/one", NOW), ("/line/ends", None))]
    for line, side in zip(lines, (-across, across), strict=True):
        line.show(np.stack([near, near + side])[None], np.full((1, 2, 3), NOW, dtype=np.uint8))

    def drawn_pixels() -> np.ndarray:
        box = visitor.canvas_box()
        picture = cv2.imdecode(np.frombuffer(visitor.page.screenshot(), dtype=np.uint8), cv2.IMREAD_COLOR)
        left, row = round(box["x"] + box["width"] / 2), round(box["y"] + box["height"] / 2)
        return picture[row, [left - 80, left + 80], ::-1].astype(int)

    wait_for(lambda: np.abs(drawn_pixels() - NOW).max() < 20, seconds=30)  # tone mapping changes it by 13
    one, ends = drawn_pixels()
    assert np.abs(one - ends).max() <= 4
    for line in lines:
        line.hide()


def test_the_surface_is_coloured_by_a_quantity_with_a_legend(visitor: Visitor):
    visitor.button("Coloured by: Displacement").click()
    visitor.page.get_by_text("Distance from the start", exact=True).wait_for()
    wait_for(lambda: drawn_colors(visitor, "/mesh/colored"))
    visitor.button("Coloured by: Last step").click()
    visitor.page.get_by_text("Last step of each vertex", exact=True).wait_for()
    visitor.button("Surface: Textured").click()
    wait_for(lambda: not drawn_colors(visitor, "/mesh/colored"))
    visitor.page.get_by_text("Last step of each vertex", exact=True).wait_for(state="hidden")


def drawn_texture(visitor: Visitor, node: str) -> np.ndarray:
    """(h, w, 3) the texture of the mesh of that name that is visible; empty without one."""
    found = visitor.page.evaluate(
        """name => {
            for (const side of ['a', 'b']) {
                const node = window.__viserMutable.nodeRefFromName[`${name}_${side}`];
                let image = null;
                if (node?.visible) node.traverse(part => { image = part.material?.map?.image ?? image; });
                if (!image) continue;
                const canvas = Object.assign(document.createElement('canvas'), {width: image.width, height: image.height});
                const drawing = canvas.getContext('2d');
                drawing.drawImage(image, 0, 0);
                return [image.height, image.width, Array.from(drawing.getImageData(0, 0, image.width, image.height).data)];
            }
            return [0, 0, []];
        }""",
        node,
    )
    return np.array(found[2], dtype=int).reshape(found[0], found[1], 4)[..., :3]


def texel_texture(
    app: App, view: int | None, at_start: bool = False, beside: bool = False, surface: str = "residual"
) -> np.ndarray:
    """(h, w, 3) the residuals, or the flow, at every sample as the texture has to have them; `beside`: in the colours of now and
    the start."""
    results = []

    def compute(session: Session) -> TexelPicture:
        moments = (0, session.moment) if at_start else (session.moment, 0)
        measure: Any = texel_residuals if surface == "residual" else texel_flow
        found, other = (measure(session, moment, view) for moment in moments)
        return texel_picture(found, PER_PIXEL[surface], other if beside else None)

    app.controller.query("test", compute, results.append)
    wait_for(lambda: results)
    picture = cv2.imdecode(np.frombuffer(results[0].picture, dtype=np.uint8), cv2.IMREAD_COLOR)
    return picture[..., ::-1].astype(int)


def is_drawn(visitor: Visitor, node: str, expected: np.ndarray) -> bool:
    drawn = drawn_texture(visitor, node)
    return drawn.shape == expected.shape and bool(np.abs(drawn - expected).max() <= 2)


def choose_in_palette(visitor: Visitor, entry: str) -> None:
    visitor.page.keyboard.press("Control+k")
    search = visitor.page.locator("input.mantine-Spotlight-search")
    search.fill(entry)
    visitor.page.locator(".mantine-Spotlight-action", has_text=entry).click()
    search.wait_for(state="detached")  # keys typed into a palette that closes would be commands


def test_residuals_are_painted_at_every_pixel_for_the_chosen_photo_and_on_both_sides_of_the_divider(
    visitor: Visitor, monkeypatch: pytest.MonkeyPatch
):
    page, app = visitor.page, visitor.app
    title = page.get_by_text("Residual per pixel, grey levels", exact=True)
    may_compute = threading.Event()

    def when_allowed(*inputs: Any) -> TexelResiduals:
        assert may_compute.wait(PATIENCE)
        return texel_residuals(*inputs)

    monkeypatch.setattr(residual_source, "texel_residuals", when_allowed)
    try:
        visitor.button("Coloured by: Residual").click()
        title.wait_for()
        assert page.locator("#eigenfairing-overlay").get_by_text("Computing…", exact=True).is_visible()
    finally:
        may_compute.set()
    all_photos, photo = texel_texture(app, None), texel_texture(app, 0)
    assert all_photos.shape != photo.shape or np.abs(all_photos - photo).max() > 50
    wait_for(lambda: is_drawn(visitor, "/mesh/colored", all_photos))
    visitor.button("Next photo").click()
    page.get_by_text(re.compile(r"^Photo cube_00\.png, blurred by [\d.]+ px$")).wait_for()
    wait_for(lambda: is_drawn(visitor, "/mesh/colored", photo))
    visitor.button("Before and now").first.click()
    page.get_by_role("slider", name="before | now").wait_for()
    start, now = (texel_texture(app, 0, at_start=at_start, beside=True) for at_start in (True, False))
    wait_for(lambda: is_drawn(visitor, "/mesh/colored_start", start) and is_drawn(visitor, "/mesh/colored", now))
    visitor.button("Before and now").first.click()
    wait_for(lambda: not drawn_colors(visitor, "/mesh/colored_start"))
    visitor.button("Detail: Per face").click()
    page.get_by_text("Mean absolute residual, grey levels", exact=True).wait_for()
    choose_in_palette(visitor, "Surface: residual per pixel or per face")
    title.wait_for()
    visitor.button("Previous photo").click()
    wait_for(lambda: is_drawn(visitor, "/mesh/colored", all_photos))
    visitor.button("Surface: Textured").click()
    title.wait_for(state="hidden")


def test_flow_is_painted_at_every_pixel_of_one_photo_with_a_wheel_of_directions(visitor: Visitor):
    page, app = visitor.page, visitor.app
    overlay, page_state = page.locator("#eigenfairing-overlay"), page_of(app).page_state
    title, by_face = (
        overlay.get_by_text(text, exact=True) for text in ("Flow per pixel, px", "Image flow of each face")
    )
    arrows = "name => Boolean(window.__viserMutable.nodeRefFromName['/flow_arrows']?.visible) === name"
    assert page_state.is_per_pixel
    visitor.button("Coloured by: Image flow").click()
    by_face.wait_for()  # of all photos, which have no common direction
    page.wait_for_function(arrows, arg=True)
    expect(visitor.button("Detail: Per face (one vector for each face and photo, with arrows)")).to_have_attribute(
        "aria-pressed", "true"
    )
    visitor.button("Detail: Per pixel").click()
    title.wait_for()
    page.wait_for_function(arrows, arg=False)
    page.get_by_text(re.compile(r"^Photo cube_00\.png, blurred by [\d.]+ px$")).wait_for()
    photo, other = (texel_texture(app, view, surface="flow") for view in (0, 1))
    assert len(np.unique(photo.reshape(-1, 3), axis=0)) > 50
    wait_for(lambda: is_drawn(visitor, "/mesh/colored", photo))
    assert visitor.box_of(overlay.locator(".wheel"))["width"] == 52
    overlay.get_by_text("direction in the photo").wait_for()
    expect(page.get_by_role("group", name="Arrows", exact=True)).to_have_count(0)
    visitor.button("Next photo").click()
    wait_for(lambda: is_drawn(visitor, "/mesh/colored", other))
    visitor.button("Before and now").first.click()
    start, now = (texel_texture(app, 1, at_start, beside=True, surface="flow") for at_start in (True, False))
    wait_for(lambda: is_drawn(visitor, "/mesh/colored_start", start) and is_drawn(visitor, "/mesh/colored", now))
    visitor.button("Before and now").first.click()
    for shown in (by_face, title):
        choose_in_palette(visitor, "Surface: image flow per pixel or per face")
        shown.wait_for()
    visitor.button("Previous photo").click()
    wait_for(lambda: is_drawn(visitor, "/mesh/colored", photo))
    visitor.button("Previous photo").click()
    by_face.wait_for()
    page.wait_for_function(arrows, arg=True)
    visitor.button("Surface: Textured").click()
    by_face.wait_for(state="detached")


def test_residuals_and_flow_of_faces_are_painted_for_all_photos_or_one(visitor: Visitor):
    page = page_of(visitor.app)
    visitor.button("Coloured by: Residual").click()
    visitor.button("Detail: Per face").click()
    visitor.page.get_by_text("Mean absolute residual, grey levels", exact=True).wait_for()
    wait_for(lambda: drawn_colors(visitor, "/mesh/colored"))
    over_all = page.layers.surface.legend
    visitor.button("Next photo").click()
    visitor.page.get_by_text("Photo cube_00.png", exact=True).wait_for()
    assert page.layers.surface.legend.largest != over_all.largest, "one photo has residuals of its own"
    visitor.button("Coloured by: Image flow").click()
    visitor.page.wait_for_function("() => window.__viserMutable.nodeRefFromName['/flow_arrows']?.visible")
    visitor.button("Previous photo").click()
    visitor.page.get_by_text("All photos", exact=True).first.wait_for()
    visitor.button("Surface: Textured").click()
    visitor.page.wait_for_function("() => !window.__viserMutable.nodeRefFromName['/flow_arrows'].visible")
    page.page_state.is_per_pixel = True


def test_colours_of_another_quantity_say_so_until_the_chosen_one_is_computed(
    visitor: Visitor, monkeypatch: pytest.MonkeyPatch
):
    page, compute, may_compute = visitor.page, residual_source.face_residuals, threading.Event()
    overlay = page.locator("#eigenfairing-overlay")
    visitor.button("Coloured by: Residual").click()
    visitor.button("Detail: Per face").click()  # its residuals replace the flow, if that has been computed
    overlay.get_by_text("Mean absolute residual, grey levels", exact=True).wait_for()

    def when_allowed(session: Session, *inputs: Any, **options: Any) -> FaceResiduals:
        with session.work.doing("measuring flow", 9, "face"):
            assert may_compute.wait(PATIENCE)
        return compute(session, *inputs, **options)

    monkeypatch.setattr(residual_source, "face_residuals", when_allowed)
    try:
        visitor.button("Coloured by: Image flow").click()
        overlay.get_by_text("Computing: Image flow of each face…", exact=True).wait_for()
        page.locator(".ef .work-line").filter(has_text="Measuring flow: face 1 of 9").wait_for()
        assert overlay.get_by_text("Mean absolute residual, grey levels", exact=True).is_visible(), "its colours stay"
    finally:
        may_compute.set()
    overlay.get_by_text("Image flow of each face", exact=True).wait_for()
    arrows = overlay.get_by_text(re.compile(r"^All photos\. Arrows: how far each face is off, ×\d+\.$"))
    arrows.wait_for()
    assert visitor.box_of(overlay)["width"] < 200, "leaves the middle of the view to a tall mesh"
    visitor.button("Fold the legend").click()
    arrows.wait_for(state="hidden")
    assert visitor.box_of(overlay)["height"] < 30, "what it covered is in sight"
    visitor.button("Show the legend").click()
    arrows.wait_for()
    expect(overlay.get_by_text("Computing")).to_have_count(0)
    visitor.button("Arrows: ×30").click()
    overlay.get_by_text("All photos. Arrows: how far each face is off, ×30.", exact=True).wait_for()
    visitor.button("Arrows: Auto").click()
    visitor.button("Surface: Textured").click()
    overlay.get_by_text("Image flow of each face", exact=True).wait_for(state="detached")


def test_a_long_legend_in_a_small_view_begins_with_its_title_and_scale_until_the_user_chooses(visitor: Visitor):
    overlay = visitor.page.locator("#eigenfairing-overlay")
    details = overlay.get_by_text(re.compile(r"^All photos\. Arrows: how far each face is off, ×\d+\.$"))
    title, scale = overlay.get_by_text("Image flow of each face", exact=True), overlay.locator(".scale")
    large: ViewportSize = {"width": 1440, "height": 900}
    visitor.open()  # nothing is chosen in a new page
    page_state = page_of(visitor.app).page_state
    page_of(visitor.app).interaction.set_selection(Selection((0,)))
    try:
        page_state.surface = "flow"
        visitor.app.controller.republish()
        for part in (title, scale):
            part.wait_for()
        visitor.button("Show the legend").wait_for()
        expect(details).to_be_hidden()
        assert visitor.box_of(overlay)["height"] < 60
        visitor.resize(large)
        details.wait_for()
        visitor.button("Fold the legend").wait_for()
        visitor.resize(WINDOW)
        details.wait_for(state="hidden")
        visitor.button("Show the legend").click()
        details.wait_for()
        for size in (large, WINDOW):
            visitor.resize(size)
            assert details.is_visible(), "as the user has chosen"
        visitor.button("Fold the legend").click()
        expect(scale).to_be_hidden()
        visitor.resize(large)
        assert title.is_visible()
        assert not details.is_visible(), "as the user has chosen"
        page_state.surface = "moved"
        visitor.app.controller.republish()
        overlay.get_by_text("Distance from the start", exact=True).wait_for()
        assert not scale.is_visible(), "as the user has chosen"
    finally:
        visitor.resize(WINDOW)
        page_of(visitor.app).interaction.set_selection(Selection())
        page_state.surface = "textured"
        visitor.app.controller.republish()


def test_the_surface_is_shown_at_the_start_now_and_at_the_truth_each_with_its_texture(visitor: Visitor, scene):
    stage, state = visitor.app.resources.stage, visitor.app.controller.state
    places = {"Start": state.trace.start, "Truth": scene.truth.vertices, "Now": state.vertices}
    for name, vertices in places.items():
        visitor.button(f"Vertices at: {name}").click()
        visitor.sees_vertices(stage.page_from_world(vertices))
        wait_for(lambda name=name: drawn_colors(visitor, f"/mesh/textured_{name.lower()}"))
    visitor.page.keyboard.press("x")
    visitor.sees_vertices(stage.page_from_world(state.trace.start))
    visitor.page.keyboard.press("x")
    visitor.sees_vertices(stage.page_from_world(state.vertices))


def test_the_model_is_blended_with_the_photo_of_the_entered_camera(visitor: Visitor, scene):
    page = page_of(visitor.app)
    visitor.page.keyboard.press("3")
    wait_for(lambda: page.page_state.entered == 2)
    visitor.page.get_by_text("Photo – model", exact=True).wait_for()
    page.page_state.model_share = 1.0
    visitor.app.controller.republish()
    # The renderer is compiled on its first use.
    wait_for(lambda: page.camera.camera_view._sent is not None and page.camera.camera_view._sent[1] == 1.0)
    laid = page.camera.camera_view._sent[0]
    assert laid.view_id == 2
    photo = scene.views[2].photo.load()
    assert np.array_equal(laid.over(photo, 0.0), photo)
    half, whole = laid.over(photo, 0.5).astype(int), laid.over(photo, 1.0).astype(int)
    assert np.array_equal(half[~laid.is_known], photo[~laid.is_known])
    assert np.abs(half - (photo.astype(int) + whole) / 2).max() <= 1
    assert np.abs(whole - photo)[laid.is_known].mean() < 30, "the prediction shows the same thing as the photo"
    visitor.button("Overlay: Swipe").click()
    wait_for(lambda: page.camera.camera_view._sent == (laid, 1.0, True))
    page.page_state.model_share = 0.0
    visitor.page.keyboard.press("0")
    wait_for(lambda: page.page_state.entered is None)


def test_the_certainty_of_the_selected_vertices_is_drawn_and_listed(visitor: Visitor):
    page = page_of(visitor.app)
    page.interaction.set_selection(Selection((1, 0)))
    visitor.button("Show certainty ellipsoids").click()
    visitor.page.wait_for_function("() => window.__viserMutable.nodeRefFromName['/certainty']?.visible")
    lines = next(layer for layer in page.layers._layers if isinstance(layer, CertaintyLayer))._lines._node
    wait_for(lambda: len(lines.points) == 2 * (3 * PIECES + 1))
    visitor.page.get_by_role("tab", name="Vertex").click()
    visitor.page.get_by_text("3 σ, world units", exact=True).wait_for()
    visitor.page.get_by_role("tab", name="Layers").click()
    visitor.button("Hide certainty ellipsoids").click()
    visitor.page.wait_for_function("() => !window.__viserMutable.nodeRefFromName['/certainty'].visible")

"""Exported pages, opened from disk in a real browser without a network."""

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page

from app.export.page import write_page
from app.export.page_data import GRID
from app.export.report_page import write_report
from app.export.run_facts import RunFacts
from app.export.video import write_video
from app.files.json_file import write_json
from app.html import number
from app.palette import BACKGROUND
from demo_scenes import load_demo
from fairing.judge.inspect import face_cells
from fairing.judge.metrics import quality_report
from fairing.judge.report import run_report
from fairing.options import FairingOptions
from fairing.run.session import Session
from tests.browser.driver import IN_BROWSER, WINDOW
from tests.waiting import wait_for

pytestmark = IN_BROWSER

# Coarse and finest level of the cube: cells and textures are as large as in a full run.
OPTIONS = FairingOptions().with_levels(blur=(6.0, 6.0, 2.0, 2.0, 2.0, 2.0, 0.5), max_sweeps=1)


class Reader:
    """A browser tab without a network that collects everything that goes wrong, and every request."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.troubles: list[str] = []
        self.requests: list[str] = []
        page.on("console", lambda message: self.troubles.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: self.troubles.append(str(error)))
        page.on("request", lambda request: self.requests.append(request.url))

    def open(self, path: Path) -> None:
        self.requests.clear()
        self.page.goto(path.as_uri())
        wait_for(lambda: self.page.evaluate("typeof state === 'undefined' || state.moment >= 0"))
        assert [url for url in self.requests if not url.startswith(("data:", "blob:"))] == [path.as_uri()]

    def moment(self) -> int:
        return self.page.evaluate("state.moment")

    def vertices(self) -> np.ndarray:
        """(n, 3) float32, page units: what the 3D view draws."""
        return np.array(self.page.evaluate("Array.from(viewer.now)"), dtype=np.float32).reshape(-1, 3)

    def picture(self) -> np.ndarray:
        """(h, w, 4): the 3D view's pixels, once it has been drawn again."""
        found = self.page.evaluate(
            """() => { viewer.draw(); const gl = viewer.gl, w = gl.drawingBufferWidth, h = gl.drawingBufferHeight;
            const pixels = new Uint8Array(4 * w * h); gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
            return {w, h, text: btoa(Array.from(pixels, (c) => String.fromCharCode(c)).join(''))}; }"""
        )
        return np.frombuffer(base64.b64decode(found["text"]), np.uint8).reshape(found["h"], found["w"], 4)


@pytest.fixture(scope="module")
def facts(tmp_path_factory) -> RunFacts:
    scene = load_demo("cube")
    session = Session(scene, OPTIONS)
    session.run()
    folder = tmp_path_factory.mktemp("export")
    quality = quality_report(scene, session.trace.start, session.vertices)
    write_json(folder / "report.json", run_report(session, "accurate", {"loading": 1.25}, quality))
    return RunFacts(session, folder)


@pytest.fixture(scope="module")
def file(facts) -> Path:
    write_page(facts, facts.folder / "page.html", 0, lambda fraction: None)
    return facts.folder / "page.html"


@pytest.fixture(scope="module")
def tab(browser):
    context = browser.new_context(viewport=WINDOW, offline=True)
    reader = Reader(context.new_page())
    yield reader
    context.close()


@pytest.fixture
def replay(tab, file):
    """The page at its start, its textures loaded; afterwards nothing may have gone wrong."""
    tab.open(file)
    wait_for(lambda: tab.page.evaluate("viewer.loaded === data.keyframes.length"))
    yield tab
    assert tab.troubles == []


def test_the_page_of_the_cube_is_small_and_asks_for_nothing(file, replay):
    assert file.stat().st_size < 5e6
    text = file.read_text()
    assert "default-src 'none'" in text
    assert re.search(r"(src|href|action)=[\"']?(https?:)?//", text) is None


def test_scrubbing_shows_the_vertices_of_the_record_at_every_moment(replay, facts):
    for moment in (0, 1, facts.length // 2, facts.length, 1):
        replay.page.locator("#slider").fill(str(moment))
        assert replay.moment() == moment
        wanted = facts.stage.page_from_world(facts.trace.vertices_at(moment))
        assert np.abs(replay.vertices() - wanted).max() <= 0.51 * GRID
        assert replay.page.locator("#moment").inner_text() == f"{moment} / {facts.length}"


def test_keys_step_jump_and_play_to_the_end(replay, facts):
    keys = replay.page.keyboard
    keys.press("ArrowRight")
    keys.press("ArrowRight")
    keys.press("ArrowLeft")
    assert replay.moment() == 1
    keys.press("Shift+ArrowRight")
    assert replay.moment() == int(np.unique(facts.energies.sweeps)[1])
    keys.press("End")
    assert replay.moment() == facts.length
    keys.press("Home")
    assert replay.moment() == 0
    replay.page.locator("#speed").select_option("4")
    keys.press("Space")
    wait_for(lambda: replay.page.evaluate("state.moment === data.length && !playback.isOn"))
    replay.page.locator("#back").click()
    keys.press("Space")  # plays on, instead of pressing the button again
    wait_for(lambda: replay.moment() == facts.length)


def test_the_plots_are_cursors_and_controls(replay, facts):
    box = replay.page.locator("#residual").bounding_box()
    replay.page.mouse.click(box["x"] + box["width"] - 12, box["y"] + 60)
    assert replay.moment() > 0.9 * facts.length
    replay.page.keyboard.press("End")
    reading = replay.page.locator("#error .reading").text_content()
    assert float(reading.removesuffix(" %")) == pytest.approx(facts.errors[-1], rel=6e-3)
    replay.page.keyboard.press("Home")
    reading = replay.page.locator("#error .reading").text_content()
    assert float(reading.removesuffix(" %")) == pytest.approx(facts.errors[0], rel=6e-3)


def test_the_mesh_in_sight_changes_and_can_be_compared_with_the_start(replay):
    start = replay.picture()
    replay.page.keyboard.press("End")
    end = replay.picture()
    assert (np.abs(start.astype(int) - end).max(axis=-1) > 40).mean() > 0.01
    replay.page.get_by_role("button", name="Both", exact=True).click()
    both = replay.picture()
    half = both.shape[1] // 2
    assert np.array_equal(both[:, half:], end[:, half:])
    replay.page.get_by_role("button", name="Before", exact=True).click()
    assert np.array_equal(replay.picture()[:, :half], both[:, :half])


def sprite(replay) -> str:
    """The shown cells, as a picture's address."""
    return replay.page.evaluate(
        "[...document.querySelectorAll('#cell-rows canvas')].map((canvas) => canvas.toDataURL()).join()"
    )


def test_a_click_on_a_vertex_shows_its_cells(replay):
    page = replay.page
    place = page.evaluate("(viewer.draw(), viewer.place(2))")
    box = page.locator("#scene").bounding_box()
    page.mouse.click(box["x"] + place[0], box["y"] + place[1])
    assert page.evaluate("state.vertex") == 2
    faces = page.locator("#faces button").all_inner_texts()
    assert faces == [f"face {f}" for f in page.evaluate("ring(2)")]
    pictures = {sprite(replay)}
    page.locator("#faces button").last.click()
    pictures.add(sprite(replay))
    heights = page.evaluate("[...document.querySelectorAll('#cell-rows .strip')].map((strip) => strip.clientHeight)")
    shown = page.locator("#cell-rows").evaluate("rows => rows.clientHeight")
    assert shown == pytest.approx(5 * heights[0] + 16, abs=2), "five whole rows"
    for moment in range(1, 4):
        page.keyboard.press("ArrowRight")
        page.get_by_text(f"moment {moment}:").wait_for()
        pictures.add(sprite(replay))
    assert len(pictures) == 5


CELLS = """async ([face, moment]) => {
    const {views, k, size, energy, ...found} = cells.at(face, moment, verticesAt(moment));
    const names = ["observed", "reconstruction", "residual", "weight"], reader = new FileReader();
    reader.readAsDataURL(new Blob(names.flatMap((name) => found[name])));
    await new Promise((resolve) => { reader.onload = resolve; });
    return {views, k, size, energy, values: reader.result.split(",")[1]};
}"""


def test_cells_computed_in_the_page_are_those_of_the_engine(replay, facts):
    """Photos are in the file without loss; what is left is the border of parts blurred by Fourier transform."""
    finest = facts.options.n_levels - 1
    levels = np.array([facts.session.sweep_state(moment).context.level for moment in range(facts.length + 1)])
    for moment in sorted({0, facts.length, *(np.flatnonzero(np.diff(levels)) + 1).tolist()}):
        level = levels[moment]
        for face in {moment % 6} if level == finest else {moment % 6, (moment + 3) % 6}:
            wanted = face_cells(facts.session, face, moment)
            found = replay.page.evaluate(CELLS, [face, moment])
            assert found["views"] == wanted.views.tolist()
            assert (found["k"], found["size"]) == (len(wanted.basis), wanted.size)
            values = np.frombuffer(base64.b64decode(found["values"]), np.float32).reshape(4, *wanted.observed.shape)
            near = 0.4 if level == finest else 0.02
            for off in np.abs(values[:3] - (wanted.observed, wanted.reconstruction, wanted.residual)):
                assert off.max() < near, (moment, face)
                assert off.mean() < near / 10, (moment, face)
            off = np.abs(values[3] - wanted.weights)[wanted.counts] / wanted.weights.max()
            assert off.mean() < near / 10, (moment, face)
            assert found["energy"] == pytest.approx(wanted.energy, rel=near / 20)


def test_the_page_follows_the_light_theme(browser, file):
    context = browser.new_context(viewport=WINDOW, offline=True, color_scheme="light")
    reader = Reader(context.new_page())
    reader.open(file)
    corner = reader.picture()[5, 5, :3]
    assert corner.min() > 200
    assert reader.troubles == []
    context.close()


def test_the_figures_are_those_of_report_json(replay, facts):
    report = json.loads((facts.folder / "report.json").read_text())
    replay.page.get_by_role("tab", name="Run").click()
    words = replay.page.locator("#tab-run").inner_text()
    quality = report["quality"]["vertices_determined"]
    assert f"{number(quality['before']['rms_percent'], 3)} → {number(quality['after']['rms_percent'], 3)} %" in words
    assert f"{report['seconds']['total']:.1f} s" in words
    assert report["versions"]["numpy"] in words


def test_nothing_is_cut_off_in_a_small_window(replay):
    for tab in ("Cells", "Explanation", "Run"):
        replay.page.get_by_role("tab", name=tab).click()
        wide = replay.page.evaluate(
            """() => [...document.querySelectorAll('body, aside, footer, .page')]
                .filter((node) => node.scrollWidth > node.clientWidth + 1).map((node) => node.id)"""
        )
        assert wide == []
    replay.page.get_by_role("tab", name="Cells").click()
    box, footer = replay.page.locator("#cell-rows").bounding_box(), replay.page.locator("footer").bounding_box()
    assert box["y"] + box["height"] <= footer["y"]


@pytest.mark.parametrize("width", [390, 700])
def test_a_phone_shows_the_mesh_and_the_steps_at_once_and_scrolls_to_the_rest(browser, file, facts, width: int):
    context = browser.new_context(viewport={"width": width, "height": 844}, offline=True, has_touch=True)
    reader = Reader(context.new_page())
    reader.open(file)
    page = reader.page
    view, footer = page.locator("#scene").bounding_box(), page.locator("footer").bounding_box()
    assert view["width"] == width
    assert view["height"] > 250
    card = page.locator("#card").bounding_box()
    assert card["y"] + card["height"] <= view["y"], "the text above the mesh does not cover it"
    assert footer["y"] + footer["height"] <= 844
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.get_by_role("button", name="To the end", exact=True).tap()
    assert reader.moment() == facts.length
    page.locator("#cell-rows canvas").last.scroll_into_view_if_needed()
    sprite = page.locator("#cell-rows canvas").last.bounding_box()
    assert sprite["x"] >= 0
    assert sprite["x"] + sprite["width"] <= width
    page.get_by_role("tab", name="Run").tap()
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert reader.troubles == []
    context.close()


def test_without_3d_the_rest_of_the_page_works(browser, file, facts):
    context = browser.new_context(viewport=WINDOW, offline=True)
    context.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    reader = Reader(context.new_page())
    reader.open(file)
    reader.page.get_by_text("No 3D view").wait_for()
    reader.page.keyboard.press("End")
    assert reader.moment() == facts.length
    assert reader.page.locator("#cell-rows canvas").first.is_visible()
    assert reader.troubles == []
    context.close()


def test_the_report_opens_from_disk(tab, facts):
    write_report(facts, facts.folder / "report.html", lambda fraction: None)
    tab.open(facts.folder / "report.html")
    assert tab.page.locator("img").evaluate_all("images => images.every(i => i.complete && i.naturalWidth > 300)")
    tab.page.set_viewport_size({"width": 390, "height": 844})
    assert tab.page.evaluate("document.documentElement.scrollWidth") <= 390
    first = tab.page.locator("tr > :first-child").evaluate_all("cells => cells.map(cell => cell.clientWidth)")
    assert min(first) >= 72, "words are not broken letter by letter"
    grounds = []
    for theme in ("dark", "light"):
        tab.page.emulate_media(color_scheme=theme)
        grounds.append(tab.page.evaluate("getComputedStyle(document.body).backgroundColor"))
    assert grounds == [f"rgb{BACKGROUND}", "rgb(255, 255, 255)"]
    tab.page.emulate_media(color_scheme=None)
    tab.page.set_viewport_size(WINDOW)
    assert tab.troubles == []


def test_a_video_plays_in_the_browser(tab, facts, monkeypatch):
    monkeypatch.setattr("app.export.video.KEYFRAMES", 2)
    monkeypatch.setattr("app.export.video.SECONDS", 0.5)
    monkeypatch.setattr("app.export.video.VIDEO_SIZE", (320, 240))
    for name in ("run.mp4", "run.webm"):
        write_video(facts, facts.folder / name, lambda fraction: None)
        tab.page.goto((facts.folder / name).as_uri())
        wait_for(lambda: tab.page.evaluate("document.querySelector('video')?.videoWidth") == 320)

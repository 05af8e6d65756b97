"""One Chromium and one page: what a user does and what a user sees."""

import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Locator, Page, ViewportSize, sync_playwright

from app.debugger.controller import RunState
from app.debugger.run_state import Activity
from app.page.page import Page as ServedPage
from app.page.server import App
from fairing.camera import Camera
from tests.waiting import PATIENCE, wait_for

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
IN_BROWSER = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on the PATH; install it to test the page"),
]
ARGUMENTS = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-dev-shm-usage",
    # Without a GPU, WebGL alone needs one in software: to put the page together there as well doubles the time of a frame.
    "--disable-gpu-compositing",
]
WINDOW: ViewportSize = {"width": 1280, "height": 720}


_RECORD_KEYS = """
window.keysReceived = [];
window.addEventListener('keydown', event => window.keysReceived.push(event.key), true);
"""
# Without a graphics card each frame takes a processor 20 to 60 ms, and the viewer draws one after the other, also where
# nothing changes. A pause between frames leaves the processor to what is tested, and without anti-aliasing they take a third
# less.
CHEAP_FRAMES = """
{
    const context = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, attributes) {
        return context.call(this, kind, {...attributes, antialias: false});
    };
    const frame = window.requestAnimationFrame.bind(window), cancel = window.cancelAnimationFrame.bind(window);
    const pauses = new Map(), frames = new Map();
    let last = 0;
    window.requestAnimationFrame = callback => {
        const id = ++last;
        pauses.set(id, setTimeout(() => {
            pauses.delete(id);
            frames.set(id, frame(time => { frames.delete(id); callback(time); }));
        }, 100));
        return id;
    };
    window.cancelAnimationFrame = id => {
        clearTimeout(pauses.get(id));
        if (frames.has(id)) cancel(frames.get(id));
        pauses.delete(id);
        frames.delete(id);
    };
}
"""


@contextmanager
def chromium() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, headless=True, args=ARGUMENTS)
        yield browser
        browser.close()


def button_of(page: Page, name: str) -> Locator:
    """The button of this name, or with this tooltip (without its keys)."""
    tooltip = name.replace('"', '\\"')
    named = page.get_by_role("button", name=name, exact=True)
    return named.or_(page.locator(f'button[title="{tooltip}"], button[title^="{tooltip} ("]'))


def input_of(page: Page, label: str) -> Locator:
    """The line to type into that has this label; the viewer does not link its own."""
    return page.get_by_text(label, exact=True).locator(
        "xpath=(ancestor::label[@class='line']|ancestor::div[contains(@class,'Flex-root')][1])//input"
    )


def page_of(app: App) -> ServedPage:
    """The server's side of the page, where one browser is connected."""
    return next(iter(app.pages.values()))


_STILL = """async () => {
    const places = () => JSON.stringify([...document.querySelectorAll('[data-floating-window], .ef, canvas')].map(
        element => { const {x, y, width, height} = element.getBoundingClientRect(); return [x, y, width, height]; }));
    const deadline = performance.now() + 10000;  // ms
    for (let last = '', same = 0; same < 400 && performance.now() < deadline;) {
        const now = places(), began = performance.now();
        await new Promise(done => setTimeout(() => requestAnimationFrame(done), 20));
        same = now === last ? same + performance.now() - began : 0;
        last = now;
    }
}"""


class Visitor:
    """A browser tab on the debugger that collects everything that goes wrong in it."""

    def __init__(self, browser: Browser, app: App) -> None:
        self.app = app
        self.troubles: list[str] = []
        self.page: Page = browser.new_page(viewport=WINDOW)
        self.page.set_default_timeout(1000 * PATIENCE)
        self.page.on("console", lambda message: self._note(message.type, message.text))
        self.page.on("pageerror", lambda error: self.troubles.append(f"page error: {error}"))
        self.page.add_init_script(_RECORD_KEYS)
        self.page.add_init_script(CHEAP_FRAMES)
        self.page.on("requestfailed", lambda request: self.troubles.append(f"failed request: {request.url}"))
        self.open()

    def _note(self, kind: str, message: str) -> None:
        # The passive-listener message is the viewer's own and harmless.
        if kind == "error" and "preventDefault" not in message:
            self.troubles.append(f"console: {message}")

    def open(self) -> None:
        """Load the page and wait for it."""
        before = len(self.troubles)
        self.page.goto(self.app.url)
        self.wait_for_page()
        # A page that is left stops loading its textures.
        self.troubles[before:] = [trouble for trouble in self.troubles[before:] if "blob:" not in trouble]

    def wait_for_page(self) -> None:
        """Wait until its buttons and its scene are there, its panels have made room for each other, and it has been painted.

        Chromium may drop keys that are pressed before the first paint.
        """
        self.button("Step one iteration").wait_for()
        for node in ("/mesh/now", "/vertices/free"):
            self.page.wait_for_function(f"() => window.__viserMutable?.nodeRefFromName?.['{node}']")
        self.page.wait_for_function(
            """() => {
                const {camera, canvas} = window.__viserMutable, box = canvas.getBoundingClientRect();
                return box.left > 0 && box.right < window.innerWidth
                    && Math.abs(camera.aspect - box.width / box.height) < 1e-3;
            }"""
        )
        self.page.evaluate(
            "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done())))"
        )

    def resize(self, size: ViewportSize) -> None:
        """Change the window's size and wait until its panels have stopped moving: a click would miss one on its way."""
        self.page.set_viewport_size(size)
        self.wait_until_still()

    def wait_until_still(self) -> None:
        """Wait until no panel moves any more, as after another layout."""
        self.page.evaluate(_STILL)

    def button(self, name: str):
        return button_of(self.page, name)

    def press(self, name: str) -> RunState:
        """Press a button and wait for the engine."""
        before = self.serial()
        self.button(name).click()
        return self.settle(before)

    def key(self, key: str) -> RunState:
        """Press a key and wait for the engine."""
        before = self.serial()
        self.page.keyboard.press(key)
        return self.settle(before)

    def serial(self) -> int:
        """Serial of the present state, once a paused engine has computed what the page shows: a long query publishes, too."""
        controller = self.app.controller
        wait_for(
            lambda: (
                controller.activity is not Activity.PAUSED
                or not (controller._is_querying or controller._queue._waiting)
            )
        )
        return controller.state.serial

    def settle(self, before: int) -> RunState:
        """The state after whatever was asked for since the state of that serial."""
        wait_for(lambda: self.app.controller.state.serial > before)
        return self.app.controller.wait_until_idle(PATIENCE)

    def situation(self) -> str:
        """What to know when something does not happen: the page's keys and focus, the state, and what the threads execute."""
        page = self.page.evaluate(
            "() => [window.keysReceived.slice(-10), document.activeElement?.outerHTML.slice(0, 200), document.body.innerText]"
        )
        with tempfile.TemporaryDirectory() as folder:
            report = self.app.controller.save_report(Path(folder) / "report.json").read_text()
        updates = (served._updates for served in self.app.pages.values())
        stacks = "\n".join(found._worker.stack() for found in updates if found is not None)
        return f"keys received: {page[0]}\nfocus: {page[1]}\npage: {page[2]}\n{report}\nupdates of pages:\n{stacks}"

    def sees_vertices(self, vertices: np.ndarray) -> None:
        """Wait until the mesh in the browser has these positions (n, 3), page units, to the last bit."""
        self.page.wait_for_function(
            """expected => {
                const node = window.__viserMutable.nodeRefFromName['/mesh/now'];
                const found = node?.geometry?.attributes?.position?.array
                    ?? node?.children?.[0]?.geometry?.attributes?.position?.array;
                return found && found.length === expected.length && expected.every((value, k) => found[k] === value);
            }""",
            arg=np.asarray(vertices, dtype=np.float32).ravel().tolist(),
        )

    def drawn_at(self, vertex: int) -> np.ndarray:
        """Where a vertex of the mesh is drawn within the canvas, pixels."""
        found = self.page.evaluate(
            """() => {
                const {camera, canvas, nodeRefFromName} = window.__viserMutable;
                const node = nodeRefFromName['/mesh/now'];
                const mesh = node.geometry ? node : node.children[0];
                camera.updateMatrixWorld();
                mesh.updateWorldMatrix(true, false);
                const box = canvas.getBoundingClientRect();
                const matrices = [camera.projectionMatrix, camera.matrixWorldInverse, mesh.matrixWorld];
                return {matrices: matrices.map(m => m.elements),
                        positions: Array.from(mesh.geometry.attributes.position.array), size: [box.width, box.height]};
            }"""
        )
        projection, view, world = (np.array(elements).reshape(4, 4).T for elements in found["matrices"])
        point = np.append(np.array(found["positions"]).reshape(-1, 3)[vertex], 1.0)
        x, y, _, w = projection @ view @ world @ point
        width, height = found["size"]
        return np.array([(x / w + 1) / 2 * width, (1 - y / w) / 2 * height])

    def photo_drawn_at(self, view_id: int) -> np.ndarray:
        """Where the middle of a camera's photo is drawn within the canvas, pixels."""
        found = self.page.wait_for_function(
            """name => {
                const {camera, canvas, nodeRefFromName} = window.__viserMutable;
                let photo = null;
                nodeRefFromName[name]?.traverse(node => { if (node.isMesh && node.material?.map) photo = node; });
                if (!photo) return null;
                camera.updateMatrixWorld();
                photo.updateWorldMatrix(true, false);
                const box = canvas.getBoundingClientRect();
                const place = photo.position.clone().setFromMatrixPosition(photo.matrixWorld).project(camera);
                return [(place.x + 1) / 2 * box.width, (1 - place.y) / 2 * box.height];
            }""",
            arg=f"/cameras/{view_id}",
        )
        return np.array(found.json_value())

    def toast(self, message: str) -> Locator:
        """The notification that has this text."""
        return self.page.locator(".mantine-Notification-root", has_text=message)

    def close_notifications(self) -> None:
        """Close what covers the view: the viewer warns of rendering without a GPU, and errors of earlier tests may stand."""
        self.page.evaluate(
            "() => document.querySelectorAll('.mantine-Notification-closeButton').forEach(button => button.click())"
        )
        self.page.locator(".mantine-Notification-root").first.wait_for(state="detached")

    def click_vertex(self, vertex: int) -> None:
        """Click where the vertex is drawn, once its mark is there to be hit."""
        self.close_notifications()
        self.page.wait_for_function(
            """vertex => ['/vertices/free', '/vertices/locked'].some(name => {
                const node = window.__viserMutable.nodeRefFromName[name];
                let marks = null;
                node?.traverse(part => { if (part.matricesTexture) marks = part; });
                return node?.visible && marks?.bvh && marks.instancesCount > vertex
                    && marks.getMatrixAt(vertex).getMaxScaleOnAxis() > 0;
            })""",
            arg=vertex,
        )
        canvas = self.canvas_box()
        x, y = self.drawn_at(vertex)
        self.page.mouse.click(canvas["x"] + x, canvas["y"] + y)

    def select_by_click(self, vertex: int) -> None:
        """Click a vertex until it is selected."""
        page_state = page_of(self.app).page_state
        self.use_mouse(lambda: self.click_vertex(vertex), lambda: page_state.selection.vertices == (vertex,))

    def use_mouse(self, gesture: Callable[[], None], has_effect: Callable[[], bool]) -> None:
        """Make a gesture in the 3D view, up to three times: it has no effect if the node or view changes before the release."""
        for seconds in (20.0, 20.0, PATIENCE):
            gesture()
            with suppress(AssertionError):
                return wait_for(has_effect, seconds)
        raise AssertionError(f"three gestures had no effect\n{self.situation()}")

    def canvas_box(self) -> dict[str, float]:
        """Where the 3D view is in the window."""
        return self.box_of(self.page.locator("canvas[data-engine]").first)

    def input_of(self, label: str) -> Locator:
        return input_of(self.page, label)

    def box_of(self, element: Locator) -> dict[str, float]:
        """Where an element is, which the page may be about to replace."""
        found: list[Any] = []
        wait_for(lambda: found.append(element.bounding_box()) or found[-1] is not None)
        return found[-1]

    def wait_until_at_rest(self, element: Locator, seconds: float = 0.5) -> None:
        """Wait until an element has not moved for a while: one that moves between press and release gets no click."""
        box, since = self.box_of(element), time.monotonic()
        while time.monotonic() < since + seconds:
            self.page.wait_for_timeout(50)
            if (now := self.box_of(element)) != box:
                box, since = now, time.monotonic()

    def canvas_size(self) -> tuple[float, float]:
        box = self.page.evaluate(
            "() => { const b = window.__viserMutable.canvas.getBoundingClientRect(); return [b.width, b.height] }"
        )
        return box[0], box[1]


def letterboxed(camera: Camera, point: np.ndarray, width: float, height: float) -> np.ndarray:
    """Where a world point should be in a window that shows a centred camera's whole photo, pixels."""
    scale = min(width / camera.width, height / camera.height)
    uv, _ = camera.project(point)
    return (uv + 0.5 - np.array([camera.width, camera.height]) / 2) * scale + np.array([width, height]) / 2

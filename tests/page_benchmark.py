"""How quickly the page answers: `python -m tests.page_benchmark [SCENE ...]`, by default cube. Needs Chromium.

Aims (on two quiet cores): ready within 3 s on the cube after the first run; a click on the screen within 100 ms on the
cube; 10 to 15 updates a second during a run; a run in the page at most 15 % dearer than without one.
"""

import os
import re
import subprocess
import sys
import time

import numpy as np
from playwright.sync_api import Browser
from rich.console import Console
from rich.table import Table

from app.commands import Extent, Forward, Run
from app.run_state import Activity
from app.server import start
from demo_scenes import load_demo
from fairing.scene import Scene
from fairing.session import Session
from tests.browser.driver import Visitor, chromium, wait_for

CLICKS = 15
RUN_SECONDS = 20.0  # of a run, for the updates a second
SAME_STEPS = 40  # made with and without a page, for their ratio

WATCH = """() => {
    const read = () => {
        const node = window.__viserMutable.nodeRefFromName['/mesh/now'];
        return (node.geometry ?? node.children[0].geometry).attributes.position.array;
    };
    window.drawn = [];
    let last = Array.from(read());
    const look = () => {
        const now = read();
        if (now.some((value, k) => value !== last[k])) {
            window.drawn.push(performance.now());
            last = Array.from(now);
        }
        window.watching = requestAnimationFrame(look);
    };
    cancelAnimationFrame(window.watching ?? 0);
    look();
}"""
CLICK = """() => {
    window.drawn = [];
    document.querySelector('button[aria-label="Step one iteration"]').click();
    return performance.now();
}"""


def ready_seconds(scene: str, browser: Browser) -> tuple[float, float]:
    """From the command to its line, and to a page that can be used, s."""
    command = [sys.executable, "-m", "app", "view", scene, "--no-browser", "--port", "8097"]
    began = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"})
    try:
        assert process.stdout is not None
        found = re.search(r"http://\S+", process.stdout.readline())
        assert found is not None, "the command did not say where its page is"
        served = time.perf_counter() - began
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        page.goto(found.group())
        page.get_by_role("button", name="Step one iteration", exact=True).wait_for()
        page.wait_for_function("() => window.__viserMutable?.nodeRefFromName?.['/mesh/now']")
        ready = time.perf_counter() - began
        page.close()
    finally:
        process.terminate()
        process.wait()
    return served, ready


def click_milliseconds(visitor: Visitor) -> list[float]:
    """From a click on a step to the moved mesh, in the browser; steps that move nothing do not count."""
    controller, found = visitor.app.controller, []
    visitor.page.evaluate(WATCH)
    for _ in range(4 * CLICKS):
        if len(found) == CLICKS or controller.state.finished:
            break
        before = controller.state.serial
        clicked = visitor.page.evaluate(CLICK)
        state = visitor.settle(before)
        if state.record is None or not state.record.accepted:
            continue
        visitor.page.wait_for_function("() => window.drawn.length > 0", timeout=60_000)
        found.append(visitor.page.evaluate("() => window.drawn[0]") - clicked)
        time.sleep(0.3)  # so that the textured mesh of this step is not on its way during the next
    return found


def updates_per_second(visitor: Visitor) -> tuple[float, float]:
    """Changes of the mesh in the browser during a run, and steps, a second."""
    controller = visitor.app.controller
    visitor.page.evaluate(WATCH)
    visitor.page.evaluate("() => { window.drawn = [] }")
    before, began = controller.state.moment, time.perf_counter()
    controller.post(Run())
    wait_for(lambda: controller.state.activity is Activity.RUNNING or controller.state.finished)
    while controller.state.activity is not Activity.PAUSED and time.perf_counter() - began < RUN_SECONDS:
        time.sleep(0.05)
    seconds = time.perf_counter() - began
    drawn = visitor.page.evaluate("() => window.drawn.length")
    steps = controller.state.moment - before
    visitor.page.keyboard.press("p")
    controller.wait_until_idle(120)
    return drawn / seconds, steps / seconds


def costs(session: Session, run: object) -> tuple[float, float]:
    """Wall and processor seconds of this process for the same steps; both are made from a warm start."""
    wall, processor = time.perf_counter(), time.process_time()
    assert callable(run)
    run()
    return time.perf_counter() - wall, time.process_time() - processor


def page_over_headless(scene: Scene, browser: Browser) -> tuple[float, float]:
    """Ratios of wall and processor time, of a run with a page over one without."""
    alone = Session(scene)
    alone.step()
    wall, processor = costs(alone, lambda: [alone.step() for _ in range(SAME_STEPS)])
    watched = Session(scene)
    app = start(watched, port=0)
    try:
        visitor = Visitor(browser, app)
        app.controller.post(Forward(Extent.ITERATION))
        app.controller.wait_until_idle(120)
        app.controller.edit_breakpoints(lambda b: b.added(f"moment == {SAME_STEPS + 1}"))
        time.sleep(2)  # until the texture of the first step is painted

        def run() -> None:
            app.controller.post(Run())
            wait_for(lambda: app.controller.state.moment > 1, 600)
            app.controller.wait_until_idle(600)

        with_page, processor_with_page = costs(watched, run)
        assert len(watched.trace) == len(alone.trace)
        visitor.page.close()
    finally:
        app.stop()
    return with_page / wall, processor_with_page / processor


def measure(name: str, browser: Browser) -> list[str]:
    """A row of the table."""
    served, ready = ready_seconds(name, browser)
    scene = load_demo(name)
    app = start(Session(scene), port=0)
    try:
        visitor = Visitor(browser, app)
        clicks = click_milliseconds(visitor)
        updates, steps = updates_per_second(visitor)
        visitor.page.close()
    finally:
        app.stop()
    wall, processor = page_over_headless(scene, browser)
    median, slow = np.median(clicks), np.quantile(clicks, 0.9)
    return [
        name, f"{served:.1f}", f"{ready:.1f}", f"{median:.0f}", f"{slow:.0f}", f"{updates:.1f}", f"{steps:.1f}",
        f"{wall:.2f}", f"{processor:.2f}",
    ]  # fmt: skip


def main() -> None:
    table = Table(title=f"The page, load {os.getloadavg()[0]:.1f} before")
    for head in (
        "scene", "served, s", "ready, s", "click, ms, median", "90 %", "updates/s", "steps/s",
        "page / headless, wall", "processor",
    ):  # fmt: skip
        table.add_column(head)
    with chromium() as browser:
        for name in sys.argv[1:] or ["cube"]:
            table.add_row(*measure(name, browser))
    Console().print(table)


if __name__ == "__main__":
    main()

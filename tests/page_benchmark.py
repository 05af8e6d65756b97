"""How quickly the page answers: `python -m tests.page_benchmark [SCENE [--mesh FILE] ...]`, by default cube.

A SCENE is a demo or a capture. Needs Chromium, and Linux for the processor times of its parts.

Aims (on two quiet cores): ready within 3 s on the cube after the first run; a click on the screen within 100 ms on the
cube; 10 to 15 updates a second during a run; a run in the page at most 15 % dearer than without one.

Without a graphics card Chromium draws with the processor, and the engine wants both cores. Of what the browser costs
during a run on the cube (window 1280 x 720), nine tenths are spent in the process that draws: 40 to 50 ms a frame, 40
even with every node of the scene hidden, 7 with the canvas taken away; the page's own JavaScript takes 5 to 9 ms a
state, and Python 3 ms. So the table tells apart what is sent and what is drawn, and what the parts cost. Tried without
effect on what is drawn: no panels at all during a run, only the surface, a window of a quarter the area (half more). The
panels' share was 8 KB of style sheet a change and elements made anew; both are gone. An empty page of the viewer's takes
as long to be ready as ours once the engine is there; what comes on top is the engine's imports beside it.
"""

import os
import re
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
from playwright.sync_api import Browser, ViewportSize
from rich.console import Console
from rich.table import Table

from app.debugger.commands import Extent, Forward, Restart, Run
from app.debugger.run_state import Activity
from app.files.scene_source import SceneSource
from app.page.server import start
from fairing.run.session import Session
from fairing.scene import Scene
from tests.browser.driver import Visitor, chromium
from tests.waiting import wait_for

CLICKS = 15
RUN_SECONDS = 20.0  # of a run, for the updates a second
SMALL: ViewportSize = {"width": 640, "height": 360}
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


def ready_seconds(arguments: list[str], browser: Browser) -> tuple[float, float]:
    """From the command to its line, and to a page that can be used, s."""
    command = [sys.executable, "-m", "app", "view", *arguments, "--no-browser", "--port", "8097"]
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


def processor_seconds() -> np.ndarray:
    """(2,) Of Chromium: in the process that draws, and in all others."""
    parents, seconds = {}, {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = entry.read_text().rpartition(")")[2].split()
            parents[int(entry.parent.name)] = int(fields[1])
            seconds[int(entry.parent.name)] = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    found = np.zeros(2)
    for process in parents:
        ancestor = parents[process]
        while ancestor in parents and ancestor != os.getpid():
            ancestor = parents[ancestor]
        if ancestor == os.getpid():
            with suppress(OSError):
                draws = "--type=gpu-process" in Path(f"/proc/{process}/cmdline").read_text()
                found[0 if draws else 1] += seconds[process]
    return found


class Updates(NamedTuple):
    """A second of a run: states that were sent, changes of the mesh that were drawn, steps; Chromium's processor
    seconds for drawing and for the rest."""

    sent: float
    drawn: float
    steps: float
    drawing: float
    page: float


def updates_per_second(visitor: Visitor) -> Updates:
    """During a run from the start."""
    controller, sent = visitor.app.controller, []
    controller.post(Restart())
    controller.wait_until_idle(120)
    unsubscribe = controller.subscribe(lambda state: sent.append(state.moment))
    visitor.page.evaluate(WATCH)
    visitor.page.evaluate("() => { window.drawn = [] }")
    before, began, processor = controller.state.moment, time.perf_counter(), processor_seconds()
    controller.post(Run())
    wait_for(lambda: controller.state.activity is Activity.RUNNING or controller.state.finished)
    while controller.state.activity is not Activity.PAUSED and time.perf_counter() - began < RUN_SECONDS:
        time.sleep(0.05)
    seconds = time.perf_counter() - began
    drawn = visitor.page.evaluate("() => window.drawn.length")
    counts = np.array([len(sent), drawn, controller.state.moment - before, *(processor_seconds() - processor)])
    visitor.page.keyboard.press("p")
    controller.wait_until_idle(120)
    unsubscribe()
    return Updates(*(counts / seconds).tolist())


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


def measure(arguments: list[str], browser: Browser) -> dict[str, str]:
    """A column of the table."""
    served, ready = ready_seconds(arguments, browser)
    name, mesh = arguments[0], Path(arguments[2]) if len(arguments) > 2 else None
    scene = SceneSource.typed(name, mesh).load()
    app = start(Session(scene), port=0)
    try:
        visitor = Visitor(browser, app)
        clicks = click_milliseconds(visitor)
        updates = updates_per_second(visitor)
        visitor.page.set_viewport_size(SMALL)
        time.sleep(1)  # until it has laid itself out again
        small = updates_per_second(visitor)
        visitor.page.close()
    finally:
        app.stop()
    wall, processor = page_over_headless(scene, browser)
    median, slow = np.median(clicks), np.quantile(clicks, 0.9)
    return {
        "served, s": f"{served:.1f}",
        "ready, s": f"{ready:.1f}",
        "click, ms: median, 90 %": f"{median:.0f}, {slow:.0f}",
        "states sent a second": f"{updates.sent:.1f}",
        "drawn a second": f"{updates.drawn:.1f}",
        "in a window of 640 x 360": f"{small.drawn:.1f}",
        "steps a second": f"{updates.steps:.1f}",
        "Chromium's cores: drawing, the rest": f"{updates.drawing:.2f}, {updates.page:.2f}",
        "page / headless: wall, processor": f"{wall:.2f}, {processor:.2f}",
    }


def scenes(words: list[str]) -> list[list[str]]:
    """Each scene with its `--mesh FILE`, if it has one."""
    found: list[list[str]] = []
    for word in words:
        if word == "--mesh" or (found and found[-1][-1] == "--mesh"):
            found[-1].append(word)
        else:
            found.append([word])
    return found


def main() -> None:
    load = os.getloadavg()[0]
    found = {}
    with chromium() as browser:
        for arguments in scenes(sys.argv[1:] or ["cube"]):
            found[Path(arguments[0]).name] = measure(arguments, browser)
    table = Table("", *found, title=f"The page, load {load:.1f} before")
    for quantity in next(iter(found.values())):
        table.add_row(quantity, *(values[quantity] for values in found.values()))
    Console().print(table)


if __name__ == "__main__":
    main()

"""A reader of an exported lesson: opens the file without a network, by keyboard or touch, and what the page computes."""

import re
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import BrowserContext, Page

from app.export.page_data import GRID
from app.lesson_pages.playing import PlayedLesson, PlayedStep
from app.lessons.facts import facts_of
from app.lessons.reader import numbers_in
from fairing.judge.inspect import cells_in_context, energies_by_dimension
from tests.waiting import PATIENCE, wait_for

# Cells of the page and the engine differ at the border of parts blurred by Fourier transform (see test_page_export).
ENERGY_TOLERANCE = 0.02
MOST_TABS = 400
# What the page itself knows or computes of the quantities that texts and claims name; `facts.py` describes them.
QUANTITIES = """() => {
    const m = state.moment, {record} = run(), done = m ? record.run.steps[m - 1] : null, face = shownFace();
    const found = face === null ? null : cellsOf(face);
    const isCounted = (i, s) => !found.counts[i] || found.counts[i][s];
    const counted = found?.residual.flatMap((e, i) => Array.from(e).filter((_, s) => isCounted(i, s)));
    const values = {
        photos: data.photos.views.length, faces: arrays.faces.length / 3,
        ended: Number(m === record.length && record.run.isFinished),
        ...(done && {moment: m, level: done.level, sweep: done.sweep, step_px: done.longest}),
        ...(found && {cells: found.views.length, k: found.k, outlier_from: found.threshold,
            rms: Math.sqrt(counted.reduce((sum, e) => sum + e * e, 0) / counted.length),
            outlying: 100 * counted.filter((e) => Math.abs(e) > found.threshold).length / counted.length}),
    };
    const square = found?.singular.map((s) => s * s), total = square?.reduce((a, b) => a + b, 0);
    const unit = data.stage.pageFromWorld / 100, axes = step().axes;
    const axis = (v, c) => (positions()[3 * v + c] - arrays.truth[3 * v + c]) / unit;
    const functions = {
        ...(arrays.truth && {off: (v) => off(v), off_x: (v) => axis(v, 0), off_y: (v) => axis(v, 1), off_z: (v) => axis(v, 2),
            off_px: (v) => Math.max(...data.photos.views.map((_, i) => {
                const [a, b] = [positions(), arrays.truth].map((places) => pictures.pixel(i, point(places, v)));
                return Math.hypot(a[0] - b[0], a[1] - b[1]);
            }))}),
        ...(axes && {long: (v) => axes[v] ? axes[v][2] / axes[v][0] : NaN}),
        ...(found && {share: (k) => 100 * square.slice(0, k).reduce((a, b) => a + b, 0) / total,
            left_by: (k) => run().cells.energyWith(found, k)}),
    };
    return (name, argument) => argument === null ? values[name] : functions[name]?.(argument);
}"""
TERM = re.compile(r"\b([a-z_]+)(?:\((\d+)\))?")


class Reader:
    """A browser tab without a network that collects requests and everything that goes wrong."""

    def __init__(self, context: BrowserContext) -> None:
        self.page: Page = context.new_page()
        self.page.set_default_timeout(1000 * PATIENCE)
        self.troubles: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.troubles.append(message.text) if message.type == "error" else None)
        self.page.on("pageerror", lambda error: self.troubles.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))

    def open(self, path: Path) -> None:
        self.page.goto(path.as_uri())
        self.page.wait_for_selector("body[data-ready]")

    def close(self) -> None:
        """Check that nothing went wrong and nothing but the file was requested."""
        assert self.troubles == []
        assert all(url.startswith(("data:", "blob:", "file:")) for url in self.requests), self.requests
        assert len({url.partition("#")[0] for url in self.requests if url.startswith("file:")}) <= 1
        self.page.context.close()

    def at_step(self, number: int) -> None:
        wait_for(lambda: self.page.evaluate("state.step") == number)

    def tab_to(self, selector: str) -> None:
        """Press Tab until an element that matches has the focus."""
        for _ in range(MOST_TABS):
            self.page.keyboard.press("Tab")
            if self.page.evaluate("selector => document.activeElement.matches(selector)", selector):
                return
        pytest.fail(f"{selector} is not reached by Tab")

    def energy(self) -> float:
        """Energy of the face shown, as the page computes it."""
        return self.page.evaluate("cellsOf(shownFace(), state.cells.dimensions).energy")

    def drag_by_touch(self, x: float, y: float, dx: float, dy: float) -> None:
        """Drag a finger from a position in the window, CSS pixels."""
        touch = self.page.context.new_cdp_session(self.page)
        for kind, points in (
            ("touchStart", [{"x": x, "y": y}]),
            ("touchMove", [{"x": x + dx / 2, "y": y + dy / 2}]),
            ("touchMove", [{"x": x + dx, "y": y + dy}]),
            ("touchEnd", []),
        ):
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    def wide(self) -> list[str]:
        """Elements that scroll sideways, and those that reach beyond the window."""
        return self.page.evaluate(
            """() => [
                ...[...document.querySelectorAll('html, body, main, article, #cells-panel, #below, header')]
                    .filter((node) => node.scrollWidth > node.clientWidth + 1),
                ...[...document.querySelectorAll('body *')].filter((node) => node.checkVisibility()
                    && !node.closest('.unseen, math, svg, #listing') && node.getBoundingClientRect().right > innerWidth + 1)]
                .map((node) => node.id || node.tagName)"""
        )

    def serious_findings(self, *themes: Literal["dark", "light"]) -> list[tuple[str, list[str]]]:
        """Serious and critical findings of axe in these themes."""
        found = []
        for theme in themes:
            self.page.emulate_media(color_scheme=theme)
            violations = Axe().run(self.page).response["violations"]
            serious = [item for item in violations if item["impact"] in ("serious", "critical")]
            found += [
                (f"{theme}: {item['id']}", [node["html"][:160] for node in item["nodes"][:3]]) for item in serious
            ]
        return found


def check_step(reader: Reader, played: PlayedLesson, number: int) -> int:
    """Compare vertices, numbers of the text, claims and cells in the page with the engine. Returns the number of claims."""
    step, written, page = played.steps[number], played.lesson.steps[number], reader.page
    facts = played.runs[step.run].facts
    wanted = facts.stage.page_from_world(facts.trace.vertices_at(step.moment))
    found = np.array(page.evaluate("Array.from(positions())"), dtype=np.float32).reshape(-1, 3)
    assert np.abs(found - wanted).max() <= 0.51 * GRID
    assert page.locator("#title").inner_text() == written.title
    shown = [
        float(value.replace("\u2009", "").replace("\u2212", "-")) for value in page.locator("#text b").all_inner_texts()
    ]
    wanted_numbers = [step.findings.numbers[name] for name in numbers_in(written.text)]
    assert shown == pytest.approx(wanted_numbers, rel=5e-3), written.text
    claims = [claim for claim, holds in step.findings.claims if holds]
    assert page.locator("#claims li").all_text_contents() == claims == [claim.text for claim in written.claims]
    check_quantities(reader, played, step, [*claims, *numbers_in(written.text)])
    return len(claims)


def check_quantities(reader: Reader, played: PlayedLesson, step: PlayedStep, expressions: list[str]) -> None:
    """Compare every quantity of the expressions that the page can compute with the engine's."""
    terms = {(name, argument) for text in expressions for name, argument in TERM.findall(text)}
    known = [(name, int(argument) if argument else None) for name, argument in sorted(terms)]
    found = reader.page.evaluate(
        f"terms => {{ const value = ({QUANTITIES})(); return terms.map(([name, n]) => value(name, n) ?? null); }}",
        known,
    )
    session = played.runs[step.run].facts.session
    session.go_to(step.moment)
    facts = facts_of(session, reader.page.evaluate("shownFace()"), {})
    for (name, argument), value in zip(known, found, strict=True):
        if value is not None:
            wanted = facts.values[name]() if argument is None else facts.functions[name](argument)
            # Positions are on a grid; robust weights and thresholds of a blurred cell differ like its energy.
            assert value == pytest.approx(wanted, rel=ENERGY_TOLERANCE, abs=2e-4, nan_ok=True), (name, argument)


def show_cells_by_keyboard(reader: Reader) -> None:
    """Select a vertex if the step selects none, and show the cells of one of its faces if the step shows something else."""
    if reader.page.evaluate("shownFace()") is None:
        reader.tab_to("#nothing button")
        reader.page.keyboard.press("Enter")
        assert reader.page.evaluate("document.activeElement.matches('#faces button')")
    if not reader.page.locator("#page-cells").is_visible():
        reader.tab_to("[data-page=cells]")
        reader.page.keyboard.press("Enter")


def check_every_k_by_keyboard(reader: Reader, played: PlayedLesson, step: PlayedStep) -> int:
    """Move the slider of k from 1 to its end; each energy is the engine's. Returns the number of values."""
    page, session = reader.page, played.runs[step.run].facts.session
    if not page.locator("#k").is_visible():
        return 0
    face = page.evaluate("shownFace()")
    wanted = energies_by_dimension(session, face, step.moment)
    # With many dimensions hardly anything is left. The engine multiplies cells in single precision, which can then change
    # its energy by some percent (lesson dimensions, k = 10: 141.1 instead of 144.9); the page has double precision.
    rest = 5e-4 * wanted[0]
    reader.tab_to("#k")
    page.keyboard.press("End")  # where the run's own k is the first, Home alone would choose nothing
    page.keyboard.press("Home")
    for k, energy in enumerate(wanted[: int(page.locator("#k").get_attribute("max") or 0)], 1):
        assert page.evaluate("state.cells.dimensions") == k
        assert reader.energy() == pytest.approx(energy, rel=ENERGY_TOLERANCE, abs=rest), (face, k)
        page.keyboard.press("ArrowRight")
    return len(wanted)


def check_moved_vertex(reader: Reader, played: PlayedLesson, step: PlayedStep) -> None:
    """Energy of the faces of the vertex that the reader has moved: the page's is the engine's."""
    facts = played.runs[step.run].facts
    session, offset = facts.session, reader.page.evaluate("state.offset")
    vertex = offset["vertex"]
    vertices = facts.trace.vertices_at(step.moment)
    vertices[vertex] += np.array(offset["by"]) / facts.stage.scale
    sweep, total = session.sweep_state(step.moment), 0.0
    context = session.context_for_moves(vertex, step.moment, vertices[vertex][None])
    for face in reader.page.evaluate("vertex => facesOf(vertex)", vertex):
        shown = reader.page.evaluate("face => cellsOf(face)?.energy", face)
        if shown is not None:  # fewer than three photos see it
            sigma, scale = float(sweep.sigma[face]), float(sweep.scale[face])
            wanted = cells_in_context(session, context, vertices, face, step.moment, sigma, scale).energy
            assert shown == pytest.approx(wanted, rel=ENERGY_TOLERANCE), (vertex, face)
            total += wanted
    found = reader.page.evaluate("vertex => ringEnergy(vertex, positions())", vertex)
    assert found == pytest.approx(total, rel=ENERGY_TOLERANCE), (vertex, step.moment)
    assert "Moved by hand" in reader.page.locator("#try").inner_text()


def check_scrubbed_by_keyboard(reader: Reader, played: PlayedLesson, step: PlayedStep) -> None:
    """Go to the start, one step on, and to the end of the run; the vertices are those of the record."""
    facts = played.runs[step.run].facts
    reader.page.evaluate("document.activeElement.blur()")
    for key, moment in (("Home", 0), (".", min(1, facts.length)), ("End", facts.length)):
        reader.page.keyboard.press(key)
        assert reader.page.evaluate("state.moment") == moment
        wanted = facts.stage.page_from_world(facts.trace.vertices_at(moment))
        found = np.array(reader.page.evaluate("Array.from(viewer.now)"), dtype=np.float32).reshape(-1, 3)
        assert np.abs(found - wanted).max() <= 0.51 * GRID

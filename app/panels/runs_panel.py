"""Runs panel: the recorded runs, and the comparison of the current moment with the reference A (a run or a moment)."""

from dataclasses import replace

import numpy as np
import viser

from app.debugger.commands import DeleteRun, Pause, Race, SwitchTo
from app.debugger.compare import Reference, distances, look_up
from app.debugger.controller import Controller
from app.debugger.residual_history import ResidualHistory
from app.debugger.run_state import RunState
from app.debugger.runs import RunInfo
from app.html import button, icon, number, text
from app.page_state.page_state import PageState
from app.palette import REFERENCE, css
from app.viser_bridge.html_events import HtmlEvents, integer, press
from app.viser_bridge.html_panel import HtmlPanel
from fairing.judge.metrics import vertex_errors
from fairing.options import PRESETS, FairingOptions

MAX_RUN_ID = 10**6
A = f"<b class='tag' style='background:{css(REFERENCE)}'>A</b>"


class RunsPanel:
    """One row per run. A click on its name switches to it; a click on A makes it the reference for comparison."""

    def __init__(
        self,
        gui: viser.GuiApi,
        html_events: HtmlEvents,
        controller: Controller,
        page_state: PageState,
        residuals: ResidualHistory,
    ) -> None:
        self._scene, self._controller, self._page_state = controller.scene, controller, page_state
        self._residuals = residuals
        self._events = html_events.named(
            {
                "switch": integer(lambda n: controller.post(SwitchTo(n)), "run", 1, MAX_RUN_ID),
                "delete": integer(lambda n: controller.post(DeleteRun(n)), "run", 1, MAX_RUN_ID),
                "compare": integer(lambda n: self._refer_to(Reference(n)), "run", 1, MAX_RUN_ID),
                "mark": press(self.mark_now),
                "clear": press(lambda: self._refer_to(None)),
                "visit": press(self._visit),
                "race": press(self.compare_presets),
            }
        )
        self._errors: dict[int, tuple[int, str]] = {}
        self._other_racer: FairingOptions | None = None  # the run with which the presets are compared becomes A
        self._panel = HtmlPanel(gui)

    def mark_now(self) -> None:
        """Compare with the present moment from now on."""
        state = self._controller.state
        self._refer_to(Reference(state.run_id, state.moment))

    def _visit(self) -> None:
        compared = look_up(self._page_state.reference, self._controller.state)
        if compared is not None:
            self._controller.post(SwitchTo(compared.run.run_id, compared.moment))

    def compare_presets(self) -> None:
        """Run both presets from the start in turn; A becomes the run of the other one."""
        locked = self._controller.state.options.locked_vertices
        first, second = (replace(PRESETS[name], locked_vertices=locked) for name in ("paper", "accurate"))
        self._page_state.reference, self._other_racer = None, first
        self._controller.post(Pause())
        self._controller.post(Race(first, second))

    def _refer_to_other_racer(self, state: RunState) -> None:
        """Compare with the other run even where both were finished before, so that no state showed them racing."""
        others = [run for run in state.runs if run.options == self._other_racer and run.parent is None]
        if others and others[-1].run_id != state.run_id and self._page_state.reference is None:
            self._page_state.reference = Reference(others[-1].run_id)
        self._other_racer = None

    def _refer_to(self, reference: Reference | None) -> None:
        self._page_state.reference = reference
        self._controller.republish()

    def show(self, state: RunState, page_state: PageState) -> None:
        if self._other_racer is not None and not state.is_working:
            self._refer_to_other_racer(state)
        knows_truth = self._scene.truth is not None and self._scene.truth.vertices is not None
        error = (
            "<th class='n' title='RMS distance to the truth along directions the photos determine, % of the diagonal'>"
            "error</th>"
        )
        rows = "".join(self._row(run, state, page_state, knows_truth) for run in state.runs)
        self._panel.set(
            f"{self._comparison(state, page_state)}"
            f"<div class='scroll'><table class='runs'><tr><th>run</th><th>options</th>"
            "<th class='n' title='Recorded steps; so far: the run has not finished'>steps</th>"
            "<th class='n' title='Residual of the last recorded mesh at the finest level, grey levels: the same faces, photos and "
            "samples in all runs'>residual</th>"
            f"{error if knows_truth else ''}<th></th></tr>{rows}</table></div>"
        )

    def _comparison(self, state: RunState, page_state: PageState) -> str:
        race = button(
            "Compare presets",
            self._events("race"),
            hint="Compare presets (runs paper and accurate from the start, alternating)",
            css_class="small",
        )
        mark = button(
            "Set A here",
            self._events("mark"),
            hint="Set A here (C): compare with the current moment",
            css_class="small",
        )
        compared = look_up(page_state.reference, state)
        if compared is None:
            return f"<div class='row'><span class='grow dim'>Set {A} to compare with it.</span>{mark}{race}</div>"
        apart = 100 * distances(compared, state.vertices) / self._scene.mesh.diagonal
        clear = button("", self._events("clear"), hint="Stop comparing", icon=icon("leave"), css_class="small")
        back = button("", self._events("visit"), hint="Go to A", icon=icon("go"), css_class="small")
        figures = (
            f"Distance of the vertices from A: mean {_percent(apart.mean())}, max {_percent(apart.max())} of the diagonal "
            f"(vertex {int(apart.argmax())})"
        )
        return (
            f"<div class='row'><span class='grow one' title='{text(compared.name)}'>{A} {text(compared.name)}</span>"
            f"{back}{clear}{mark}{race}</div><div class='dim one' title='{text(figures)}'>{text(figures)}</div>"
        )

    def _row(self, run: RunInfo, state: RunState, page_state: PageState, knows_truth: bool) -> str:
        is_current = run.run_id == state.run_id
        is_reference = page_state.reference is not None and page_state.reference.run_id == run.run_id
        name = button(
            run.name,
            self._events("switch", run.run_id),
            hint=f"{run.name} is the current run" if is_current else f"Switch to {run.name}",
            css_class="small on" if is_current else "small",
            pressed=is_current,
        )
        compare = button(
            "A",
            self._events("compare", run.run_id),
            hint=f"Compare with {run.name} (with its last recorded step, as in this row)",
            css_class="small a" if is_reference else "small",
            pressed=is_reference,
        )
        remove = button(
            "",
            self._events("delete", run.run_id),
            hint=f"Delete {run.name}",
            icon=icon("leave"),
            css_class="small",
            enabled=len(state.runs) > 1,
        )
        fork = "" if run.parent is None else f"from run {run.parent} at moment {run.forked_at}: "
        found = self._residuals.of(run).by_moment.get(run.length)
        residual = "…" if found is None else number(found.mean, 4)
        error = f"<td class='n'>{self._error(run, state)}</td>" if knows_truth else ""
        return (
            f"<tr class='{'current' if is_current else ''}'><td>{name}</td>"
            f"<td class='what' title='{text(fork + run.differs)}'><span class='dim'>{text(fork)}</span>"
            f"{text(run.differs)}</td>"
            f"<td class='n'>{run.length}{'' if run.finished else '<span class=dim> so far</span>'}</td>"
            f"<td class='n'>{residual}</td>{error}<td><div class='row tools'>{compare}{remove}</div></td></tr>"
        )

    def _error(self, run: RunInfo, state: RunState) -> str:
        """Error of the last recorded mesh, as text. Not updated while the run moves: it is slow on large meshes."""
        known = self._errors.get(run.run_id)
        if (known is None or known[0] != run.length) and not state.is_moving:
            vertices = run.vertices if run.moment == run.length else run.trace.vertices_at(run.length)
            percent = vertex_errors(self._scene, vertices).determined.percent
            known = (run.length, _percent(np.sqrt((percent**2).mean())))
            self._errors[run.run_id] = known
        return known[1] if known else "…"


def _percent(value: float) -> str:
    return f"{number(float(value), 3)} %"

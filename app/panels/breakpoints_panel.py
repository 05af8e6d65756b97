"""Breakpoints panel: the list of breakpoints, a text field for a new condition, and common conditions."""

from collections.abc import Callable, Iterable
from dataclasses import replace

import viser

from app.debugger.breakpoints import Breakpoint
from app.debugger.controller import Controller
from app.debugger.quantities import limits_of
from app.debugger.run_state import RunState
from app.html import button, icon, text
from app.page_state.page_state import PageState
from app.panels.condition_field import ConditionField, words_for
from app.viser_bridge.completion import insert_into
from app.viser_bridge.html_events import HtmlEvents, choice_of, integer, press
from app.viser_bridge.html_panel import HtmlPanel
from fairing.run.recorded_terms import term_meanings

READY_MADE: dict[str, str] = {
    "A step is rejected": "rejected > 0",
    "The energy is stuck": "abs(percent) < 0.01",
    "A vertex is underconstrained": "weakest < 0.01",
    "A step is longer than 2 px": "step_px > 2",
    "Visible faces change": "seen_changes > 0",
    "A judge takes vertices back": "stage(judge) and accepted > 0",
    "A level begins": "sweep == 1 and unit == 1 and iteration == 1",
}

FIELD = "Stop when"
MAX_NUMBER = 10**6


def ready_made(page_state: PageState) -> dict[str, str]:
    """Common conditions by their label: for the selected vertex, for the photo looked through, and for any run."""
    about = {}
    if page_state.selected is not None:
        about |= {
            f"Vertex {page_state.selected} moves 1 px from here": f"travelled({page_state.selected}) > 1",
            f"A step solves for vertex {page_state.selected}": f"about({page_state.selected})",
            f"Photos decide little at vertex {page_state.selected}": f"share(photos, {page_state.selected}) < 0.2",
        }
    if page_state.entered is not None:
        about |= {
            f"The energy rises in photo {page_state.entered + 1}": f"view({page_state.entered + 1}) > 0",
            f"Photo {page_state.entered + 1} has 30 % outliers": f"outliers({page_state.entered + 1}) > 0.3",
        }
    return about | READY_MADE


class BreakpointsPanel:
    """Conditions are typed or chosen from a list. Each can be disabled, turned into a logpoint, or removed."""

    def __init__(
        self,
        gui: viser.GuiApi,
        html_events: HtmlEvents,
        controller: Controller,
        page_state: PageState,
    ) -> None:
        self._controller, self._limits = controller, limits_of(controller.scene)
        self._events = html_events.named(
            {
                "add": press(lambda: self._field.enter_draft()),
                "switch": integer(self._switch, "breakpoint", 1, MAX_NUMBER),
                "report": integer(self._report, "breakpoint", 1, MAX_NUMBER),
                "remove": integer(self._remove, "breakpoint", 1, MAX_NUMBER),
                "ready_made": choice_of(
                    self._add_ready_made, lambda: list(ready_made(page_state).values()), "condition"
                ),
            }
        )
        hint = "A condition on the recorded values of a step, such as rejected > 0. Enter adds it."
        self._field = ConditionField(gui, html_events, FIELD, hint, self._add)
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, page_state: PageState) -> None:
        rows = "".join(self._row(item) for item in state.breakpoints)
        ready = "".join(
            button(name, self._events("ready_made", k), hint=f"Stop when {condition}", css_class="layer")
            for k, (name, condition) in enumerate(ready_made(page_state).items())
        )
        terms = term_meanings(state.trace)
        self._field.show(page_state, terms)
        words = "".join(
            f"<tr><th>{button(word, insert_into(FIELD, word), hint=f'Insert {word}', css_class='link')}</th>"
            f"<td>{text(meaning)}</td></tr>"
            for word, meaning in words_for(page_state, terms)
        )
        log = "".join(f"<div class='dim'>{text(line)}</div>" for line in state.log[-8:])
        add = button("Add", self._events("add"), hint="Add this breakpoint (Enter)", css_class="grow")
        self._panel.set(
            f"<div class='row'>{add}</div>"
            f"<div class='note'>{rows or '<span class=dim>No breakpoints yet.</span>'}</div>"
            + (f"<h4>Log</h4>{log}" if log else "")
            + f"<h4>Common conditions</h4><div class='stack'>{ready}</div><h4>Names in conditions</h4>"
            f"<table class='words'>{words}</table>"
        )

    def _row(self, item: Breakpoint) -> str:
        number = str(item.number)
        state = "on" if item.enabled else "off"
        switch = button(
            "",
            self._events("switch", item.number),
            hint=f"Breakpoint {number} is {state}",
            icon="<span aria-hidden='true'>●</span>",
            css_class=f"dot {state}",
            pressed=item.enabled,
        )
        report = button(
            "log" if item.logs else "stop",
            self._events("report", item.number),
            hint="Stop the run or only log",
            css_class="small",
        )
        remove = button(
            "",
            self._events("remove", item.number),
            hint="Remove this breakpoint",
            icon=icon("leave"),
            css_class="small",
        )
        return (
            f"<div class='row breakpoint'>{switch}<code class='grow'>{text(item.condition.text)}</code>"
            f"<span class='dim'>{item.hits} ×</span>{report}{remove}</div>"
        )

    def _add(self, written: str, terms: Iterable[str]) -> None:
        self._controller.edit_breakpoints(lambda all_of_them: all_of_them.added(written, self._limits, terms))

    def _add_ready_made(self, condition: str) -> None:
        self._controller.edit_breakpoints(lambda b: b.added(condition))

    def _switch(self, number: int) -> None:
        self._change(number, lambda item: replace(item, enabled=not item.enabled))

    def _report(self, number: int) -> None:
        self._change(number, lambda item: replace(item, logs=not item.logs))

    def _change(self, number: int, change: Callable[[Breakpoint], Breakpoint]) -> None:
        self._controller.edit_breakpoints(lambda b: b.changed(number, change))

    def _remove(self, number: int) -> None:
        self._controller.edit_breakpoints(lambda b: b.removed(number))

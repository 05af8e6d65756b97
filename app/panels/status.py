"""Status: the position in the schedule, the outcome of the last step, and the energy."""

from collections.abc import Callable

import viser

from app.debugger.commands import Extent
from app.debugger.history import EnergyHistory
from app.debugger.moment_id import moment_id
from app.debugger.run_state import Activity, RunState
from app.debugger.step_text import step_outcome
from app.html import copy_button, number, text
from app.page_state.page_state import PageState
from app.viser_bridge.html_panel import HtmlPanel


class Status:
    """A few lines that stay visible while the column scrolls."""

    def __init__(self, gui: viser.GuiApi, energies: EnergyHistory, to_beginning: Callable[[str], str]) -> None:
        """
        Args:
            to_beginning: JavaScript that goes to the beginning of an extent, given its number.
        """
        self._panel = HtmlPanel(gui)
        self._energies, self._to_beginning = energies, to_beginning

    def show(self, state: RunState, page_state: PageState) -> None:
        record = state.record
        outcome = "no step yet" if record is None else step_outcome(record)
        last, line, color = f"Last step: {outcome}", _reason(state, outcome), _reason_color(state)
        bar = f"<div class='bar'><div style='width:{100 * state.progress:.1f}%'></div></div>"
        if state.is_working:
            line, color = state.work.line if state.work is not None else "\u00a0", "working"
            if state.waiting:
                last = f"Next: {', '.join(state.waiting)}"
            if state.work is not None and state.work.fraction is not None:
                done = f"{100 * state.work.fraction:.1f}"
                bar = f"<div class='bar work' role='progressbar' aria-label='{text(line)}' aria-valuenow='{done}'>" \
                      f"<div style='width:{done}%'></div></div>"  # fmt: skip
        self._panel.set(
            f"<div class='pinned'><div class='row'><span class='big'>{_headline(state, page_state)}</span>"
            f"<span class='grow'></span><span class='dim'>{_speed(state)}</span></div>"
            f"<div class='crumbs row'>{self._crumbs(state)}</div>"
            f"<div>{self._energy(state)}</div>"
            f"<div class='dim one' title='{text(last)}'>{text(last)}</div>"
            f"<div class='{color} one' title='{text(line)}'>{text(line)}</div>{bar}</div>"
        )

    def _crumbs(self, state: RunState) -> str:
        """Position of the next step in the schedule; of the last step when finished. A click goes to the beginning of a
        level, sweep or unit."""
        levels = state.options.n_levels
        at = state.position
        if at.level >= levels:
            if state.record is None:
                return "nothing to do"
            at = state.record.position
        blur = state.options.schedule.blur[at.level]
        parts = [
            self._crumb(Extent.LEVEL, "level", f"{at.level + 1}/{levels}", f" <span class='dim'>σ {blur:g} px</span>"),
            self._crumb(Extent.SWEEP, "sweep", str(at.sweep + 1)),
        ]
        if state.options.schedule.order != "joint":
            parts.append(self._crumb(Extent.BLOCK, "unit", str(at.block + 1)))
        parts.append(f"<span class='part'>iteration <b>{at.iteration + 1}</b></span>")
        here = moment_id(state.position, state.moment, levels)
        copy = copy_button(here, f"Copy the name of this moment, {here} (for --at)")
        return f"{'<i>›</i>'.join(parts)}<span class='grow'></span>{copy}"

    def _crumb(self, extent: Extent, name: str, count: str, more: str = "") -> str:
        press = text(self._to_beginning(str(int(extent))))
        hint = f"To the beginning of this {name}"
        return f'<button type="button" title="{hint}" onclick="{press}">{name} <b>{count}</b>{more}</button>'

    def _energy(self, state: RunState) -> str:
        if state.moment == 0:
            return "Energy <span class='dim'>not measured yet</span>"
        before, after = float(self._energies.before[state.moment - 1]), float(self._energies.after[state.moment - 1])
        change = after - before
        percent = 100 * change / before if before else 0.0
        color = "start" if change < 0 else ("dim" if change == 0 else "rejected")
        return (
            f"Energy <b>{number(after, 6)}</b> <span class='{color}'>{_signed(change)} ({_signed(percent, 3)} %)</span>"
        )


def _headline(state: RunState, page_state: PageState) -> str:
    if page_state.viewed_moment is not None:
        return f"Running · showing moment {page_state.viewed_moment}"
    if state.activity is Activity.PAUSED and state.finished:
        return "Finished"
    return state.activity.value.capitalize()


def _reason(state: RunState, outcome: str) -> str:
    """Why the run stopped, unless the outcome of the last step says it already."""
    return "\u00a0" if state.reason == outcome else _sentence(state.reason)


def _reason_color(state: RunState) -> str:
    return "selected" if state.reason.startswith("breakpoint") else "rejected" if state.problem else "dim"


def _speed(state: RunState) -> str:
    if state.step_seconds <= 0:
        return ""
    if state.step_seconds < 1:
        return f"{1 / state.step_seconds:.3g} steps/s"
    return f"{state.step_seconds:.2g} s/step"


def _sentence(line: str) -> str:
    return line[:1].upper() + line[1:]


def _signed(value: float, digits: int = 4) -> str:
    return ("+" if value > 0 else "") + number(value, digits)

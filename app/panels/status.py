"""Where the run is, what the last step did, and how the energy stands."""

import viser

from app.history import EnergyHistory
from app.html import number, text
from app.outcome import step_outcome
from app.panels.html_panel import HtmlPanel
from app.run_state import Activity, RunState
from app.view import View


class Status:
    """A few lines that are always in sight."""

    def __init__(self, gui: viser.GuiApi, energies: EnergyHistory) -> None:
        self._panel = HtmlPanel(gui)
        self._energies = energies

    def show(self, state: RunState, view: View) -> None:
        record = state.record
        outcome = "no step yet" if record is None else step_outcome(record)
        reason = "\u00a0" if state.is_moving or state.reason == outcome else _sentence(state.reason)
        color = "selected" if state.reason.startswith("breakpoint") else "rejected" if state.problem else "dim"
        self._panel.set(
            f"<div class='row'><span class='big'>{_headline(state)}</span><span class='grow'></span>"
            f"<span class='dim'>{_speed(state)}</span></div>"
            f"<div class='crumbs'>{_crumbs(state)}</div>"
            f"<div>{self._energy(state)}</div>"
            f"<div class='dim one'>Last step: {text(outcome)}</div><div class='{color} one'>{text(reason)}</div>"
            f"<div class='bar'><div style='width:{100 * state.progress:.1f}%'></div></div>"
        )

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


def _headline(state: RunState) -> str:
    if state.activity is Activity.RUNNING:
        return "Running"
    if state.activity is Activity.PLAYING:
        return "Playing"
    if state.activity is Activity.STEPPING:
        return "Stepping"
    return "Finished" if state.finished else "Paused"


def _crumbs(state: RunState) -> str:
    """Where the next step belongs; when finished, where the last one did."""
    levels = len(state.options.schedule.blur)
    at = state.position
    if at.level >= levels:
        if state.record is None:
            return "nothing to do"
        at = state.record.position
    blur = state.options.schedule.blur[at.level]
    parts = [
        f"level <b>{at.level + 1}/{levels}</b> <span class='dim'>σ {blur:g} px</span>",
        f"sweep <b>{at.sweep + 1}</b>",
    ]
    if state.options.schedule.order != "joint":
        parts.append(f"unit <b>{at.unit + 1}</b>")
    parts.append(f"iteration <b>{at.iteration + 1}</b>")
    return "<i>›</i>".join(parts)


def _speed(state: RunState) -> str:
    if state.step_seconds <= 0:
        return ""
    if state.step_seconds < 1:
        return f"{1 / state.step_seconds:.3g} steps/s"
    return f"{state.step_seconds:.2g} s a step"


def _sentence(line: str) -> str:
    return line[:1].upper() + line[1:]


def _signed(value: float, digits: int = 4) -> str:
    return ("+" if value > 0 else "") + number(value, digits)

"""Status: the position in the schedule, the outcome of the last step, and the energy."""

import re
from collections.abc import Callable

import viser

from app.debugger.actions import BLOCK_NAMES
from app.debugger.commands import Extent
from app.debugger.history import EnergyHistory
from app.debugger.moment_id import moment_id
from app.debugger.run_state import Activity, RunState
from app.debugger.step_text import step_outcome
from app.html import copy_button, number, text
from app.page_state.page_state import PageState
from app.viser_bridge.html_panel import HtmlPanel
from fairing.cells.level_choice import first_fine_level, level_for_error
from fairing.run.phases import schedule_of
from fairing.trace import SchedulePosition

_COUNT = re.compile(r"[,:] (\w+ )?\d+ of \d+$")


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
        last, line, color, left = f"Last step: {outcome}", _reason(state, outcome), _reason_color(state), ""
        bar = f"<div class='bar'><div style='width:{100 * state.progress:.1f}%'></div></div>"
        if state.is_working or state.work is not None:
            line, color = "\u00a0", "working"
            if state.work is not None:
                line, left = state.work.sentence, state.work.time
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
            f"<div class='row'><span class='one grow'>{self._energy(state)}</span>{_blur(state)}</div>"
            f"<div class='dim one' title='{text(last)}'>{text(last)}</div>"
            f"<div class='row'><span class='{color} grow work-line' title='{text(line)}'>{_work_line(line)}</span>"
            f"<span class='dim' style='flex:none'>{text(left)}</span></div>{bar}</div>"
        )

    def _crumbs(self, state: RunState) -> str:
        """Position of the next step in the schedule; of the last step when finished. A click goes to the beginning of a
        level, sweep or block."""
        at, levels = _shown_position(state), state.options.n_levels
        if at is None:
            return "nothing to do"
        parts = [
            self._crumb(Extent.LEVEL, "level", f"level <b>{at.level + 1}/{levels}</b>"),
            self._crumb(Extent.SWEEP, "sweep", f"sweep <b>{at.sweep + 1}</b>"),
        ]
        order = state.options.schedule.order
        if order != "joint":
            block = BLOCK_NAMES[order]
            # An ordinal, since a number after the word would be read as that of the vertex.
            parts.append(self._crumb(Extent.BLOCK, block, f"<b>{_ordinal(at.block + 1)}</b> {block}"))
        parts.append(f"<span class='part'>iteration <b>{at.iteration + 1}</b></span>")
        here = moment_id(state.position, state.moment, levels)
        copy = copy_button(here, f"Copy the name of this moment, {here} (for --at)")
        return f"{'<i>›</i>'.join(parts)}<span class='grow'></span>{copy}"

    def _crumb(self, extent: Extent, name: str, content: str) -> str:
        press = text(self._to_beginning(str(int(extent))))
        return f'<button type="button" title="To the beginning of this {name}" onclick="{press}">{content}</button>'

    def _energy(self, state: RunState) -> str:
        if state.record is None or len(state.record.faces) == 0:
            return "Energy <span class='dim'>not measured yet</span>"
        before, after = float(self._energies.before[state.moment - 1]), float(self._energies.after[state.moment - 1])
        change = after - before
        percent = 100 * change / before if before else 0.0
        share = "&lt;\u20090.01" if 0 < abs(percent) < 0.01 else _signed(percent, 3)
        color = "start" if change < 0 else ("dim" if change == 0 else "rejected")
        return f"Energy <b>{number(after, 6)}</b> <span class='{color}'>{_signed(change)} ({share} %)</span>"


def _shown_position(state: RunState) -> SchedulePosition | None:
    """The position of the next step, of the last step when finished; None if there is neither."""
    if state.position.level < state.options.n_levels:
        return state.position
    return None if state.record is None else state.record.position


def _blur(state: RunState) -> str:
    """Blur of the current level: energies compare only within one."""
    at = _shown_position(state)
    if at is None:
        return ""
    hint = "Blur of the photos at this level: standard deviation in photo pixels"
    return f"<span class='dim' style='flex:none' title='{hint}'>σ {state.options.schedule.blur[at.level]:g} px</span>"


def _ordinal(count: int) -> str:
    """1st, 2nd, 3rd, 4th, 11th, 21st."""
    suffix = "th" if count % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(count % 10, "th")
    return f"{count}{suffix}"


def _headline(state: RunState, page_state: PageState) -> str:
    if page_state.viewed_moment is not None:
        return f"Running · showing moment {page_state.viewed_moment}"
    if state.activity is Activity.PAUSED and state.finished:
        return "Finished"
    return state.activity.value.capitalize()


def _work_line(line: str) -> str:
    """Markup: a line that ends in an ellipsis where it is too long, but keeps the count at its end, such as ", 4 of 15"."""
    count = _COUNT.search(line)
    words = line if count is None else line[: count.start()]
    return f"<span>{text(words)}</span>{'' if count is None else f'<span>{text(count.group())}</span>'}"


def _reason(state: RunState, outcome: str) -> str:
    """Why the run stopped; where the outcome of the last step says it already, why the run began at its level."""
    return begin_note(state) if state.reason == outcome else _sentence(state.reason.removeprefix("finished: "))


def begin_note(state: RunState) -> str:
    """Why a run skips coarse levels, by its plan; blank if it skips none or is not planned yet."""
    plan, options = state.trace.plan, state.options
    begin = 0 if plan is None else schedule_of(options, plan).begin_level
    if plan is None or begin == 0:
        return "\u00a0"
    error = plan.start_error or plan.start_sigma
    if plan.is_near_truth:
        why = "the start is near the truth"
    elif plan.represents_surface and begin == options.n_levels - 1:
        why = "the start is near its points"
    elif plan.is_fitted_to_points and begin == first_fine_level(options):
        why = "the start fits its points"
    elif error > 0 and level_for_error(error, options) == begin:
        why = f"the start is about {number(error, 2)} px off"
    else:
        why = "its blur suits the face size"
    return f"Begins at level {begin + 1}: {why}"


def _reason_color(state: RunState) -> str:
    return "selected" if state.reason.startswith("breakpoint") else "rejected" if state.problem else "dim"


def _speed(state: RunState) -> str:
    if state.step_seconds <= 0:
        return ""
    if state.step_seconds < 1:
        return f"{1 / state.step_seconds:.3g} steps/s"
    return f"{number(state.step_seconds, 2)} s/step"


def _sentence(line: str) -> str:
    return line[:1].upper() + line[1:]


def _signed(value: float, digits: int = 4) -> str:
    return ("+" if value > 0 else "") + number(value, digits)

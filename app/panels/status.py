"""Status: the position in the schedule, the outcome of the last step, and the residual."""

import re
from collections.abc import Callable

import numpy as np
import viser

from app.debugger.actions import BLOCK_NAMES
from app.debugger.commands import Extent
from app.debugger.history import EnergyHistory
from app.debugger.moment_id import moment_id
from app.debugger.residual_history import ResidualHistory
from app.debugger.run_state import Activity, RunState
from app.debugger.stage_text import blur_text, stage_line, sweep_word
from app.debugger.step_text import step_outcome
from app.html import button, copy_button, number, text
from app.page_state.page_state import PageState
from app.palette import css
from app.pictures.stage_colors import COLOR_OF_STAGE
from app.viser_bridge.html_panel import HtmlPanel
from fairing.cells.level_choice import first_fine_level
from fairing.run.recorded_stages import stage_keys
from fairing.trace import SchedulePosition

_COUNT = re.compile(r"[,:] (\w+ )?\d+ of \d+$")


class Status:
    """A few lines that stay visible while the column scrolls."""

    def __init__(
        self,
        gui: viser.GuiApi,
        energies: EnergyHistory,
        residuals: ResidualHistory,
        to_beginning: Callable[[str], str],
        go_to: Callable[[str], str],
        show_result: str,
    ) -> None:
        """
        Args:
            to_beginning: JavaScript that goes to the beginning of an extent, given its number.
            go_to: JavaScript that goes to a moment, given its number.
            show_result: JavaScript that shows the result of the run.
        """
        self._panel = HtmlPanel(gui)
        self._energies, self._residuals = energies, residuals
        self._to_beginning, self._go_to, self._show_result = to_beginning, go_to, show_result

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
            f"{self._stage(state)}{self._result(state, page_state)}</div>"
            f"<div class='crumbs row'>{self._crumbs(state)}</div>"
            f"<div class='row'><span class='one grow'>{self._residual(state)}</span>"
            f"<span class='dim speed' style='flex:none'>{_speed(state)}</span></div>"
            f"<div class='dim one' title='{text(last)}'>{text(last)}</div>"
            f"<div class='row'><span class='{color} grow work-line' title='{text(line)}'>{_work_line(line)}</span>"
            f"<span class='dim' style='flex:none'>{text(left)}</span></div>{bar}</div>"
        )

    def _result(self, state: RunState, page_state: PageState) -> str:
        """A button to the result of a finished run, while a selected vertex takes its place."""
        if state.is_working or not state.finished or page_state.selected is None:
            return ""
        return button(
            "Result", self._show_result, hint="Result of the run: did it help? (deselects)", css_class="small"
        )

    def _crumbs(self, state: RunState) -> str:
        """Position of the next step in the schedule; of the last step when finished. A click goes to the beginning of a
        level, sweep or block."""
        at, levels = _shown_position(state), state.options.n_levels
        if at is None:
            return "nothing to do"
        parts = [
            self._crumb(Extent.LEVEL, "level", f"level <b>{at.level + 1}/{levels}</b>"),
            self._crumb(Extent.SWEEP, "sweep", f"{sweep_word(state.next_stage)} <b>{self._sweep_in_stage(state)}</b>"),
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

    def _stage(self, state: RunState) -> str:
        """The stage of the last step, and what the step is in it; at the start the blur of the photos."""
        if state.record is None:
            hint = "Blur of the photos at this level: standard deviation in photo pixels"
            blur = blur_text(state.position.level, state.options) if _shown_position(state) else ""
            return f"<span class='grow'></span><span class='dim' title='{hint}'>{blur and f'σ {blur}'}</span>"
        progress = self._energies.stage_progress(state.moment - 1, state.length)
        line = text(stage_line(state.record, progress, state.options))
        color = css(COLOR_OF_STAGE[state.record.stage])
        press = text(self._go_to(str(progress.stage.begin)))
        return (
            f"<button type='button' class='in-stage grow' title='{line}. To the beginning of this stage' onclick=\"{press}\">"
            f"<i class='swatch' style='background:{color}'></i><span class='one'>{line}</span></button>"
        )

    def _sweep_in_stage(self, state: RunState) -> int:
        """Number of the sweep of the next step within its stage, from 1; of the last step when finished."""
        record = state.record
        if state.moment < state.length:
            return self._energies.stage_progress(state.moment, state.length).sweep
        if record is None:
            return 1
        last = self._energies.stage_progress(state.moment - 1, state.length)
        if state.next_stage is None:
            return last.sweep
        key_of = stage_keys(state.trace)
        if key_of(state.next_stage, state.position) != key_of(record.stage, record.position):
            return 1
        return last.sweep + (state.position.sweep != record.position.sweep)

    def _crumb(self, extent: Extent, name: str, content: str) -> str:
        press = text(self._to_beginning(str(int(extent))))
        return f'<button type="button" title="To the beginning of this {name}" onclick="{press}">{content}</button>'

    def _residual(self, state: RunState) -> str:
        """The residual at the finest level, its change since the start, and as a hint what the last step minimized."""
        hint, found = self._step(state), self._residuals.of(state)
        if found.why_not:
            return f"<span title='{text(hint)}'>Residual <span class='dim'>not measured: {text(found.why_not)}</span></span>"
        known, start = found.up_to(state.moment), found.by_moment.get(0)
        if known is None or not np.isfinite(known[1]):
            line = "no face is seen by three photos"
            if known is None:
                is_paused = state.activity is Activity.PAUSED
                line = "is being measured" if is_paused else "is measured when the run pauses"
            return f"<span title='{text(hint)}'>Residual <span class='dim'>{line}</span></span>"
        moment, value = known
        unit = "grey levels" if moment == state.moment else f"at moment {moment}"
        change = ""
        if start is not None and moment > 0 and start.mean > 0:
            percent = 100 * (value / start.mean - 1)
            color = "start" if percent < 0 else "dim" if percent == 0 else "rejected"
            change = f" <span class='{color}'>{_signed(percent, 3)} %</span>"
            hint = f"{_signed(percent, 3)} % since the start. {hint}"
        return f"<span title='{text(hint)}'>Residual <b>{number(value, 4)}</b> <span class='dim'>{unit}</span>{change}</span>"

    def _step(self, state: RunState) -> str:
        """What the last step minimized; it compares with nothing but the other steps of its sweep."""
        record, what = state.record, "Sweep energy"
        if record is not None and record.stage.is_fit and len(record.faces) == 0:
            what, before, after = "Objective of the fit", record.objective_before, record.objective_after
        elif record is None or len(record.faces) == 0:
            return f"Sweep energy: not measured {'yet' if record is None else 'in this step'}"
        else:
            before, after = (float(curve[state.moment - 1]) for curve in (self._energies.before, self._energies.after))
        change = after - before
        percent = 100 * change / before if before else 0.0
        share = "<\u20090.01" if 0 < abs(percent) < 0.01 else _signed(percent, 3)
        return (
            f"{what} {number(after, 6)}, {_signed(change, 4)} ({share} %) by the last step; compares within its sweep"
        )


def _shown_position(state: RunState) -> SchedulePosition | None:
    """The position of the next step, of the last step when finished; None if there is neither."""
    if state.position.level < state.options.n_levels:
        return state.position
    return None if state.record is None else state.record.position


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
    """Why a run skips coarse levels, by its plan, or that the plan is the user's; blank if it skips none or is not planned yet."""
    plan, options = state.trace.plan, state.options
    if plan is not None and plan.stages:
        return f"Plan of your own: {len(plan.stages)} stage{'s' if len(plan.stages) > 1 else ''}"
    begin = 0 if plan is None else plan.first_level
    if plan is None or begin == 0:
        return "\u00a0"
    if plan.represents_surface and begin == options.n_levels - 1:
        why = "the start is near its points"
    elif plan.is_fitted_to_points and begin == first_fine_level(options):
        why = "the start fits its points"
    else:
        why = "its blur suits the face size"
    return f"Begins at level {begin + 1}: {why}"


def _reason_color(state: RunState) -> str:
    return "selected" if state.reason.startswith("breakpoint") else "rejected" if state.problem else "dim"


def _speed(state: RunState) -> str:
    of_fit = state.record is not None and state.record.stage.is_fit
    if state.activity is Activity.PAUSED or state.step_seconds <= 0 or of_fit:
        return ""  # steps of fits are fast, and their number says little
    if state.step_seconds < 1:
        return f"{number(1 / state.step_seconds, 2)} steps/s"
    return f"{number(state.step_seconds, 2)} s/step"


def _sentence(line: str) -> str:
    return line[:1].upper() + line[1:]


def _signed(value: float, digits: int = 4) -> str:
    return ("+" if value > 0 else "") + number(value, digits)

"""The energy over the record as a picture that can be clicked: a line a sweep, a dot where the run stands.

Drawn as SVG, because the plots that viser offers know no gaps between lines and report no clicks.
"""

from collections.abc import Callable

import numpy as np
import viser

from app.history import EnergyHistory
from app.html import number, text
from app.palette import NOW, SELECTED, css
from app.panels.html_panel import HtmlPanel
from app.run_state import RunState
from app.view import View

WIDTH, HEIGHT = 312, 138
LEFT, RIGHT, TOP, BOTTOM = 46, 6, 8, 18
MAX_POINTS = 400


class EnergyPlot:
    """Every sweep has a line of its own, because its cells are its own and so energies of two sweeps do not compare."""

    def __init__(self, gui: viser.GuiApi, energies: EnergyHistory, jump: Callable[[str], str]) -> None:
        self._energies, self._jump = energies, jump
        self._panel = HtmlPanel(gui)
        self._shown = (-1, -1, -1)

    def show(self, state: RunState, view: View) -> None:
        key = (state.run_id, state.length, state.moment)
        if key != self._shown:
            self._shown = key
            self._panel.set(self._picture(state) if state.length else _empty())

    def _picture(self, state: RunState) -> str:
        before, after = self._energies.before[: state.length], self._energies.after[: state.length]
        levels = self._energies.levels[: state.length]
        low, high = float(min(before.min(), after.min())), float(max(before.max(), after.max()))
        margin = 0.05 * (high - low) or abs(high) or 1.0
        low, high = max(0.0, low - margin), high + margin

        def x(moment: np.ndarray | float) -> np.ndarray:
            return LEFT + (WIDTH - LEFT - RIGHT) * np.asarray(moment) / state.length

        def y(energy: np.ndarray | float) -> np.ndarray:
            return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (np.asarray(energy) - low) / (high - low)

        parts = [_frame(low, high, y)]
        for first, end in _runs(levels):
            blur = state.options.schedule.blur[levels[first]]
            parts.append(_band(float(x(first)), float(x(end)), f"σ {blur:g}", first > 0))
        for first, end in _runs(self._energies.sweeps[: state.length]):
            steps = np.unique(np.linspace(first, end - 1, min(end - first, MAX_POINTS)).astype(int))
            moments = np.concatenate([[first], steps + 1])
            values = np.concatenate([[before[first]], after[steps]])
            past = moments <= state.moment
            if not past.all():
                parts.append(_line(x(moments), y(values), css(NOW, 0.35)))
            if past.any():
                parts.append(_line(x(moments[past]), y(values[past]), css(NOW)))
        here = float(after[state.moment - 1] if state.moment else before[0])
        parts.append(f'<circle cx="{x(state.moment):.1f}" cy="{y(here):.1f}" r="4" fill="{css(SELECTED)}"/>')
        inner = WIDTH - LEFT - RIGHT
        fraction = f"(event.clientX-r.left)/r.width*{WIDTH}-{LEFT}"
        press = (
            "var r=this.getBoundingClientRect();"
            f"var m=Math.max(0,Math.min({state.length},Math.round(({fraction})/{inner}*{state.length})));"
            + self._jump("m")
        )
        # Not onclick: while a run redraws the plot, pressing and letting go may hit two different pictures.
        return (
            f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" class="plot" role="img" aria-label="Energy plot" '
            f'onpointerdown="{text(press)}">'
            f"<title>Energy by moment; click to go there</title>{''.join(parts)}</svg>"
        )


def _empty() -> str:
    return f'<div class="plot dim" style="height:{HEIGHT}px">The energy appears here with the first step.</div>'


def _frame(low: float, high: float, y: Callable[[float], np.ndarray]) -> str:
    lines = []
    for value in _ticks(low, high):
        at = float(y(value))
        lines.append(f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{at:.1f}" y2="{at:.1f}" stroke="var(--line)"/>')
        lines.append(f'<text x="{LEFT - 6}" y="{at + 3.5:.1f}" text-anchor="end">{number(value, 3)}</text>')
    return "".join(lines)


def _ticks(low: float, high: float) -> np.ndarray:
    """Two to four round numbers within an interval."""
    rough = (high - low) / 3
    power = 10 ** np.floor(np.log10(rough))
    step = power * min((1, 2, 5, 10), key=lambda factor: abs(factor * power - rough))
    return np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step


def _band(left: float, right: float, label: str, has_border: bool) -> str:
    line = f'x1="{left:.1f}" x2="{left:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"'
    border = f'<line {line} stroke="var(--faint)" stroke-dasharray="2 3"/>'
    name = f'<text x="{(left + right) / 2:.1f}" y="{HEIGHT - 5}" text-anchor="middle">{text(label)}</text>'
    return (border if has_border else "") + (name if right - left > 30 else "")


def _line(x: np.ndarray, y: np.ndarray, color: str) -> str:
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    return f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="2" stroke-linejoin="round"/>'


def _runs(values: np.ndarray) -> list[tuple[int, int]]:
    """First index and end of every run of equal values."""
    begins = np.flatnonzero(np.diff(values, prepend=values[0] - 1)).tolist()
    return list(zip(begins, [*begins[1:], len(values)], strict=True))

"""SVG elements of a plot over moments: frame, level bands and lines."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.debugger.series import thinned
from app.html import text
from app.palette import RGB, SELECTED, css
from app.plot_line import Line
from app.ticks import log_ticks, tick_labels, ticks

WIDTH, HEIGHT = 312, 132
LEFT, RIGHT, TOP, BOTTOM = 46, 6, 8, 18
MARGIN = 0.05  # of the range of values, above and below them
LETTER = 5.6  # width of a letter of a label, at most
MOST_POINTS = 40
ZERO_BELOW = 0.15  # of the height: room for the label of zero


@dataclass(frozen=True, eq=False)
class Scale:
    """Scale of the values of a plot, linear or logarithmic.

    Attributes:
        low, high: ends of the scale: values, or exponents of ten on a log scale.
        marks: (k,) float: values of the grid lines.
        zero: where a log scale draws zeros, an exponent; -inf if there are none.
    """

    is_log: bool
    low: float
    high: float
    marks: np.ndarray
    zero: float

    def heights(self, values: np.ndarray | float) -> np.ndarray:
        """Heights of values (n,) in the plot, 0 at the bottom to 1 at the top."""
        heights = np.asarray(values, dtype=float)
        if self.is_log:
            heights = np.where(heights > 0, np.log10(np.where(heights > 0, heights, 1.0)), self.zero)
        return (heights - self.low) / (self.high - self.low)


def value_scale(values: np.ndarray, is_log: bool) -> Scale:
    """The scale that shows values (n,), n > 0; linear if none of them is positive.

    On a log scale zeros have a line of their own below the positive values.
    """
    positive = values[values > 0]
    if not is_log or len(positive) == 0:
        low, high = float(values.min()), float(values.max())
        margin = MARGIN * (high - low) or abs(high) or 1.0
        low, high = (low - margin if low < 0 else max(0.0, low - margin)), high + margin
        return Scale(False, low, high, ticks(low, high), -np.inf)
    low, high = float(np.log10(positive.min())), float(np.log10(positive.max()))
    margin = MARGIN * (high - low) or 0.5
    low, high = low - margin, high + margin
    marks = log_ticks(low, high)
    if len(positive) == len(values):
        return Scale(True, low, high, marks, -np.inf)
    zero = low - ZERO_BELOW * (high - low)
    return Scale(True, zero, high, np.append(0.0, marks), zero)


def frame(values: np.ndarray, y: Callable[[float], np.ndarray]) -> str:
    """Horizontal grid lines with labels at `values` (n,); `y` maps a value to SVG px."""
    lines = []
    for value, label in zip(values, tick_labels(values), strict=True):
        at = float(y(value))
        lines.append(f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{at:.1f}" y2="{at:.1f}" stroke="var(--line)"/>')
        lines.append(f'<text x="{LEFT - 6}" y="{at + 3.5:.1f}" text-anchor="end">{label}</text>')
    return "".join(lines)


def band(left: float, right: float, label: str, color: RGB, *, is_empty: bool, has_border: bool) -> str:
    """A stage between two x positions, SVG px: its label if there is room, a line in its colour, and its left border.

    Args:
        is_empty: whether the plot has no values in it; then its ground is tinted, so that a gap does not look like a fault.
    """
    bottom, width = HEIGHT - BOTTOM, right - left
    line = f'x1="{left:.1f}" x2="{left:.1f}" y1="{TOP}" y2="{bottom}"'
    border = f'<line {line} stroke="var(--faint)" stroke-dasharray="2 3"/>'
    name = f'<text x="{(left + right) / 2:.1f}" y="{HEIGHT - 4}" text-anchor="middle">{text(label)}</text>'
    foot = f'<rect x="{left:.1f}" y="{bottom}" width="{max(1.0, width):.1f}" height="3" fill="{css(color)}"/>'
    ground = f'<rect x="{left:.1f}" y="{TOP}" width="{width:.1f}" height="{bottom - TOP}" fill="{css(color, 0.12)}"/>'
    has_room = width > LETTER * len(label) + 6
    return (ground if is_empty else "") + (border if has_border else "") + foot + (name if has_room else "")


def line_at(
    line: Line,
    moment: int,
    x: Callable[[np.ndarray], np.ndarray],
    y: Callable[[np.ndarray], np.ndarray],
    length: int,
    color: RGB,
) -> str:
    """The line, pale beyond the current moment."""
    pixels = int(np.ceil((WIDTH - LEFT - RIGHT) * (line.moments[-1] - line.moments[0] + 1) / length))
    chosen = thinned(line.moments, line.values, pixels)
    moments, values = line.moments[chosen], line.values[chosen]
    past = moments <= moment
    pale = "" if past.all() else _polyline(x(moments), y(values), css(color, 0.35))
    return pale + (_polyline(x(moments[past]), y(values[past]), css(color)) if past.any() else "")


def known_points(
    line: Line, moment: int, x: Callable[[np.ndarray], np.ndarray], y: Callable[[np.ndarray], np.ndarray], color: RGB
) -> str:
    """The points of a line that is known at some moments only, while they are few enough to be told apart; pale beyond the
    current moment."""
    if len(line.moments) > MOST_POINTS:
        return ""
    return "".join(
        f'<circle cx="{at:.1f}" cy="{height:.1f}" r="2" fill="{css(color, 1 if known <= moment else 0.5)}"/>'
        for known, at, height in zip(line.moments.tolist(), x(line.moments), y(line.values), strict=True)
    )


def cursor(x: float) -> str:
    """A mark of the current moment, where the line is not known."""
    return f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}" stroke="{css(SELECTED)}"/>'


def _polyline(x: np.ndarray, y: np.ndarray, color: str) -> str:
    if len(x) == 1:
        return f'<circle cx="{x[0]:.1f}" cy="{y[0]:.1f}" r="2" fill="{color}"/>'
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    return f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="2" stroke-linejoin="round"/>'

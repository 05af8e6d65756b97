"""Charts as SVG in the fonts and colours of the page.

viser's uPlot charts are not used: all series share one x column, and missing values are drawn as zeros, so that lines
drop to the bottom of a log scale.
"""

from collections.abc import Sequence

import numpy as np

from app.experiments.chart import Chart, Series
from app.html import number, text
from app.palette import css
from app.ticks import log_ticks, ticks

WIDTH, HEIGHT = 338, 190
LEFT, RIGHT, TOP, BOTTOM = 50, 10, 10, 36
MOST_DOTS = 40  # per line; more would hide the line


def charts_svg(charts: Sequence[Chart]) -> str:
    """Charts one below the other. A label that appears in several charts is listed in the first legend only."""
    parts, explained = [], set()
    for chart in charts:
        legend = [series for series in chart.series if series.label and series.label not in explained]
        explained |= {series.label for series in legend}
        parts.append(_chart(chart) + _legend(legend))
    return "".join(parts)


def _chart(chart: Chart) -> str:
    """Title and picture. A tooltip shows the values of a point."""
    x, y = (
        _Axis(chart.x_range, chart.x_log, LEFT, WIDTH - RIGHT),
        _Axis(chart.y_range, chart.y_log, HEIGHT - BOTTOM, TOP),
    )
    parts = [*_grid(x, y), *(_drawn(series, x, y) for series in chart.series)]
    middle = (TOP + HEIGHT - BOTTOM) / 2
    parts.append(
        f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 6}" text-anchor="middle">{text(chart.x_label)}</text>'
        f'<text x="11" y="{middle}" text-anchor="middle" transform="rotate(-90 11 {middle})">{text(chart.y_label)}</text>'
    )
    picture = (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" class="plot chart" role="img" aria-label="{text(chart.title)}">'
        f"{''.join(parts)}</svg>"
    )
    return f"<h4>{text(chart.title)}</h4>{picture}"


class _Axis:
    """Maps values to pixels, linearly or logarithmically."""

    def __init__(self, ends: tuple[float, float], is_log: bool, low_px: float, high_px: float) -> None:
        self._is_log, self._low_px, self._high_px = is_log, low_px, high_px
        self._low, self._high = (float(np.log10(end)) if is_log else end for end in ends)

    def at(self, values: np.ndarray | float) -> np.ndarray:
        """Pixels; values beyond an end are drawn at that end."""
        values = np.asarray(values, dtype=float)
        scaled = np.log10(np.maximum(values, 1e-300)) if self._is_log else values
        share = np.clip((scaled - self._low) / (self._high - self._low), 0, 1)
        return self._low_px + share * (self._high_px - self._low_px)

    @property
    def ticks(self) -> np.ndarray:
        return log_ticks(self._low, self._high) if self._is_log else ticks(self._low, self._high)


def _grid(x: _Axis, y: _Axis) -> list[str]:
    lines = []
    for value in x.ticks.tolist():
        at = float(x.at(value))
        lines.append(f'<line x1="{at:.1f}" x2="{at:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}" stroke="var(--line)"/>')
        lines.append(f'<text x="{at:.1f}" y="{HEIGHT - BOTTOM + 13}" text-anchor="middle">{_plain(value)}</text>')
    for value in y.ticks.tolist():
        at = float(y.at(value))
        lines.append(f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{at:.1f}" y2="{at:.1f}" stroke="var(--line)"/>')
        lines.append(f'<text x="{LEFT - 5}" y="{at + 3.5:.1f}" text-anchor="end">{_plain(value)}</text>')
    return lines


def _drawn(series: Series, x: _Axis, y: _Axis) -> str:
    across, up, color = x.at(series.x), y.at(series.y), css(series.color)
    parts = []
    if series.kind != "points" and len(across) > 1:
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, up, strict=True))
        dash = ' stroke-dasharray="5 4"' if series.kind == "dashed" else ""
        parts.append(
            f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="1.8" stroke-linejoin="round"{dash}/>'
        )
    if series.kind == "points" or (series.kind == "line" and len(across) <= MOST_DOTS):
        for a, b, from_x, to_y in zip(across, up, series.x.tolist(), series.y.tolist(), strict=True):
            hint = text(f"{series.label} at {_plain(from_x)}: {number(to_y, 3)}".strip())
            parts.append(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3" fill="{color}"><title>{hint}</title></circle>')
    return "".join(parts)


def _legend(curves: Sequence[Series]) -> str:
    entries = "".join(
        f"<span class='row'><i class='swatch' style='background:{css(series.color)}'></i>{text(series.label)}</span>"
        for series in curves
    )
    return f"<div class='row chips dim' style='column-gap:12px'>{entries}</div>" if entries else ""


def _plain(value: float) -> str:
    return f"{value:g}"

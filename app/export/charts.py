"""Curves over moments as SVG without scripts, for reports."""

from collections.abc import Sequence

import numpy as np

from app.html import text
from app.palette import RGB, css
from app.ticks import log_ticks, tick_labels, ticks

WIDTH, HEIGHT = 560, 210
LEFT, RIGHT, TOP, BOTTOM = 64, 10, 12, 26


def curve_chart(
    lines: Sequence[tuple[np.ndarray, np.ndarray]],
    bands: Sequence[tuple[int, int, str]],
    length: int,
    color: RGB,
    title: str,
    is_log: bool = False,
) -> str:
    """Markup of an SVG chart; empty if there are no values to draw.

    Args:
        lines: moments and values, (n,) each.
        bands: first and last moment of every stage, and its name.
        length: the last moment.
        title: accessible name.
        is_log: whether the values have a logarithmic scale.
    """
    values = np.concatenate([line[1] for line in lines])
    values = values[np.isfinite(values) & (values > 0)] if is_log else values[np.isfinite(values)]
    if len(values) == 0:
        return ""
    floor = float(values.min())

    def scaled(value: np.ndarray) -> np.ndarray:
        return np.log10(np.maximum(value, floor)) if is_log else value

    low, high = float(scaled(values).min()), float(scaled(values).max())
    margin = 0.06 * (high - low) or 1.0
    low, high = (low - margin if is_log or low < 0 else max(0.0, low - margin)), high + margin

    def x(moment: np.ndarray | float) -> np.ndarray:
        return LEFT + (WIDTH - LEFT - RIGHT) * np.asarray(moment, dtype=float) / max(1, length)

    def y(value: np.ndarray | float) -> np.ndarray:
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (scaled(np.asarray(value, dtype=float)) - low) / (high - low)

    parts = []
    for k, (first, end, name) in enumerate(bands):
        left, right = float(x(first)), float(x(end))
        if k % 2:
            parts.append(
                f"<rect x='{left:.1f}' y='{TOP}' width='{right - left:.1f}' height='{HEIGHT - TOP - BOTTOM}' "
                "fill='var(--strong)' fill-opacity='.05'/>"
            )
        if right - left > 8 * len(name):
            parts.append(
                f"<text x='{(left + right) / 2:.1f}' y='{HEIGHT - 8}' text-anchor='middle'>{text(name)}</text>"
            )
    values = log_ticks(low, high) if is_log else ticks(low, high)
    for value, label in zip(values.tolist(), tick_labels(values), strict=True):
        at = float(y(value))
        parts.append(f"<line x1='{LEFT}' x2='{WIDTH - RIGHT}' y1='{at:.1f}' y2='{at:.1f}' stroke='var(--line)'/>")
        parts.append(f"<text x='{LEFT - 8}' y='{at + 4:.1f}' text-anchor='end'>{label}</text>")
    for moments, line in lines:
        points = " ".join(f"{px:.1f},{py:.1f}" for px, py in zip(x(moments), y(line), strict=True))
        parts.append(f"<polyline points='{points}' fill='none' stroke='{css(color)}' stroke-width='2'/>")
    return (
        f"<svg viewBox='0 0 {WIDTH} {HEIGHT}' class='curve' role='img' aria-label='{text(title)}'>"
        f"<title>{text(title)}</title>{''.join(parts)}</svg>"
    )

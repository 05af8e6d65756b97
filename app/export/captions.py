"""Captions of exported pictures and video frames: lines of text and a curve of the residual.

Pillow's built-in font has Latin letters only, so captions contain no Greek letters and no arrows.
"""

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from app.export.run_facts import RunFacts
from app.palette import NOW, RGB, SELECTED

GROUND: RGB = (32, 35, 40)
TEXT: RGB = (241, 243, 245)
DIM: RGB = (141, 150, 161)
LINE: RGB = (61, 68, 77)


class Caption:
    """A strip (height, width), px, with lines of text at the left and, with `with_curve`, the residual at the right."""

    def __init__(self, facts: RunFacts, width: int, height: int, with_curve: bool) -> None:
        self._facts, self._size = facts, (width, height)
        self._fonts = [ImageFont.load_default(size=round(part * height)) for part in (0.24, 0.19)]
        self._empty = Image.new("RGB", self._size, GROUND)
        self._curve = (0.45 * width, 0.34 * height, width - 0.3 * height, 0.86 * height)
        self._has_curve = with_curve and facts.length > 1 and len(facts.residual_line.moments) > 1
        if self._has_curve:
            self._moments, self._values = facts.residual_line
            self._lowest, self._range = float(self._values.min()), float(np.ptp(self._values)) or 1.0
            self._draw_curve()

    def strip(self, lines: list[str], moment: float | None = None) -> np.ndarray:
        """The strip, (height, width, 3) uint8.

        Args:
            lines: of text; the first one is larger.
            moment: of the dot on the curve; may lie between two moments.
        """
        width, height = self._size
        image = self._empty.copy()
        draw = ImageDraw.Draw(image)
        room = (self._curve[0] if self._has_curve else width) - 0.5 * height
        y = (0.5 - 0.145 * len(lines)) * height
        for i, line in enumerate(lines):
            font = self._fonts[min(i, 1)]
            while len(line) > 1 and draw.textlength(line, font=font) > room:
                line = line[:-1]
            draw.text((0.25 * height, y), line, TEXT if i == 0 else DIM, font=font)
            y += (0.31, 0.26)[min(i, 1)] * height
        if self._has_curve and moment is not None:
            x, y = self._place(moment, float(np.interp(moment, self._moments, self._values)))
            radius = 0.055 * height
            draw.line([(x, 0.2 * height), (x, self._curve[3])], fill=DIM)
            draw.ellipse([x - radius, y - radius, x + radius, y + radius], fill=SELECTED)
        return np.asarray(image)

    def _draw_curve(self) -> None:
        draw = ImageDraw.Draw(self._empty)
        left, _, right, bottom = self._curve
        draw.line([(left, bottom), (right, bottom)], fill=LINE)
        draw.text((left, 0.06 * self._size[1]), "residual at the finest level", DIM, font=self._fonts[1])
        points = zip(self._moments.tolist(), self._values.tolist(), strict=True)
        draw.line([self._place(moment, value) for moment, value in points], fill=NOW, width=2)

    def _place(self, moment: float, value: float) -> tuple[float, float]:
        left, top, right, bottom = self._curve
        x = left + (right - left) * moment / self._facts.length
        return x, bottom - (bottom - top) * (value - self._lowest) / self._range


def moment_words(facts: RunFacts, moment: int) -> list[str]:
    """Two or three lines about a moment: its number, the level or the fit, residual and error."""
    where = "the start"
    if moment:
        stage, level = facts.trace.steps[moment - 1].stage, facts.trace.steps[moment - 1].position.level
        blurred = f"photos blurred by {facts.options.levels[level].blur:g} px"
        where = f"level {level + 1} of {facts.options.n_levels}, {f'fit: {stage.label}' if stage.is_fit else blurred}"
    known, values = facts.residual_line
    at = int(np.searchsorted(known, moment, side="right")) - 1
    figures = residual_words(facts, int(known[at])) if len(values) else []
    if facts.errors is not None:
        figures.append(f"error {error_words(float(facts.errors[moment]))}")
    return [f"Moment {moment} of {facts.length}", where, *([", ".join(figures)] if figures else [])]


def residual_words(facts: RunFacts, moment: int) -> list[str]:
    """The comparable residual at a moment as text; nothing where no face is measured."""
    residual = facts.residual(moment).mean
    return [f"residual {residual:.4g} grey levels"] if np.isfinite(residual) else []


def error_words(percent: float) -> str:
    """An error as text."""
    return f"{percent:.2g} % of the diagonal"

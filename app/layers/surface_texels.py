"""Residuals or flow per pixel on the surface: pictures of the present moment and, for the divider, of the start."""

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from app.debugger.controller import Controller
from app.debugger.run_state import RunState
from app.page_state.page_state import PageState
from app.page_state.residual_source import ResidualSource
from app.pictures.coloring import PER_PIXEL, Coloring, Legend
from app.pictures.texel_picture import TexelPicture, texel_picture
from app.pictures.texturer import Texturer
from app.query_cache import QueryCache
from fairing.judge.texels import Texels

LEAST_BLUR = 1.0  # px: of photos that is worth noting


@dataclass(frozen=True, eq=False)
class PaintedTexels:
    """The picture of a moment, and beside it that of the start in the same colours; None unless the divider shows it."""

    now: TexelPicture
    start: TexelPicture | None

    @property
    def legend(self) -> Legend:
        """Of both: what is unknown is that of the side with more of it."""
        shown, other = self.now.legend, (self.start or self.now).legend
        return replace(shown, unknown=max(shown.unknown, other.unknown), left_out=max(shown.left_out, other.left_out))

    @property
    def blur_note(self) -> str:
        """By how much the photos are blurred at these moments, where that is visible; else empty."""
        sides = [("", self.now)] if self.start is None else [("before ", self.start), ("now ", self.now)]
        blurs = [f"{side}blurred by {shown.blur:g} px" for side, shown in sides if shown.blur >= LEAST_BLUR]
        return "".join(f", {blur}" for blur in blurs)


class SurfaceTexels:
    """The pictures that one browser shows. The engine measures the values; a worker of the texturer paints them."""

    def __init__(self, source: ResidualSource, texturer: Texturer, controller: Controller) -> None:
        self._source = source

        def submit(key: object, compute: Callable[..., Any], callback: Callable[[Any], None]) -> None:
            def done(result: object) -> None:
                if isinstance(result, Exception):
                    logging.getLogger(__name__).error("the values per pixel could not be painted", exc_info=result)
                callback(result)
                controller.republish()

            texturer.frames.post(key, compute, done)

        self._painted: QueryCache[tuple[int, int, str, int | None, bool], PaintedTexels] = QueryCache(submit)

    def at(self, state: RunState, page_state: PageState) -> PaintedTexels | Exception | None:
        """The pictures for the chosen photo at the moment shown; None while they are computed."""
        is_divided, coloring = page_state.shows_divider, PER_PIXEL[page_state.surface]
        found = self._source.texels_at(state, page_state)
        start = self._source.texels_at(state, page_state, at_start=True) if is_divided else None
        if found is None or (is_divided and start is None):
            return None
        key = (state.run_id, state.moment, page_state.surface, page_state.residual_view, is_divided)
        self._painted.request(key, lambda: _paint(coloring, found, start))
        return self._painted.result_for(key)


def _paint(coloring: Coloring, now: Texels, start: Texels | None) -> PaintedTexels:
    other = None if start is None else texel_picture(start, coloring, beside=now)
    return PaintedTexels(texel_picture(now, coloring, beside=start), other)

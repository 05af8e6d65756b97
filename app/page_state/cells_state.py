"""Cells state: settings of the cells panel in one browser."""

from dataclasses import dataclass, replace

PAGES: dict[str, str] = {"cells": "Cells", "photos": "In the photos", "pair": "Pair"}
ITERATION = "iteration"
PANEL_PAGES = PAGES | {ITERATION: "Iteration"}
"""Pages of the debugger; those of exported lessons are `PAGES`."""
PARTS: dict[str, str] = {
    "warp": "Warp",
    "eigenspace": "Eigenspace",
    "residual": "Residual",
    "weights": "Weights",
    "jacobian": "Jacobian",
    "normal": "Normal matrix",
    "solve": "Solve",
    "limit": "Limit",
    "accept": "Accept",
}
"""Parts of an iteration, in the order of the paper."""
KINDS: dict[str, str] = {
    "photo": "Observed cell I, contrast stretched to the grey levels of the face",
    "reconstruction": "Reconstruction U c from the eigenspace",
    "residual": "Signed residual I − U c: blue negative, red positive; full colour at the 99th percentile, at most at e_T",
    "weight": "Robust weight ρ'(e)/e: bright is full weight, yellow an outlier beyond e_T",
    "norm": "Robust norm ρ(e)",
    "model": "Displacement field υ of the last step of this vertex, over the residual before it",
    "flow": "Optical flow f from the cell to its reconstruction before that step; a correct step is opposite to it",
}
HEADS: dict[str, str] = {
    "photo": "I",
    "reconstruction": "U c",
    "residual": "I − U c",
    "weight": "weight",
    "norm": "ρ",
    "model": "υ",
    "flow": "f",
}
CROP = "crop"  # the photo around the vertex, enlarged
PAIR_PICTURES: dict[str, str] = {"average": "average", "warped": "i warped into j", "own": "j"}
PAIR_TIMES: dict[str, str] = {"start": "At the start", "now": "Now"}
PAIR_KINDS = tuple(f"{when} {picture}" for when in PAIR_TIMES for picture in PAIR_PICTURES)
DIFFERENCE = "Mean absolute difference between the two photos on the face, grey levels"
ARROW_KINDS = ("model", "flow")
ARROW_SCALES = (1, 3, 10, 30, 100)
SPANS: dict[str, str] = {"faces": "the faces", "path": "the path"}


@dataclass(frozen=True)
class CellsView:
    """Settings of the cells panel.

    Attributes:
        page: of `PANEL_PAGES`.
        part: of `PARTS`: what the page of the iteration shows.
        columns: of `KINDS`, in their order.
        arrow_scale: factor by which arrows are drawn longer.
        enlarged: (view id, kind) of the picture enlarged by a click; None: none. The kind is of `KINDS`, `CROP`, or of
            `PAIR_KINDS`, for which the view id has no meaning.
        hovered: the same for the picture under the pointer.
        span: of `SPANS`: the extent of the photo crops.
        pair: views i and j of the pair; None: selected automatically.
        dimensions: number of eigenspace dimensions k; None: that of the run.
    """

    page: str = "cells"
    part: str = "warp"
    columns: tuple[str, ...] = ("photo", "reconstruction", "residual")
    arrow_scale: int = 10
    enlarged: tuple[int, str] | None = None
    hovered: tuple[int, str] | None = None
    span: str = "faces"
    pair: tuple[int | None, int | None] = (None, None)
    dimensions: int | None = None

    @property
    def in_lens(self) -> tuple[int, str] | None:
        """The picture in the lens; None: no lens is shown."""
        return self.hovered or self.enlarged

    def at_part(self, direction: int) -> "CellsView | None":
        """At the next part (1) or the previous one (-1) of the iteration; None if there is none."""
        names = list(PARTS)
        at = names.index(self.part) + direction
        return replace(self, part=names[at]) if 0 <= at < len(names) else None

    def toggled(self, kind: str) -> "CellsView":
        """With a column added or removed; the last column is never removed."""
        chosen = set(self.columns) ^ {kind}
        return replace(self, columns=tuple(k for k in KINDS if k in chosen) or self.columns)

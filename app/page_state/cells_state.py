"""How one browser looks at the cells: which page of the panel, which columns, what is enlarged."""

from dataclasses import dataclass, replace

PAGES: dict[str, str] = {"cells": "Cells", "photos": "In the photos", "pair": "Pair"}
KINDS: dict[str, str] = {
    "photo": "Observed cell I, grey levels stretched to what the face has",
    "reconstruction": "Reconstruction U c from the eigenspace",
    "residual": "Signed residual I − U c: blue below, red above, full strength from e_T on",
    "weight": "Robust weight ρ'(e)/e: bright counts fully, yellow is an outlier beyond e_T",
    "norm": "Robust norm ρ(e)",
    "model": "Displacement field υ of the last step about this vertex, over the difference before it",
    "flow": "Optical flow f from the cell to its reconstruction before that step; a right step counter-balances it",
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
ARROW_KINDS = ("model", "flow")
ARROW_SCALES = (1, 3, 10, 30, 100)
SPANS: dict[str, str] = {"faces": "the faces", "path": "the path"}


@dataclass(frozen=True)
class CellsView:
    """Attributes:
    page: of `PAGES`.
    columns: of `KINDS`, in their order.
    arrow_scale: arrows are drawn this many times longer.
    enlarged: (view id, kind) of the picture that a click put into the lens; None: none. The kind is of `KINDS`,
        `CROP`, or of `PAIR_KINDS`, then the view is any.
    hovered: the same of the picture that the pointer rests on.
    span: of `SPANS`: what the crops of the photos show.
    pair: views i and j of the pair; None: chosen by themselves.
    dimensions: k looked at; None: the run's own.
    """

    page: str = "cells"
    columns: tuple[str, ...] = ("photo", "reconstruction", "residual", "weight", "model", "flow")
    arrow_scale: int = 10
    enlarged: tuple[int, str] | None = None
    hovered: tuple[int, str] | None = None
    span: str = "faces"
    pair: tuple[int | None, int | None] = (None, None)
    dimensions: int | None = None

    @property
    def in_lens(self) -> tuple[int, str] | None:
        """The picture that the lens shows; None: no lens."""
        return self.hovered or self.enlarged

    def toggled(self, kind: str) -> "CellsView":
        """With a column more or less; the last one stays."""
        chosen = set(self.columns) ^ {kind}
        return replace(self, columns=tuple(k for k in KINDS if k in chosen) or self.columns)

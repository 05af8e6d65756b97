"""Colours of the terms of the objective, for arrows, legends, tables and surfaces."""

from collections.abc import Iterable
from itertools import cycle

from app.palette import OWN_TERM_COLORS, RGB, TERM_COLORS
from fairing.terms.names import TERMS

COLOR_OF_TERM: dict[str, RGB] = dict(zip(TERMS, TERM_COLORS, strict=True))
"""Colours of the built-in terms."""


def colors_of_terms(names: Iterable[str]) -> dict[str, RGB]:
    """Colours of the built-in terms and of a run's own among these names, which take further ones in turn."""
    own = [name for name in names if name not in TERMS]
    return COLOR_OF_TERM | dict(zip(own, cycle(OWN_TERM_COLORS), strict=False))

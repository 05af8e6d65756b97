"""Colours of the terms of the objective, for arrows, legends, tables and surfaces."""

from app.palette import RGB, TERM_COLORS
from fairing.terms.names import TERMS

COLOR_OF_TERM: dict[str, RGB] = dict(zip(TERMS, TERM_COLORS, strict=True))

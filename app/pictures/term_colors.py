"""Colours of the terms of the objective, for arrows, legends, tables and surfaces."""

from app.palette import OWN_TERM_COLORS, RGB, TERM_COLORS
from fairing.terms.names import TERMS, numbered_terms


class _TermColors(dict[str, RGB]):
    """Colours of the built-in terms; those of one's own take further ones in turn."""

    def __missing__(self, name: str) -> RGB:
        return OWN_TERM_COLORS[(numbered_terms().index(name) - len(TERMS)) % len(OWN_TERM_COLORS)]


COLOR_OF_TERM = _TermColors(zip(TERMS, TERM_COLORS, strict=True))

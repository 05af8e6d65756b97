"""Insets of floating panels."""

MARGIN = 16  # px from the edges of the 3D view

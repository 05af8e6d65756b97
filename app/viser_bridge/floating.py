"""What floats over the 3D view keeps off its edges."""

MARGIN = 16  # px

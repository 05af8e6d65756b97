"""Floating panels: insets, and panels that clicks pass through."""

MARGIN = 16  # px from the edges of the 3D view
GAP = 8  # px between panels side by side
CLICK_THROUGH = "click-through"
"""CSS class of a panel's content: clicks on the panel reach what lies under it."""
STYLE = f"[data-floating-window]:has(.ef > .{CLICK_THROUGH}) {{ pointer-events: none; }}\n"

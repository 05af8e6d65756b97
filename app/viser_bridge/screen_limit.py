"""Largest size on the screen of a node that is a mesh with a radius of 1 around its origin; shapes of viser 1.1.1 have none."""

import viser

from app.viser_bridge.javascript import run_in_page


def limit_on_screen(client: viser.ClientHandle, name: str, radius: float) -> None:
    """Draw a node with a radius of at most this many screen pixels, however near the eye is."""
    run_in_page(client.gui, "screen_limit", "limitOnScreen", name=name, largest=radius)

"""Software rendering: viser's warning about it closes by itself.

viser 1.1.1 warns in every page of a browser without a graphics card, as in containers and on remote desktops. The warning
covers a third of the 3D view, takes the clicks on it, and stays until it is closed by hand.
"""

import viser

from app.viser_bridge.javascript import run_in_page

SECONDS = 12.0  # long enough to read its 33 words


def close_warning(gui: viser.GuiApi) -> None:
    """Close the warning `SECONDS` after a page has connected."""
    run_in_page(gui, "software_rendering", "closeWarning", after=1000 * SECONDS)

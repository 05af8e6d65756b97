"""Accessible names of viser's own widgets.

In viser 1.1.1 sliders, number inputs, the icons of the main panel, the command palette, and the inputs of the viewer settings
have no accessible name; the titles of folders and the icons of the scene tree cannot be reached by keyboard. A script in the
page gives them the name that stands beside them, and makes titles and icons buttons, whenever the page has changed.
"""

import viser

from app.viser_bridge.javascript import run_in_page


def name_widgets(client: viser.ClientHandle) -> None:
    """Install the script in this browser's page."""
    run_in_page(client.gui, "accessible_names", "nameWidgets")

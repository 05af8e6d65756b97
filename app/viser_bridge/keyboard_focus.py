"""Keyboard focus: widgets keep it only while the user types, so that hotkeys keep working.

viser 1.1.1 handles no hotkeys while an input, a checkbox or a dropdown has the focus, and a click leaves it there. So a
script in the page removes the focus once a widget has been used.
"""

import viser

from app.viser_bridge.javascript import run_in_page


def release_focus_after_use(client: viser.ClientHandle) -> None:
    """Install the script in this browser's page."""
    run_in_page(client.gui, "keyboard_focus", "releaseFocusAfterUse")

"""Navigation within the page: select a tab, scroll to a heading, reload; title of the browser's tab.

viser 1.1.1 has no functions for these.
"""

import viser

from app.viser_bridge.javascript import run_in_page


def show_tab(client: viser.ClientHandle, title: str) -> None:
    """Select the tab with this title."""
    run_in_page(client.gui, "tabs", "showTab", title=title)


def show_heading(client: viser.ClientHandle, title: str) -> None:
    """Scroll to a heading of a panel, as soon as it is there; any input by the user ends it."""
    run_in_page(client.gui, "tabs", "showHeading", title=title)


def show_top(client: viser.ClientHandle, inside: str) -> None:
    """Scroll the panel with an element, given as a CSS selector, to its top."""
    run_in_page(client.gui, "tabs", "showTop", inside=inside)


def show_field(client: viser.ClientHandle, folder: str, label: str) -> None:
    """Open the folder with this title if it is closed, and scroll to the field with this label, as soon as it is there."""
    run_in_page(client.gui, "tabs", "showField", folder=folder, label=label)


def reload_page(client: viser.ClientHandle, after: float) -> None:
    """Reload the page in `after` seconds."""
    run_in_page(client.gui, "tabs", "reloadPage", after=1000 * after)


def set_tab_title(client: viser.ClientHandle, title: str) -> None:
    """The title of the browser's tab."""
    run_in_page(client.gui, "tabs", "setTabTitle", title=title)

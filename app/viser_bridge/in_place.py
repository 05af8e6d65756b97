"""In-place updates of HTML panels: elements that stay the same are kept.

viser 1.1.1 replaces the whole content of an HTML widget when anything in it changes, during a run several times a second.
A button that is replaced between press and release gets no click, a focused one loses the focus, lists lose their scroll
position. So a script in the page intercepts assignments of `innerHTML`, compares the old content of a panel with the new,
and applies only the differences. If a later viser assigns its content in another way, panels are replaced as before.
"""

import viser

from app.viser_bridge.javascript import run_in_page


def update_in_place(client: viser.ClientHandle) -> None:
    """Install the script in this browser's page."""
    run_in_page(client.gui, "in_place", "updateInPlace")

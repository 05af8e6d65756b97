"""Elements that the page draws itself, from data in their markup, by the scripts that exported pages use.

viser 1.1.1 shows HTML without scripts in it. So a script defines custom elements, which are drawn wherever they appear.
"""

import json
from collections.abc import Mapping

import viser

from app.html import text
from app.viser_bridge.javascript import run_in_page


def define_elements(client: viser.ClientHandle) -> None:
    """Define the elements in this browser's page."""
    run_in_page(client.gui, "drawn_elements", "defineElements")


def profile_element(data: Mapping[str, object]) -> str:
    """Markup of a plot of energies by offset; `data`: JSON values, see `app/web/profile.js`."""
    return f'<ef-profile data="{text(json.dumps(data, allow_nan=False))}"></ef-profile>'

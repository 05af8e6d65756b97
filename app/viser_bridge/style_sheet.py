"""The page's style sheet: in its head, once.

Within the panels' content it would be sent and laid anew with every change of theirs, 8 KB each time.
"""

import json

import viser

from app.viser_bridge.javascript import run_in_page

_SCRIPT = """
const sheet = document.getElementById('eigenfairing-style') ?? document.head.appendChild(document.createElement('style'));
sheet.id = 'eigenfairing-style';
sheet.textContent = %s;
"""


def lay_style_sheet(client: viser.ClientHandle, css: str) -> None:
    """Give a browser's page this style sheet, in place of any other from here."""
    run_in_page(client.gui, f"{{{_SCRIPT % json.dumps(css)}}}")

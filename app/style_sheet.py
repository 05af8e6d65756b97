"""The page's style sheet: in its head, once.

Within the panels' content it would be sent and laid anew with every change of theirs, 8 KB each time.
"""

import json

import viser
from viser._messages import RunJavascriptMessage

_SCRIPT = """
const sheet = document.getElementById('eigenfairing-style') ?? document.head.appendChild(document.createElement('style'));
sheet.id = 'eigenfairing-style';
sheet.textContent = %s;
"""


def lay_style_sheet(client: viser.ClientHandle, css: str) -> None:
    """Give a browser's page this style sheet, in place of any other from here."""
    client.gui._websock_interface.queue_message(RunJavascriptMessage(source=f"{{{_SCRIPT % json.dumps(css)}}}"))

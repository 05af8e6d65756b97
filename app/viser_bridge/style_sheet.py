"""The page's style sheet, set once in the head of the document.

Within the content of a panel it would be sent and applied again with every change of the panel, 8 KB each time.
"""

import viser

from app.viser_bridge.javascript import run_in_page


def set_style_sheet(client: viser.ClientHandle, css: str) -> None:
    """Give a browser's page this style sheet, in place of an earlier one."""
    run_in_page(client.gui, "style_sheet", "setStyleSheet", css=css)

"""Runs JavaScript in a browser's page. viser 1.1.1 can, but offers it only to itself; tests hold it."""

import viser
from viser._messages import RunJavascriptMessage


def run_in_page(gui: viser.GuiApi, source: str) -> None:
    """Run a script, once, when all that was sent before has arrived."""
    gui._websock_interface.queue_message(RunJavascriptMessage(source=source))

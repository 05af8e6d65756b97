"""JavaScript in a browser's page: viser 1.1.1 has a message for it, but no public function."""

import viser
from viser._messages import RunJavascriptMessage


def run_in_page(gui: viser.GuiApi, source: str) -> None:
    """Run a script, once, after everything that was sent before has arrived."""
    gui._websock_interface.queue_message(RunJavascriptMessage(source=source))

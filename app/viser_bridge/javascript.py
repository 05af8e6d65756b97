"""JavaScript in a browser's page: viser 1.1.1 has a message for it, but no public function."""

from typing import Any

import viser
from viser._messages import RunJavascriptMessage

from app.scripts import script_call


def run_in_page(gui: viser.GuiApi, module: str, function: str, **parameters: Any) -> None:
    """Call a function of the page, once, after everything that was sent before has arrived.

    Args:
        module: name of a file in the folder `web` of this room, without its suffix.
        function: one that it exports.
        parameters: JSON values, the properties of the function's argument.
    """
    source = script_call(f"viser_bridge/web/{module}.js", function, **parameters)
    gui._websock_interface.queue_message(RunJavascriptMessage(source=source))

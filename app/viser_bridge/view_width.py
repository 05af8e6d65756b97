"""Width of the 3D view, and a floating panel along its bottom that spans it.

In viser 1.1.1 `camera.image_width` counts rendered pixels: twice as many on a high-density screen, fewer while rendering is
slow. Panels are placed in CSS pixels, so the page measures the view itself.
"""

from collections.abc import Callable

import viser

from app.viser_bridge.floating import MARGIN
from app.viser_bridge.html_events import HtmlEvents, whole_number
from app.viser_bridge.javascript import run_in_page

MIN_WIDTH = 320  # px
MAX_WIDTH = 20_000  # px


class ViewWidth:
    """One browser's width between the margins of the 3D view, measured again whenever it changes."""

    def __init__(self, events: HtmlEvents) -> None:
        self._listeners: list[Callable[[int], None]] = []
        self._event = events.add(self._measured)

    def subscribe(self, listener: Callable[[int], None]) -> None:
        """Call `listener` with every width measured from now on, px."""
        self._listeners.append(listener)

    def measure(self, gui: viser.GuiApi) -> None:
        """Install the script in this browser's page."""
        run_in_page(gui, "view_width", "watchWidth", event=self._event)

    def _measured(self, value: object) -> None:
        width = whole_number(value, 1, MAX_WIDTH, "width of the view") - 2 * MARGIN
        for listener in self._listeners:
            listener(width)


def span_bottom(panel: viser.PanelHandle, view_width: ViewWidth) -> None:
    """Float a panel along the bottom of the view.

    viser 1.1.1 places a panel its own height too low for a distance from the bottom, and mends that only when the panel's
    size changes next; so the position is sent once, before the first width, and then widths alone.
    """
    panel.float(x=MARGIN, y=-MARGIN, width=MIN_WIDTH)
    view_width.subscribe(lambda width: panel.set_width(max(MIN_WIDTH, width)))

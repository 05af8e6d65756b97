"""Placement of the timeline: a floating panel along the bottom of the 3D view, as wide as the view."""

import viser

from app.viser_bridge.floating import MARGIN
from app.viser_bridge.html_events import HtmlEvents, whole_number
from app.viser_bridge.javascript import run_in_page

MIN_WIDTH = 320  # px
MAX_WIDTH = 20_000  # px

# In viser 1.1.1 `camera.image_width` counts rendered pixels: twice as many on a high-density screen, fewer while rendering
# is slow. Panels are placed in CSS pixels, so the page measures the view itself.
_SCRIPT = """
{
  const watch = () => {
    const canvas = window.__viserMutable?.canvas;
    if (!canvas) return void setTimeout(watch, 50);
    window.eigenfairingWidth?.disconnect();
    window.eigenfairingWidth = new ResizeObserver(() => { %s; });
    window.eigenfairingWidth.observe(canvas);
  };
  watch();
}
"""


class TimelinePlacement:
    """Places a floating panel there, and gives it the view's width whenever that changes.

    viser 1.1.1 places a panel its own height too low for a distance from the bottom, and mends that only when the panel's
    size changes next; so the position is sent once, before the first width, and then widths alone.
    """

    def __init__(self, gui: viser.GuiApi, panel: viser.PanelHandle, events: HtmlEvents) -> None:
        self._panel = panel
        panel.float(x=MARGIN, y=-MARGIN, width=MIN_WIDTH)
        send_width = events.number(self._set_view_width)("Math.round(canvas.clientWidth)")
        run_in_page(gui, _SCRIPT % send_width)

    def _set_view_width(self, value: object) -> None:
        width = whole_number(value, 1, MAX_WIDTH, "width of the view") - 2 * MARGIN
        self._panel.set_width(max(MIN_WIDTH, width))

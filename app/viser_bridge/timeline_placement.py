"""The timeline floats at the bottom of the 3D view, as wide as it."""

import viser

from app.viser_bridge.floating import MARGIN
from app.viser_bridge.html_events import Bridge, whole_number
from app.viser_bridge.javascript import run_in_page

LEAST = 320  # px
WIDEST = 20_000  # px

# viser's own `camera.image_width` counts the pixels that are drawn: twice as many on a fine screen, three quarters while
# drawing is slow. The page places panels in CSS pixels, so it tells them itself.
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


class TimelinePlace:
    """Puts a floating panel there, and again when the view changes its size."""

    def __init__(self, gui: viser.GuiApi, panel: viser.PanelHandle, bridge: Bridge) -> None:
        self._panel = panel
        self._fit(LEAST)
        told = bridge.number(self._fit)("Math.round(canvas.clientWidth)")
        run_in_page(gui, _SCRIPT % told)

    def _fit(self, view_width: object) -> None:
        width = whole_number(view_width, 1, WIDEST, "width of the view") - 2 * MARGIN
        self._panel.float(x=MARGIN, y=-MARGIN, width=max(LEAST, width))

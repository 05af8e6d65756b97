"""The timeline floats at the bottom of the 3D view, as wide as it."""

import viser
from viser._messages import RunJavascriptMessage

from app.bridge import Bridge, whole_number

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

    def __init__(self, client: viser.ClientHandle, panel: viser.PanelHandle, bridge: Bridge, margin: int) -> None:
        self._panel, self._margin = panel, margin
        self._fit(LEAST)
        told = bridge.number(self._fit)("Math.round(canvas.clientWidth)")
        client.gui._websock_interface.queue_message(RunJavascriptMessage(source=_SCRIPT % told))

    def _fit(self, view_width: object) -> None:
        width = whole_number(view_width, 1, WIDEST, "width of the view") - 2 * self._margin
        self._panel.float(x=self._margin, y=-self._margin, width=max(LEAST, width))

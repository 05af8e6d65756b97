"""Overlay of the 3D view: HTML in its top left corner, without a panel around it. Clicks pass through it."""

import viser

from app.viser_bridge.javascript import run_in_page

OVERLAY_STYLE = """
#eigenfairing-overlay { position: absolute; left: 12px; top: 10px; padding: 3px 8px; pointer-events: none; max-width: 60%;
  z-index: 1; background: color-mix(in srgb, var(--well) 75%, transparent); border-radius: 6px; }
#eigenfairing-overlay:empty { display: none; }
#eigenfairing-overlay .marks { font-size: 12px; }
#eigenfairing-overlay .marks i { width: 9px; height: 9px; border-radius: 50%; }
#eigenfairing-overlay .marks .block { border-radius: 1px; }
#eigenfairing-overlay .marks .ring { border: 2px solid; }
#eigenfairing-overlay .marks .path { width: 16px; height: 3px; border-radius: 1px; }
#eigenfairing-overlay .legend { width: 208px; margin: 6px 0 2px; gap: 1px; font-size: 12px; }
"""


class ViewOverlay:
    """The overlay of one browser."""

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client = client
        self._content = ""

    def set(self, content: str) -> None:
        """Show this markup; empty hides the overlay."""
        if content != self._content:
            self._content = content
            run_in_page(self._client.gui, "view_overlay", "setOverlay", content=content)

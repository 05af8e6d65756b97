"""Overlay of the 3D view: a legend in its top left corner, without a panel around it. Clicks pass through it; a button folds it,
since a long one covers a tall mesh."""

import viser

from app.viser_bridge.javascript import run_in_page

OVERLAY_STYLE = """
#eigenfairing-overlay { position: absolute; left: 12px; top: 10px; padding: 3px 8px; pointer-events: none; max-width: 194px;
  z-index: 1; border-radius: 6px;
  background: color-mix(in srgb, var(--well) 75%, transparent); }
#eigenfairing-overlay:has(> div:empty) { display: none; }
#eigenfairing-overlay > div > :first-child { padding-right: 20px; }
#eigenfairing-overlay .fold { height: 18px; min-width: 18px; padding: 0; pointer-events: auto; background: none; border: none;
  color: var(--dim); font-size: 12px; }
#eigenfairing-overlay .fold[aria-expanded=true] { position: absolute; top: 4px; right: 4px; }
#eigenfairing-overlay .fold:hover { color: var(--strong); }
#eigenfairing-overlay .marks { font-size: 12px; }
#eigenfairing-overlay .marks i { width: 9px; height: 9px; border-radius: 50%; }
#eigenfairing-overlay .marks .block { border-radius: 1px; }
#eigenfairing-overlay .marks .ring { border: 2px solid; }
#eigenfairing-overlay .marks .path { width: 16px; height: 3px; border-radius: 1px; }
#eigenfairing-overlay .legend { width: 178px; margin: 6px 0 2px; gap: 1px; font-size: 12px; }
#eigenfairing-overlay .wheel { width: 52px; height: 52px; border-radius: 50%; flex: none; }
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

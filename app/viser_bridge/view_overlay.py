"""Overlay of the 3D view: a legend in its top left corner, without a panel around it. Clicks pass through it. A button folds it
to its title. A long one in a small view begins with its title and colour scale alone, since it would cover the mesh."""

import viser

from app.viser_bridge.javascript import run_in_page

OVERLAY_STYLE = """
#eigenfairing-overlay { position: absolute; left: 12px; top: 10px; padding: 3px 8px; pointer-events: none; max-width: 194px;
  z-index: 1; border-radius: 6px;
  background: color-mix(in srgb, var(--well) 75%, transparent); }
#eigenfairing-overlay > div > :first-child { padding-right: 20px; }
#eigenfairing-overlay .fold { height: 18px; min-width: 18px; padding: 0; pointer-events: auto; background: none; border: none;
  color: var(--dim); font-size: 12px; }
#eigenfairing-overlay .fold::before { content: "▾"; }
#eigenfairing-overlay .fold[aria-expanded=true] { position: absolute; top: 4px; right: 4px; }
#eigenfairing-overlay .fold:hover { color: var(--strong); }
#eigenfairing-overlay:is(.folded, .compact) { display: flex; gap: 4px; align-items: start; }
#eigenfairing-overlay:is(.folded, .compact) .fold::before { content: "▸"; }
#eigenfairing-overlay:is(.folded, .compact):not(:has(.legend)) .fold::after { content: " Legend"; }
#eigenfairing-overlay:is(.folded, .compact) > div { min-width: 0; }
#eigenfairing-overlay:is(.folded, .compact) > div > :not(.legend), #eigenfairing-overlay.folded .legend > :not(b),
#eigenfairing-overlay.compact .legend > :not(b, .scale, .ends, .selected, :has(.wheel)) { display: none; }
#eigenfairing-overlay .marks { font-size: 12px; }
#eigenfairing-overlay .marks i { width: 9px; height: 9px; border-radius: 50%; }
#eigenfairing-overlay .marks .block { border-radius: 1px; }
#eigenfairing-overlay .marks .ring { border: 2px solid; }
#eigenfairing-overlay .marks .path { width: 16px; height: 3px; border-radius: 1px; }
#eigenfairing-overlay .legend { width: 178px; margin: 6px 0 2px; gap: 1px; font-size: 12px; }
#eigenfairing-overlay:is(.folded, .compact) .legend { width: auto; margin: 0; padding: 0; }
#eigenfairing-overlay:is(.folded, .compact) .legend b { overflow: hidden; text-overflow: ellipsis; white-space: nowrap; }
#eigenfairing-overlay:has(> div:empty) { display: none; }
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

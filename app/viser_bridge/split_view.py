"""Split view: a divider, with some meshes at its left and others at its right; viser 1.1.1 draws every node in the whole view."""

from collections.abc import Sequence

import viser

from app.viser_bridge.javascript import run_in_page

DIVIDER_STYLE = """
#eigenfairing-divider { position: absolute; top: 0; bottom: 0; width: 21px; margin-left: -10px; padding: 0; cursor: ew-resize;
  touch-action: none; }
#eigenfairing-divider::before { content: ""; position: absolute; left: 9px; top: 0; bottom: 0; width: 2px;
  background: var(--strong); opacity: .8; }
#eigenfairing-divider:focus-visible { outline: none; }
#eigenfairing-divider:focus-visible::before { width: 4px; left: 8px; opacity: 1; }
#eigenfairing-divider span { position: absolute; top: 12%; left: 50%; transform: translateX(-50%); padding: 3px 9px;
  border-radius: 12px; white-space: pre; background: var(--strong); color: var(--ink); font-size: 12px; font-weight: 600; }
"""


class SplitView:
    """The divider of one browser.

    Args:
        left, right: names of the nodes on each side of it.
        words: names of both sides.
    """

    def __init__(
        self, client: viser.ClientHandle, left: Sequence[str], right: Sequence[str], words: tuple[str, str]
    ) -> None:
        self._client, self._words, self._is_on = client, words, False
        run_in_page(client.gui, "split_view", "drawBySides", sides=[list(left), list(right)])

    def set(self, is_on: bool) -> None:
        """Show the divider, which the user drags, or draw all nodes in the whole view."""
        if is_on != self._is_on:
            self._is_on = is_on
            run_in_page(self._client.gui, "split_view", "setDivider", isOn=is_on, words=self._words)

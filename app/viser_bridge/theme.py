"""Dark or light theme, remembered by the browser."""

import logging
import threading

import viser

from app.palette import BRAND

_KEY = "eigenfairing-theme"
_TIMEOUT = 5.0  # s: a browser that has not answered by then keeps the dark theme


class Theme:
    """One browser's theme: dark until the browser has answered that it was left with the light one.

    The answer is awaited on a thread, so that the page does not wait for it.

    Attributes:
        is_dark: the theme at present.
    """

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client = client
        self.is_dark = True
        self._apply()
        threading.Thread(target=self._recall, name="theme", daemon=True).start()

    def switch(self) -> None:
        """Switch to the other theme and remember it."""
        self.is_dark = not self.is_dark
        self._client.local_storage.set_item(_KEY, "dark" if self.is_dark else "light")
        self._apply()

    def _recall(self) -> None:
        try:
            remembered = self._client.local_storage.get_item(_KEY, timeout=_TIMEOUT)
        except (RuntimeError, TimeoutError):  # the browser may store nothing, or have disconnected
            logging.getLogger(__name__).debug("the browser did not answer which theme it was left with")
            return
        if remembered == "light":
            self.is_dark = False
            self._apply()

    def _apply(self) -> None:
        self._client.gui.configure_theme(
            dark_mode=self.is_dark, show_logo=False, show_share_button=False, brand_color=BRAND
        )

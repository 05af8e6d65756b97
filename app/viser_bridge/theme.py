"""Dark or light, as this browser was left."""

import logging
import threading

import viser

from app.palette import BRAND

_KEY = "eigenfairing-theme"
_PATIENCE = 5.0  # s: a browser that does not say in time gets the dark one


class Theme:
    """One browser's theme, remembered by the browser itself.

    Dark until the browser has said something else: nobody waits for its answer.

    Attributes:
        is_dark: the theme at present.
    """

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client = client
        self.is_dark = True
        self._apply()
        threading.Thread(target=self._recall, name="theme", daemon=True).start()

    def switch(self) -> None:
        """The other one, from now on."""
        self.is_dark = not self.is_dark
        self._client.local_storage.set_item(_KEY, "dark" if self.is_dark else "light")
        self._apply()

    def _recall(self) -> None:
        try:
            remembered = self._client.local_storage.get_item(_KEY, timeout=_PATIENCE)
        except (RuntimeError, TimeoutError):  # a browser may keep nothing, or have gone
            logging.getLogger(__name__).debug("the browser does not say which theme it was left with")
            return
        if remembered == "light":
            self.is_dark = False
            self._apply()

    def _apply(self) -> None:
        self._client.gui.configure_theme(
            dark_mode=self.is_dark, show_logo=False, show_share_button=False, brand_color=BRAND
        )

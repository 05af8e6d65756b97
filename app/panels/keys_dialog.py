"""Keys dialog: all keys and what they do, in two columns."""

from collections.abc import Callable

import viser

from app.html import button, icon, text
from app.viser_bridge.html_events import HtmlEvents
from app.viser_bridge.html_panel import HtmlPanel


class KeysDialog:
    """Closed by its cross, Escape, a click beside it or its own key; other keys do nothing meanwhile (`handle_keys`)."""

    def __init__(self, gui: viser.GuiApi, html_events: HtmlEvents) -> None:
        self._gui = gui
        self._close_modal: Callable[[], None] | None = None
        press = html_events.button(self.close)
        cross = button("", press, hint="Close (Escape)", icon=icon("leave"), css_class="cross")
        self._cross = cross

    def open(self, rows: list[tuple[str, str]]) -> None:
        """Show keys and what they do."""
        self.close()
        half = -(-len(rows) // 2)
        columns = "".join(key_table(part) for part in (rows[:half], rows[half:]))
        modal = self._gui.add_modal("Keys")
        with modal:
            HtmlPanel(self._gui, f"<div class='dialog'>{self._cross}<div class='keys'>{columns}</div></div>")
        self._close_modal = modal.close

    def close(self) -> None:
        if self._close_modal is not None:
            self._close_modal()
            self._close_modal = None


def key_table(rows: list[tuple[str, str]]) -> str:
    """Markup: keys and what they do."""
    cells = "".join(f"<tr><th>{text(keys)}</th><td>{text(meaning)}</td></tr>" for keys, meaning in rows)
    return f"<table class='words'>{cells}</table>"

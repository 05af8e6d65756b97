"""A line to type into, whose text arrives as it was when Enter was pressed.

viser's own lines tell every letter, but of messages that follow each other within 50 ms only the last: a quick Enter
loses the last letter. And what the server writes into them takes the place of what is being typed.
"""

from collections.abc import Callable

import viser

from app.html import text
from app.viser_bridge.html_events import Bridge
from app.viser_bridge.html_panel import HtmlPanel


class Line:
    """Enter calls `on_enter` with the text.

    Args:
        keeps: the text stays after Enter; else the line is empty at once, for the next.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        bridge: Bridge,
        name: str,
        hint: str,
        on_enter: Callable[[str], None],
        *,
        keeps: bool = False,
    ) -> None:
        self._name, self._hint, self._keeps, self._on_enter = name, hint, keeps, on_enter
        self._send = bridge.text(self._take)
        self._written, self._times = "", 0
        self._draft = ""
        self._panel = HtmlPanel(gui, self._content())

    def write(self, line: str) -> None:
        """Show this, unless somebody is typing there."""
        if line != self._written or self._draft:
            self._written, self._draft, self._times = line, "", self._times + 1
            self._panel.set(self._content())

    def take_draft(self) -> str:
        """What was typed without Enter and left, if anything; the line is empty then."""
        draft = self._draft
        if draft:
            self.write("")
        return draft

    def _take(self, line: str, is_sent: bool) -> None:
        if not is_sent:
            self._draft = line if line != self._written else ""
            return
        self._draft, self._written = "", line if self._keeps else ""
        self._on_enter(line)

    def _content(self) -> str:
        after = "this.sent=v" if self._keeps else "this.value=''"
        drafts = "window.eigenfairingInPlace"
        enter = (
            "if(event.key==='Enter'&&!event.isComposing){event.preventDefault();var v=this.value;"
            f"{drafts}?.delete(this.name);{after};{self._send('v', 'true')}}}"
        )
        return (
            f"<label class='line' title='{text(self._hint)}'><span>{text(self._name)}</span>"
            f"<input name='{text(self._name)}' value='{text(self._written)}' data-written='{self._times}' "
            f"autocomplete='off' spellcheck='false' onkeydown=\"{text(enter)}\" "
            f'oninput="{drafts}?.set(this.name,this.value)" '
            f'onchange="if(this.value!==this.sent){{{text(self._send("this.value", "false"))}}}"></label>'
        )

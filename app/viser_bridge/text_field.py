"""Text fields whose text is sent when Enter is pressed.

The text inputs of viser 1.1.1 send every letter, but of changes within 50 ms only the last: a quick Enter loses the last
letter. And what the server writes into them replaces what is being typed.
"""

from collections.abc import Callable, Sequence

import viser

from app.html import text
from app.viser_bridge.completion import Word, words_attribute
from app.viser_bridge.html_events import HtmlEvents, line_of_text
from app.viser_bridge.html_panel import HtmlPanel


class TextField:
    """Enter calls `on_enter` with the text.

    Args:
        keeps: the text stays after Enter; else the field is emptied at once.
        words: names that are completed, see `app.viser_bridge.completion`.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        events: HtmlEvents,
        name: str,
        hint: str,
        on_enter: Callable[[str], None],
        *,
        keeps: bool = False,
        words: Sequence[Word] = (),
    ) -> None:
        self._words = words
        self._name, self._hint, self._keeps, self._on_enter = name, hint, keeps, on_enter
        self._event = events.add(line_of_text(self._receive))
        self._written, self._times = "", 0
        self._draft = ""
        self._panel = HtmlPanel(gui, self._content())

    def write(self, line: str) -> None:
        """Show this text, unless the user is typing there."""
        if line != self._written or self._draft:
            self._written, self._draft, self._times = line, "", self._times + 1
            self._panel.set(self._content())

    def offer(self, words: Sequence[Word]) -> None:
        """Complete these names from now on."""
        if words != self._words:
            self._words = words
            self._panel.set(self._content())

    def take_draft(self) -> str:
        """The text that was typed without Enter before the field lost the focus, if any; the field is emptied."""
        draft = self._draft
        if draft:
            self.write("")
        return draft

    def _receive(self, line: str, is_entered: bool) -> None:
        if not is_entered:
            self._draft = line if line != self._written else ""
            return
        self._draft, self._written = "", line if self._keeps else ""
        self._on_enter(line)

    def _content(self) -> str:
        keeps = str(self._keeps).lower()
        return (
            f"<label class='line' title='{text(self._hint)}'><span>{text(self._name)}</span>"
            f"<input name='{text(self._name)}' value='{text(self._written)}' data-written='{self._times}' "
            f"{self._completion()} autocomplete='off' spellcheck='false' onkeydown='ef.entered(event,{self._event},{keeps})' "
            f"oninput='ef.typed(this)' onchange='ef.left(this,{self._event})'></label>"
        )

    def _completion(self) -> str:
        """HTML attributes of a field with completion; empty without words."""
        if not self._words:
            return ""
        combobox = (
            "role='combobox' aria-autocomplete='list' aria-expanded='false' aria-controls='eigenfairing-suggestions'"
        )
        return f"data-words='{text(words_attribute(self._words))}' {combobox}"

"""An HTML widget that sends its content only when it changes."""

import viser

from app.html import box


class HtmlPanel:
    """Content within the page's own type and colours."""

    def __init__(self, gui: viser.GuiApi, content: str = "") -> None:
        self._content = content
        self._handle = gui.add_html(box(content))

    def set(self, content: str) -> None:
        if content != self._content:
            self._content = content
            self._handle.content = box(content)

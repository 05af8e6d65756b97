"""HTML panels: content in the page's style that is sent only when it changes."""

import viser

from app.html import box


class HtmlPanel:
    """An HTML widget in the container that is open."""

    def __init__(self, gui: viser.GuiApi, content: str = "") -> None:
        self._content = content
        self._handle = gui.add_html(box(content))

    def set(self, content: str) -> None:
        """Show this content."""
        if content != self._content:
            self._content = content
            self._handle.content = box(content)

"""Live debugger in a notebook: a frame on its address."""

from html import escape

from app.notebook.frame import HEIGHT
from app.page.server import App, start
from fairing.run.session import Session


class LiveDebugger:
    """The debugger on a session, served on this machine until `stop`. The session belongs to it for that time.

    Attributes:
        url: address of the page.
    """

    def __init__(self, session: Session, height: int = HEIGHT) -> None:
        self._app: App = start(session, port=0)
        self._height = height
        self.url = self._app.url

    def stop(self) -> None:
        """End the debugger and free its port."""
        self._app.stop()

    def _repr_html_(self) -> str:
        url = escape(self.url)
        return (
            f'<p><a href="{url}" target="_blank">{url}</a></p>'
            f'<iframe src="{url}" title="The debugger" style="width:100%;height:{self._height}px;border:0"></iframe>'
        )

    def __repr__(self) -> str:
        return f"<debugger at {self.url}; stop() ends it>"

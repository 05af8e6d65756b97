"""Opening page: what a browser shows while a scene is being opened: a line with a bar, and the keys that wait."""

import threading
import time
from collections.abc import Callable, Iterable

import viser

from app.html import duration, text
from app.palette import BRAND, css
from app.viser_bridge.hotkeys import add_shared_hotkey

TICK = 0.5  # s: the seconds are counted even while nothing else is reported
SECONDS_SHOWN_AFTER = 3.0  # s in the same state

# It comes before the page's style sheet. The card is in the middle of the window, also out of the panel that holds it.
_STYLE = f"""
.ef-opening {{ position: fixed; left: calc(50% - 170px); top: 46%; transform: translate(-50%, -50%); width: 490px;
  max-width: 60vw; z-index: 50; font-size: 13px; line-height: 1.5; color: #d5d9df;
  font-variant-numeric: tabular-nums; pointer-events: none; }}
.ef-opening b {{ font-size: 18px; font-weight: 600; color: #f1f3f5; }}
.ef-opening .well {{ height: 6px; border-radius: 3px; background: #3d444d; margin: 10px 0 8px; overflow: hidden; }}
.ef-opening .well div {{ height: 6px; border-radius: 3px; background: {css(BRAND)}; transition: width .4s; }}
.ef-opening .unknown {{ width: 25%; animation: ef-opening 2s linear infinite; }}
@keyframes ef-opening {{ from {{ margin-left: -25%; }} to {{ margin-left: 100%; }} }}
.ef-opening .dim {{ color: #98a1ac; min-height: 1.5em; }}
"""
HIDDEN = "div:has(> .ef-opening) { display: none !important }"
"""CSS of a finished page: hides what is shown while the next scene is opened, or the page is loaded again."""


class OpeningPage:
    """One for all browsers. After `close` it is what a page shows until its panels arrive."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._gui = gui
        self._title, self._line, self._fraction = "Opening", "Starting", None
        self._details: Callable[[], str] = lambda: ""
        self._changed = time.monotonic()
        self._began = self._changed
        self._content = ""
        self._pressed: list[str] = []
        self._commands: list[viser.CommandHandle] = []
        self._skips = False
        self._html = gui.add_html(self._markup())
        self._skip = gui.add_button("Open with what is given", visible=False)
        self._skip.on_click(lambda _: self._request_skip())
        self._closed = threading.Event()
        threading.Thread(target=self._tick, name="opening page", daemon=True).start()

    def begin(self, title: str, details: Callable[[], str]) -> None:
        """Show a title.

        Args:
            details: returns a second line, read about twice a second.
        """
        self._title, self._details = title, details
        self._update()

    def show(self, line: str, fraction: float | None = None, can_skip: bool = False) -> None:
        """Show a line and the finished fraction, 0 to 1; None if unknown.

        Args:
            can_skip: offer to skip this work; see `skip_requested`.
        """
        if line != self._line:
            self._changed = time.monotonic()
        self._line, self._fraction = line, fraction
        self._skip.visible = can_skip and not self._skips
        self._update()

    def skip_requested(self) -> bool:
        """Whether a user has chosen to skip the work that was offered."""
        return self._skips

    def accept_keys(self, keys: Iterable[tuple[str, str, str | None]]) -> None:
        """Accept keys, (label, key, modifier) each; `close` returns those that were pressed."""
        for label, key, modifier in keys:
            self._commands.append(
                add_shared_hotkey(self._gui, label, lambda label=label: self._press(label), key, modifier)
            )

    def close(self) -> list[str]:
        """Stop; returns the labels of the keys that were pressed, in their order."""
        self._closed.set()
        for command in self._commands:
            command.remove()
        self._commands = []
        self._skip.visible = False
        self._title, self._line, self._fraction, self._details = "Opening", "Loading the page", None, lambda: ""
        pressed, self._pressed = self._pressed, []
        self._update()
        return pressed

    def _press(self, label: str) -> None:
        if label not in self._pressed:
            self._pressed.append(label)
        self._update()

    def _request_skip(self) -> None:
        self._skips, self._skip.visible = True, False

    def _tick(self) -> None:
        while not self._closed.wait(TICK):
            self._update()

    def _update(self) -> None:
        content = self._markup()
        if content != self._content:
            self._content = content
            self._html.content = content

    def _markup(self) -> str:
        seconds = time.monotonic() - self._changed
        waited = f", {duration(seconds)}" if seconds > SECONDS_SHOWN_AFTER and not self._details() else ""
        phase = f"animation-delay:-{(time.monotonic() - self._began) % 2:.1f}s"
        bar = f"<div class='unknown' style='{phase}'></div>"
        if self._fraction is not None:
            bar = f"<div style='width:{100 * self._fraction:.1f}%'></div>"
        waiting = f"Waits until the scene is open: {', '.join(self._pressed)}" if self._pressed else ""
        return (
            f"<div class='ef-opening' role='status'><style>{_STYLE}</style><b>{text(self._title)}</b>"
            f"<div class='well' role='progressbar' aria-label='Opening'>{bar}</div>"
            f"<div>{text(self._line)}{waited}</div><div class='dim'>{text(self._details())}</div>"
            f"<div class='dim'>{text(waiting)}</div></div>"
        )

"""Moments with a note: listed, gone to, compared with, copied by name."""

from collections.abc import Callable

import viser

from app.debugger.bookmarks import Bookmark, Bookmarks
from app.debugger.commands import SwitchTo
from app.debugger.compare import Reference
from app.debugger.controller import Controller
from app.debugger.moment_id import moment_id
from app.debugger.run_state import RunState
from app.html import button, copy_button, icon, text
from app.page_state.page_state import PageState
from app.viser_bridge.html_events import Bridge, whole_number
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.text_field import Line


class BookmarksPanel:
    """The list, and a line to write a note and keep the present moment."""

    def __init__(self, gui: viser.GuiApi, bridge: Bridge, press: "BookmarkButtons") -> None:
        self._press = press
        note = Line(gui, bridge, "Note", "Enter keeps the present moment with this note.", press.keep_with)
        press.take_note = note.take_draft
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, page_state: PageState) -> None:
        here = moment_id(state.position, state.moment, state.options.n_levels)
        keep = button("Bookmark this moment", self._press.keep, hint="Keep the present moment with the note (K)")
        rows = "".join(self._row(item, state) for item in state.bookmarks)
        none = "<div class='dim note'>No bookmarks yet. Saved runs keep them beside their file.</div>"
        self._panel.set(
            f"<div class='row'>{keep}<span class='dim grow'>now: <code>{text(here)}</code></span>"
            f"{copy_button(here, 'Copy the name of this moment, for --at')}</div>"
            f"<div class='scroll'>{f'<table class=runs>{rows}</table>' if rows else none}</div>"
        )

    def _row(self, item: Bookmark, state: RunState) -> str:
        is_here = (item.run_id, item.moment) == (state.run_id, state.moment)
        number_of = str(item.number)
        go = button(
            item.at,
            self._press.go(number_of),
            hint=f"Go to moment {item.moment} of run {item.run_id}",
            css_class="small on" if is_here else "small",
        )
        compare = button("A", self._press.compare(number_of), hint="Compare with this moment", css_class="small")
        remove = button("", self._press.remove(number_of), hint="Remove", icon=icon("leave"), css_class="small")
        return (
            f"<tr><td>{go}</td><td class='dim n'>run {item.run_id}</td><td class='what'>{text(item.note)}</td>"
            f"<td><div class='row tools'>{copy_button(item.at, 'Copy its name, for --at')}{compare}{remove}</div></td></tr>"
        )


class BookmarkButtons:
    """What the panel's buttons do; made where they stay on the page when the panel is not."""

    def __init__(
        self,
        controller: Controller,
        view: PageState,
        bridge: Bridge,
    ) -> None:
        self._controller, self._view = controller, view
        self.take_note: Callable[[], str] = lambda: ""
        self.keep = bridge.button(self.keep_now)
        self.go = bridge.number(lambda n: self._go(self._of(n)))
        self.compare = bridge.number(lambda n: self._compare(self._of(n)))
        self.remove = bridge.number(lambda n: controller.edit_bookmarks(lambda b: b.removed(self._of(n).number)))

    def keep_now(self) -> None:
        """Bookmark the present moment with the note that is written."""
        self.keep_with(self.take_note())

    def keep_with(self, note: str) -> None:
        """Bookmark the present moment with this note."""
        state = self._controller.state
        at = moment_id(state.position, state.moment, state.options.n_levels)
        self._controller.edit_bookmarks(lambda b: b.added(state.run_id, state.moment, at, note))

    def _of(self, number: object) -> Bookmark:
        return Bookmarks(self._controller.state.bookmarks).numbered(whole_number(number, 1, 10**6, "bookmark"))

    def _go(self, item: Bookmark) -> None:
        self._controller.post(SwitchTo(item.run_id, item.moment))

    def _compare(self, item: Bookmark) -> None:
        self._view.reference = Reference(item.run_id, item.moment)
        self._controller.republish()

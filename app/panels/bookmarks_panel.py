"""Bookmarks panel: lists bookmarked moments, jumps to them, compares with them, copies their names."""

import viser

from app.debugger.bookmarks import Bookmark, Bookmarks
from app.debugger.commands import SwitchTo
from app.debugger.compare import Reference
from app.debugger.controller import Controller
from app.debugger.moment_id import moment_id
from app.debugger.run_state import RunState
from app.html import button, copy_button, icon, text
from app.page_state.page_state import PageState
from app.viser_bridge.html_events import HtmlEvents, integer, press
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.text_field import TextField

MAX_NUMBER = 10**6


class BookmarksPanel:
    """The list of bookmarks, and a text field to bookmark the current moment with a note."""

    def __init__(
        self, gui: viser.GuiApi, html_events: HtmlEvents, controller: Controller, page_state: PageState
    ) -> None:
        self._controller, self._page_state = controller, page_state
        self._events = html_events.named(
            {
                "keep": press(self.keep_now),
                "go": integer(self._go, "bookmark", 1, MAX_NUMBER),
                "compare": integer(self._compare, "bookmark", 1, MAX_NUMBER),
                "remove": integer(self._remove, "bookmark", 1, MAX_NUMBER),
            }
        )
        hint = "Enter bookmarks the current moment with this note."
        self._note = TextField(gui, html_events, "Note", hint, self._keep_with)
        self._panel = HtmlPanel(gui)

    def keep_now(self) -> None:
        """Bookmark the current moment with the note in the text field."""
        self._keep_with(self._note.take_draft())

    def show(self, state: RunState, page_state: PageState) -> None:
        here = moment_id(state.position, state.moment, state.options.n_levels)
        keep = button("Bookmark this moment", self._events("keep"), hint="Bookmark this moment (K) with the note")
        rows = "".join(self._row(item, state) for item in state.bookmarks)
        none = "<div class='dim note'>No bookmarks yet. They are saved with the run.</div>"
        self._panel.set(
            f"<div class='row'>{keep}<span class='dim grow'>now: <code>{text(here)}</code></span>"
            f"{copy_button(here, 'Copy the name of this moment (for --at)')}</div>"
            f"<div class='scroll'>{f'<table class=runs>{rows}</table>' if rows else none}</div>"
        )

    def _row(self, item: Bookmark, state: RunState) -> str:
        is_here = (item.run_id, item.moment) == (state.run_id, state.moment)
        go = button(
            item.at,
            self._events("go", item.number),
            hint=f"Go to moment {item.moment} of run {item.run_id}",
            css_class="small on" if is_here else "small",
            pressed=is_here,
        )
        copy = copy_button(item.at, "Copy the name of this moment (for --at)")
        compare = button("A", self._events("compare", item.number), hint="Compare with this moment", css_class="small")
        remove = button(
            "", self._events("remove", item.number), hint="Remove this bookmark", icon=icon("leave"), css_class="small"
        )
        return (
            f"<tr><td>{go}</td><td class='dim n'>run {item.run_id}</td><td class='what'>{text(item.note)}</td>"
            f"<td><div class='row tools'>{copy}{compare}{remove}</div></td></tr>"
        )

    def _keep_with(self, note: str) -> None:
        state = self._controller.state
        at = moment_id(state.position, state.moment, state.options.n_levels)
        self._controller.edit_bookmarks(lambda b: b.added(state.run_id, state.moment, at, note))

    def _numbered(self, number: int) -> Bookmark:
        return Bookmarks(self._controller.state.bookmarks).numbered(number)

    def _go(self, number: int) -> None:
        item = self._numbered(number)
        self._controller.post(SwitchTo(item.run_id, item.moment))

    def _compare(self, number: int) -> None:
        item = self._numbered(number)
        self._page_state.reference = Reference(item.run_id, item.moment)
        self._controller.republish()

    def _remove(self, number: int) -> None:
        self._controller.edit_bookmarks(lambda b: b.removed(self._numbered(number).number))

"""Selection panel: the selected vertices by number, with buttons to lock and reset them, and what can be done with them."""

from collections.abc import Callable

import viser

from app.debugger.controller import RunState
from app.html import button, icon, text
from app.page_state.page_state import PageState
from app.page_state.selection import Selection, list_vertices, parse_vertices
from app.viser_bridge.html_events import HtmlEvents, press
from app.viser_bridge.html_panel import HtmlPanel
from app.viser_bridge.text_field import TextField


class SelectionPanel:
    """A text field for vertex numbers, which also shows a selection made in the 3D view."""

    def __init__(
        self,
        gui: viser.GuiApi,
        html_events: HtmlEvents,
        last_vertex: int,
        on_choose: Callable[[Selection], None],
        toggle_lock: Callable[[], None],
        reset: Callable[[], None],
    ) -> None:
        self._events = html_events.named({"lock": press(toggle_lock), "reset": press(reset)})
        self._shown = Selection()
        self._line = TextField(
            gui, html_events, "Vertices", "Numbers and ranges such as 3, 17-20; Enter selects them.",
            lambda line: on_choose(parse_vertices(line, last_vertex)), keeps=True,
        )  # fmt: skip
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, page_state: PageState) -> None:
        if page_state.selection != self._shown:
            self._shown = page_state.selection
            self._line.write(list_vertices(page_state.selection.vertices))
        self._panel.set(
            _NOTHING if page_state.selected is None else self._chosen(state, page_state.selection, page_state.selected)
        )

    def _chosen(self, state: RunState, selection: Selection, current: int) -> str:
        others = len(selection.vertices) - 1
        count = f" <span class='dim'>and {others} more selected</span>" if others else ""
        chosen = list(selection.vertices)
        locked = state.locked[chosen]
        moved = (state.vertices != state.trace.start)[chosen].any(axis=1)
        word = "Unlock" if locked.all() else "Lock"
        lock = button(
            word,
            self._events("lock"),
            hint=f"{word} (F): neither the engine nor dragging moves a locked vertex",
            icon=icon("unlock" if locked.all() else "lock"),
            css_class="small",
        )
        reset = button(
            "Reset",
            self._events("reset"),
            hint="Reset (Z): moves the selection back to its start position, recorded as a step",
            icon=icon("back"),
            css_class="small",
            enabled=bool((moved & ~locked).any()),
        )
        return f"<div class='row'><span class='big one grow'>Vertex {text(current)}{count}</span>{lock}{reset}</div>"


class SelectionNote:
    """What can be done with the selected vertices. Below their pulls, which have to fit a small window."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, page_state: PageState) -> None:
        self._panel.set(
            "" if page_state.selected is None else f"<div class='dim'>{text(_note(state, page_state))}</div>"
        )


def _note(state: RunState, page_state: PageState) -> str:
    locked = state.locked[list(page_state.selection.vertices)]
    if locked.all():
        return "Locked: shown as a block; it does not move."
    if locked.any():
        return f"{int(locked.sum())} of them locked: shown as blocks; they do not move."
    return "Drag the yellow ball to move the selection. The next run continues from there."


_NOTHING = (
    "<span class='dim'>Click a vertex or type its number. Shift-click adds or removes a vertex; Shift-drag adds all "
    "vertices in a rectangle. Click beside the mesh to deselect.</span>"
)

"""Variables: the recorded values of the selected vertex and of the step. A click on a value goes to its last change."""

from collections.abc import Callable

import numpy as np
import viser

from app.debugger.history import last_step_about
from app.debugger.recorded_values import ITEMS, Item, value_at
from app.debugger.run_state import RunState
from app.html import number, table, text
from app.page_state.page_state import PageState
from app.viser_bridge.html_panel import HtmlPanel
from fairing.mesh import Mesh


class Variables:
    """Values for the current vertex of the selection.

    Args:
        to_change: JavaScript that goes to the last change of an item, given its number.
    """

    def __init__(self, gui: viser.GuiApi, mesh: Mesh, to_change: Callable[[str], str]) -> None:
        self._mesh, self._to_change = mesh, to_change
        self._panel = HtmlPanel(gui)
        self._shown: object = None

    def show(self, state: RunState, page_state: PageState) -> None:
        key = (state.serial, page_state.selected)
        if key != self._shown:
            self._shown = key
            self._panel.set("" if page_state.selected is None else self._content(state, page_state.selected))

    def _content(self, state: RunState, vertex: int) -> str:
        moved = float(np.linalg.norm(state.vertices[vertex] - state.trace.start[vertex]))
        content = table(
            [
                (
                    "moved from the start",
                    f"{number(moved)} <span class='dim'>({number(100 * moved / self._mesh.diagonal, 3)} %)</span>",
                ),
                ("incident faces", str(len(self._mesh.one_rings[vertex]))),
            ]
        )
        found = last_step_about(state.trace.steps, state.moment, vertex)
        if found is None:
            content += "<div class='note dim'>No step has solved for this vertex yet.</div>"
        else:
            ago = state.moment - found[0]
            when = "this step" if ago == 0 else f"{ago} step{'s' if ago > 1 else ''} ago"
            content += (
                f"<h4>Last step of this vertex <span class='dim'>({text(when)}, to moment {found[0]})</span></h4>"
            )
            content += self._table(state, vertex, True)
        if state.moment > 0:
            content += f"<h4>The step to moment {state.moment}</h4>{self._table(state, vertex, False)}"
        return content

    def _table(self, state: RunState, vertex: int, of_vertex: bool) -> str:
        return table(
            [
                (item.name, self._value(n, item, state, vertex))
                for n, item in enumerate(ITEMS)
                if item.of_vertex is of_vertex
            ]
        )

    def _value(self, n: int, item: Item, state: RunState, vertex: int) -> str:
        shown = item.shown(value_at(item, state.trace.steps, state.moment, vertex))
        return (
            f'<button type="button" class="value" title="Last change of {text(item.name)} (goes there)" '
            f'onclick="{text(self._to_change(str(n)))}">{shown}</button>'
        )

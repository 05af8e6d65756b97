"""Which vertices are chosen, by their numbers."""

from collections.abc import Callable

import viser

from app.controller import RunState
from app.html import text
from app.panels.html_panel import HtmlPanel
from app.selection import Selection, list_vertices, parse_vertices
from app.view import View

LONGEST_SHOWN = 60  # characters of a list in a sentence


class SelectionPanel:
    """A line to type numbers into, which also shows what was chosen in the scene."""

    def __init__(
        self,
        gui: viser.GuiApi,
        last_vertex: int,
        guarded: Callable[[Callable[..., None]], Callable[..., None]],
        on_choose: Callable[[Selection], None],
    ) -> None:
        self._shown = Selection()
        with gui.add_form(None) as form:
            self._text = gui.add_text("Vertices", "", hint="Numbers and ranges such as 3, 17-20; Enter selects them.")
        choose = guarded(lambda: on_choose(parse_vertices(self._text.value, last_vertex)))
        form.on_submit(lambda _: choose())
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, view: View) -> None:
        if view.selection != self._shown:
            self._shown = view.selection
            self._text.value = list_vertices(view.selection.vertices)
        self._panel.set(_summary(view.selection))


def _summary(selection: Selection) -> str:
    if selection.current is None:
        return (
            "<span class='dim'>Click a vertex in the scene, or type its number. With Shift, clicks add and take away, "
            "and a rectangle adds all vertices in it. A click beside the mesh deselects.</span>"
        )
    others = len(selection.vertices) - 1
    count = f" <span class='dim'>and {others} more selected</span>" if others else ""
    return f"<div class='big'>Vertex {text(selection.current)}{count}</div>"

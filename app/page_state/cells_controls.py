"""Cells controls: the settings of the cells panel that a user can change. Values from the browser are checked."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from app.html import text
from app.page_state.cells_state import (
    ARROW_SCALES,
    CROP,
    ITERATION,
    KINDS,
    PAIR_KINDS,
    PANEL_PAGES,
    PARTS,
    SPANS,
)
from app.page_state.page_state import PageState
from app.viser_bridge.error_toasts import NothingToDo
from app.viser_bridge.html_events import HtmlEvents, whole_number
from fairing.scene import Scene

MAX_K = 1000
_LENS_KINDS = (*KINDS, CROP, *PAIR_KINDS)
_NOWHERE = -1


class CellsControls:
    """JavaScript event handlers of the cells panel. Each attribute is a function of a JavaScript number.

    Args:
        republish: shows the present state again.
    """

    def __init__(
        self, html_events: HtmlEvents, page_state: PageState, scene: Scene, republish: Callable[[], None]
    ) -> None:
        self._page_state, self._scene, self._republish = page_state, scene, republish
        self._n_views = len(scene.views)
        self.page = html_events.number(lambda n: self._choose("page", PANEL_PAGES, n))
        self.part = html_events.number(lambda n: self._choose("part", PARTS, n))
        self.column = html_events.number(self._toggle_column)
        self.scale = html_events.number(lambda n: self._change(arrow_scale=ARROW_SCALES[_index(n, ARROW_SCALES)]))
        self.span = html_events.number(lambda n: self._choose("span", SPANS, n))
        self.dimensions = html_events.number(self.look_at_k)
        self._enlarging = html_events.add(self._enlarge)
        self._hover = html_events.add(lambda code: self._change(hovered=self._picture(code)))
        self.close = html_events.button(lambda: self._change(enlarged=None, hovered=None))
        self.first = html_events.number(lambda n: self._change(pair=(self._view_id(n), page_state.cells.pair[1])))
        self.second = html_events.number(lambda n: self._change(pair=(page_state.cells.pair[0], self._view_id(n))))

    def look_at_k(self, k: object) -> None:
        """Set the number of eigenspace dimensions; 0: that of the run."""
        found = whole_number(k, 0, MAX_K, "k")
        self._change(dimensions=found or None)

    def step_into(self) -> None:
        """Show the first part of the next iteration."""
        self._change(page=ITERATION, part=next(iter(PARTS)))

    def move_part(self, direction: int) -> None:
        """Show the next part (1) or the previous one (-1) of the iteration.

        Raises:
            NothingToDo: there is none, or no iteration is shown.
        """
        cells = self._page_state.cells
        if cells.page != ITERATION:
            raise NothingToDo("no iteration is shown; step into one first (Shift+I)")
        moved = cells.at_part(direction)
        if moved is None:
            raise NothingToDo(
                "this is the first part of the iteration"
                if direction < 0
                else "this is the last part of the iteration; Step one iteration (I) makes the step"
            )
        self._page_state.cells = moved
        self._republish()

    def lens_of(self, view_id: int, kind: str) -> str:
        """JavaScript that enlarges a picture."""
        return self.enlarge(str(self.code(view_id, kind)))

    def enlarge(self, code: str) -> str:
        """JavaScript that enlarges a picture; `code` is an expression for its number."""
        return f"ef.enlarge({self._enlarging},{code})"

    def enlarged_by(self, code: str) -> str:
        """HTML attributes of a picture that is enlarged while the pointer rests on it, and permanently by a click.

        Args:
            code: a JavaScript expression for the number of the picture under the pointer.
        """
        over, out = f"ef.rest(event,{self._hover},{code})", f"ef.leave(event,{self._hover})"
        return f'onpointermove="{text(over)}" onpointerleave="{text(out)}" onclick="{text(self.enlarge(code))}"'

    @staticmethod
    def code(view_id: int, kind: str) -> int:
        """The number of a picture, for `enlarge`."""
        return view_id * len(_LENS_KINDS) + _LENS_KINDS.index(kind)

    def _enlarge(self, code: object) -> None:
        self._change(enlarged=self._picture(code), hovered=None)

    def _picture(self, code: object) -> tuple[int, str] | None:
        found = whole_number(code, _NOWHERE, self._n_views * len(_LENS_KINDS) - 1, "picture")
        if found == _NOWHERE:
            return None
        view_id, kind = divmod(found, len(_LENS_KINDS))
        return view_id, _LENS_KINDS[kind]

    def _toggle_column(self, n: object) -> None:
        self._page_state.cells = self._page_state.cells.toggled(list(KINDS)[_index(n, KINDS)])
        self._republish()

    def _choose(self, name: str, names: dict[str, str], n: object) -> None:
        self._change(**{name: list(names)[_index(n, names)]})

    def _view_id(self, n: object) -> int:
        return whole_number(n, 0, self._n_views - 1, "camera")

    def _change(self, **changes: Any) -> None:
        self._page_state.cells = replace(self._page_state.cells, **changes)
        self._republish()


def _index(n: object, choices: Any) -> int:
    return whole_number(n, 0, len(choices) - 1, "choice")

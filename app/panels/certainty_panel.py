"""How well the photos determine the selected vertex, in numbers."""

import viser

from app.debugger.run_state import RunState
from app.html import number, table
from app.page_state.certainty_source import CertaintySource
from app.page_state.page_state import PageState
from app.viser_bridge.html_panel import HtmlPanel
from fairing.judge.certainty import Certainty

DEVIATIONS = 3


class CertaintyPanel:
    """Of the current vertex of the selection; what moves by itself is left as it was."""

    def __init__(self, gui: viser.GuiApi, source: CertaintySource) -> None:
        self._source = source
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, page_state: PageState) -> None:
        self._source.want(state, page_state)
        if state.is_moving:
            return
        found = self._source.newest(state, page_state)
        self._panel.set(_content(found[-1]) if found else "")


def _content(certainty: Certainty) -> str:
    title = "<h4>What the photos determine</h4>"
    if not certainty.is_seen:
        return f"{title}<div class='dim'>Nothing: fewer than three photos see its faces.</div>"
    free = ", ".join(f"{x:.2f}".replace("-", "\u2212") for x in certainty.axes[2])
    ratio = certainty.lengths[2]
    rows = [
        ("3 std deviations, units", " · ".join(_length(DEVIATIONS * value) for value in certainty.deviations)),
        ("least known along", free),
        ("longest / shortest axis", number(float(ratio), 3) if ratio < float("inf") else "open"),
    ]
    return title + table(rows)


def _length(value: float) -> str:
    return number(float(value), 2) if value < float("inf") else "open"

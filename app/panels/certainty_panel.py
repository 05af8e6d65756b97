"""Certainty panel: standard deviations of the selected vertex, and the direction that is least certain."""

import viser

from app.debugger.run_state import RunState
from app.html import number, table
from app.page_state.certainty_source import CertaintySource
from app.page_state.page_state import PageState
from app.viser_bridge.html_panel import HtmlPanel
from fairing.judge.certainty import Certainty

DEVIATIONS = 3


class CertaintyPanel:
    """For the current vertex of the selection. Not updated while the run moves."""

    def __init__(self, gui: viser.GuiApi, source: CertaintySource) -> None:
        self._source = source
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, page_state: PageState) -> None:
        self._source.request(state, page_state)
        if state.is_moving:
            return
        found = self._source.latest(state, page_state)
        self._panel.set(_content(found[-1]) if found else "")


def _content(certainty: Certainty) -> str:
    title = "<h4>Certainty from the photos</h4>"
    if not certainty.is_seen:
        return f"{title}<div class='dim'>Unknown: fewer than three photos see its faces.</div>"
    free = ", ".join(f"{x:.2f}".replace("-", "\u2212") for x in certainty.axes[2])
    ratio = certainty.lengths[2]
    rows = [
        ("3 σ, world units", " · ".join(_length(DEVIATIONS * value) for value in certainty.deviations)),
        ("least certain direction", free),
        ("longest / shortest axis", number(float(ratio), 3) if ratio < float("inf") else "∞"),
    ]
    return title + table(rows)


def _length(value: float) -> str:
    return number(float(value), 2) if value < float("inf") else "∞"

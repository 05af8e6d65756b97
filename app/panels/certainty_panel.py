"""Certainty panel: standard deviations of the selected vertex, and the direction that is least certain."""

import viser

from app.debugger.run_state import RunState
from app.html import number, table
from app.page_state.certainty_source import CertaintySource, drawn_half_axis
from app.page_state.page_state import PageState
from app.viser_bridge.html_panel import HtmlPanel
from fairing.judge.certainty import Certainty
from fairing.mesh import Mesh

DEVIATIONS = 3


class CertaintyPanel:
    """For the current vertex of the selection. While the run moves, it names the moment that it belongs to."""

    def __init__(self, gui: viser.GuiApi, mesh: Mesh, source: CertaintySource) -> None:
        self._mesh, self._source = mesh, source
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, page_state: PageState) -> None:
        self._source.request(state, page_state)
        moment, found = self._source.latest(state, page_state)
        if not found:
            self._panel.set("")
            return
        certainty = found[-1]
        scale = None
        if page_state.shows("certainty") and certainty.is_seen:
            shortest = drawn_half_axis(self._mesh, state.vertices, certainty.vertex)
            scale = shortest / (DEVIATIONS * float(certainty.deviations[0]) or 1e-300)
        self._panel.set(_content(certainty, "" if moment == state.moment else f" at moment {moment}", scale))


def _content(certainty: Certainty, when: str, scale: float | None) -> str:
    """Markup.

    Args:
        when: added to the title.
        scale: of the ellipsoid drawn, relative to three standard deviations; None where it is not drawn.
    """
    title = f"<h4>Certainty from the photos{when}</h4>"
    if not certainty.is_seen:
        return f"{title}<div class='dim'>Unknown: fewer than three photos see its faces.</div>"
    free = ", ".join(f"{x:.2f}".replace("-", "\u2212") for x in certainty.axes[2])
    ratio = certainty.lengths[2]
    rows = [
        ("3 σ, world units", " · ".join(_length(DEVIATIONS * value) for value in certainty.deviations)),
        ("least certain direction", free),
        ("longest / shortest axis", number(float(ratio), 3) if ratio < float("inf") else "∞"),
    ]
    if scale is not None:
        rows.append(("ellipsoid in the view", f"3 σ drawn {number(scale, 2)} times larger"))
    return title + table(rows)


def _length(value: float) -> str:
    return number(float(value), 2) if value < float("inf") else "∞"

"""Colours of the vertex marks, and the vertex that is marked as stepped."""

import numpy as np

from app.debugger.history import REJECTIONS
from app.debugger.run_state import RunState
from app.page_state.page_state import PageState
from app.palette import LOCKED, NOW, REJECTED, RGB, SELECTED, START

ONE_BY_ONE = ("sequential", "worst_first")  # orders that step one vertex at a time
MARK_COLORS: dict[RGB, str] = {
    START: "unmoved",
    NOW: "moved",
    REJECTED: "last step rejected",
    LOCKED: "locked",
    SELECTED: "selected",
}


def stepped_vertex(state: RunState) -> int | None:
    """The vertex of the last step if vertices are stepped one by one, else None."""
    record = state.record
    if record is None or state.options.schedule.order not in ONE_BY_ONE or len(record.vertices) != 1:
        return None
    return int(record.vertices[0])


def vertex_colors(state: RunState, selected: tuple[int, ...]) -> np.ndarray:
    """(n, 3) uint8: colours of the marks, of `MARK_COLORS`."""
    colors = np.tile(np.array(START, dtype=np.uint8), (len(state.vertices), 1))
    colors[(state.vertices != state.trace.start).any(axis=1)] = NOW
    record = state.record
    if record is not None:
        colors[record.vertices[np.isin(record.reasons, REJECTIONS)]] = REJECTED
    colors[state.locked] = LOCKED
    colors[list(selected)] = SELECTED
    return colors


def shown_vertices(state: RunState, page_state: PageState) -> np.ndarray:
    """(n,) bool: the vertices that have a mark: all, or if their layer is hidden, those selected."""
    shown = np.full(len(state.vertices), page_state.shows("vertices"))
    shown[list(page_state.selection.vertices)] = True
    return shown

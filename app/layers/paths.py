"""Paths layer: the path of every vertex, from green at the start to red now (the paper's figure 4d)."""

import numpy as np
import viser

from app.debugger.history import PathHistory
from app.debugger.run_state import RunState
from app.page_state.page_state import LARGE_MESH, PageState
from app.palette import NOW, START
from app.stage import Stage
from app.viser_bridge.line_node import LineNode


class PathsLayer:
    """All paths in one node; of large meshes those of the selected vertices.

    Magnification scales them about the current positions of the vertices."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, history: PathHistory) -> None:
        self._stage, self._history = stage, history
        self._lines = LineNode(client, "/paths", None, 3.0)

    def show(self, state: RunState, page_state: PageState) -> None:
        if not page_state.shows("paths"):
            self._lines.hide()
            return
        pieces, when, owner = self._history.segments(state)
        if len(state.vertices) > LARGE_MESH:  # the paths of all would hide the surface
            chosen = np.isin(owner, page_state.selection.vertices)
            pieces, when, owner = pieces[chosen], when[chosen], owner[chosen]
        now = state.vertices[owner][:, None]
        points = now + page_state.magnification * (pieces - now)
        start, end = np.array(START, dtype=float), np.array(NOW, dtype=float)
        colors = start + when[..., None] * (end - start)
        self._lines.show(self._stage.page_from_world(points), colors.astype(np.uint8))

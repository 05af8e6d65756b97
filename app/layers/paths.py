"""The way every vertex came, from green at the start to red now (the paper's figure 4d)."""

import numpy as np
import viser

from app.debugger.history import PathHistory
from app.debugger.run_state import RunState
from app.page_state.page_state import PageState
from app.palette import NOW, START
from app.stage import Stage


class PathsLayer:
    """All paths in one node. With magnification they grow about where the vertices are now."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, history: PathHistory) -> None:
        self._stage, self._history = stage, history
        self._handle = client.scene.add_line_segments(
            "/paths",
            np.zeros((1, 2, 3), dtype=np.float32),
            np.zeros((1, 2, 3), dtype=np.uint8),
            thickness=3.0,
            thickness_units="screen",
            visible=False,
        )

    def show(self, state: RunState, page_state: PageState) -> None:
        if not page_state.shows("paths"):
            self._handle.visible = False
            return
        pieces, when, owner = self._history.segments(state)
        if len(pieces) == 0:
            self._handle.visible = False
            return
        now = state.vertices[owner][:, None]
        points = now + page_state.magnification * (pieces - now)
        start, end = np.array(START, dtype=float), np.array(NOW, dtype=float)
        colors = start + when[..., None] * (end - start)
        self._handle.points = self._stage.page_from_world(points)
        self._handle.colors = colors.astype(np.uint8)
        self._handle.visible = True

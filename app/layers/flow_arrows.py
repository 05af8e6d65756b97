"""Flow layer: on every face the image flow of a photo, or of all photos, as arrows on the surface."""

import numpy as np
import viser

from app.debugger.run_state import RunState
from app.page_state.page_state import NOW_SHAPE, PageState
from app.page_state.residual_source import ResidualSource
from app.palette import HAND
from app.stage import SIZE, Stage
from app.viser_bridge.line_node import LineNode
from fairing.judge.face_residuals import FaceResiduals
from fairing.scene import Scene

HEAD = 0.3  # length of the head, in lengths of the arrow
RAISED = 0.002 * SIZE  # page units towards the cameras: arrows lie in front of their faces
MAX_ARROWS = 6000  # the browser draws about 10,000 lines at 3 frames/s without a graphics card


def flow_arrows(found: FaceResiduals, view: int | None, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Shafts and heads of the arrows (a, 3, 2, 3) float, world units, and the views they belong to (a,) int.

    Args:
        view: the photo; None: all.
        scale: length of the arrows, in lengths of the flow.
    """
    known = np.flatnonzero(found.chosen(view) & ~np.isnan(found.flow_px) & (found.flow_px > 0))[:MAX_ARROWS]
    tail, along = found.places[known], scale * found.flow[known]
    tip = tail + along
    across = np.cross(found.normals[known], along)
    wings = [tip - HEAD * along + side * 0.5 * HEAD * across for side in (1, -1)]
    return np.stack([np.stack([tail, tip], 1), np.stack([tip, wings[0]], 1), np.stack([tip, wings[1]], 1)], 1), known


class FlowArrowsLayer:
    """All arrows in one node, shown while the surface is coloured by the flow and its vertices are drawn where they are."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, scene: Scene, source: ResidualSource) -> None:
        self._stage, self._scene, self._source = stage, scene, source
        self._lines = LineNode(client, "/flow_arrows", HAND, 2.0)

    def show(self, state: RunState, page_state: PageState) -> None:
        is_shown = page_state.surface == "flow" and page_state.entered is None and page_state.shape == NOW_SHAPE
        found = self._source.at(state, page_state) if is_shown and not state.is_moving else None
        if found is None:
            self._lines.hide()
            return
        arrows, pairs = flow_arrows(found, page_state.residual_view, page_state.flow_scale)
        points = self._stage.page_from_world(arrows).astype(np.float64)
        centers = self._stage.camera_centers[found.views[pairs]]
        sight = centers - points[:, 0, 0]
        sight /= np.maximum(np.linalg.norm(sight, axis=1, keepdims=True), 1e-12)
        self._lines.show((points + RAISED * sight[:, None, None]).reshape(-1, 2, 3).astype(np.float32))

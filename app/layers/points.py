"""Points layer: the sparse points of the reconstruction."""

import viser

from app.debugger.run_state import RunState
from app.page_state.page_state import PageState
from app.stage import SIZE, Stage
from fairing.scene import SparsePoints


class PointsLayer:
    """A point cloud in the colours of its points; empty if the scene has no sparse points."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, points: SparsePoints | None) -> None:
        self._handle = None
        if points is not None and len(points.positions):
            self._handle = client.scene.add_point_cloud(
                "/points",
                stage.page_from_world(points.positions),
                points.colors,
                point_size=0.003 * SIZE,
                point_shape="circle",
                precision="float32",
                visible=False,
            )

    def show(self, state: RunState, page_state: PageState) -> None:
        if self._handle is not None:
            self._handle.visible = page_state.shows("points")

"""Points layer: the sparse points of the scene; the track of the selected one as lines to the cameras that observe it."""

import numpy as np
import viser

from app.debugger.run_state import RunState
from app.page_state.page_state import PageState
from app.palette import SELECTED
from app.stage import SIZE, Stage
from app.viser_bridge.line_node import LineNode
from fairing.scene import Scene

POINT_SIZE = 0.003 * SIZE  # page units
SELECTED_SIZE = 3 * POINT_SIZE


class PointsLayer:
    """A point cloud in the colours of its points; nothing if the scene has no sparse points."""

    def __init__(self, client: viser.ClientHandle, stage: Stage, scene: Scene) -> None:
        self._scene, self._stage = scene, stage
        self._points = points = scene.sparse_points
        self._clouds: list[viser.PointCloudHandle] = []
        self._track = LineNode(client, "/points/track", SELECTED, 1.2)
        if points is None or not len(points.positions):
            return
        places = stage.page_from_world(points.positions)
        for name, size, positions, colors in (
            ("/points/all", POINT_SIZE, places, points.colors),
            ("/points/selected", SELECTED_SIZE, places[:1], np.array([SELECTED], dtype=np.uint8)),
        ):
            cloud = client.scene.add_point_cloud(
                name, positions, colors, point_size=size, point_shape="circle", precision="float32", visible=False
            )
            self._clouds.append(cloud)

    def show(self, state: RunState, page_state: PageState) -> None:
        if self._points is None or not self._clouds:
            return
        all_points, selected = self._clouds
        all_points.visible = page_state.shows("points")
        point = page_state.point
        is_selected = point is not None and page_state.shows("points")
        if point is not None and is_selected:
            place = self._stage.page_from_world(self._points.positions[point])
            selected.points = place[None]
            observers = self._points.observations[self._points.observations[:, 0] == point, 1]
            centers = self._stage.camera_centers[observers]
            self._track.show(np.stack([np.broadcast_to(place, centers.shape), centers], axis=1).astype(np.float32))
        else:
            self._track.hide()
        selected.visible = is_selected

"""Given cameras layer: pale frusta where corrected cameras were given, or where an iteration of their adjustment had them."""

import viser

from app.debugger.run_state import RunState
from app.layers.cameras import add_frustum, frustum_scale, pose
from app.page_state.page_state import PageState
from app.palette import GHOST
from app.stage import Stage
from fairing.run.recorded_refinement import RecordedRefinement
from fairing.scene import Scene


class GivenCamerasLayer:
    """Frusta without photos. Their displacement from the corrected cameras is magnified as paths are."""

    def __init__(
        self, client: viser.ClientHandle, stage: Stage, scene: Scene, refinement: RecordedRefinement | None
    ) -> None:
        self._client, self._stage, self._scene, self._refinement = client, stage, scene, refinement
        self._root = client.scene.add_frame("/given_cameras", show_axes=False, visible=False)
        self._frusta: list[viser.CameraFrustumHandle] = []
        self._shown: tuple[int, float] | None = None

    def show(self, state: RunState, page_state: PageState) -> None:
        is_visible = page_state.shows("given cameras") and page_state.entered is None
        if self._refinement is None:
            return
        self._root.visible = is_visible
        wanted = (page_state.adjustment_step, page_state.magnification)
        if not is_visible or wanted == self._shown:
            return
        self._shown = wanted
        cameras = self._refinement.cameras_at(*wanted)
        if not self._frusta:
            scale = frustum_scale(self._stage, self._scene)
            self._frusta = [
                add_frustum(self._client, f"/given_cameras/{v}", camera, self._stage, scale, 1.5, GHOST)
                for v, camera in enumerate(cameras)
            ]
            return
        with self._client.atomic():
            for frustum, camera in zip(self._frusta, cameras, strict=True):
                frustum.wxyz, frustum.position = pose(camera, self._stage)

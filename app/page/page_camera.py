"""The camera of one browser: looks at the mesh from standard viewpoints, or through one of the scene's cameras."""

from collections.abc import Callable

import numpy as np
import viser

from app.page.camera_view import CameraView
from app.stage import FIELD_OF_VIEW, Stage
from app.viser_bridge.camera_pose import CameraPose, set_camera_pose
from app.viser_bridge.html_events import Guarded, whole_number
from app.viser_bridge.theme import Theme
from fairing.scene import Scene


class PageCamera:
    """Args:
    on_change: called with the index of the camera that is looked through from now on, or None.
    on_prediction: called when a prediction for the photo that is looked through has been computed.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        stage: Stage,
        scene: Scene,
        guarded: Guarded,
        on_change: Callable[[int | None], None],
        on_prediction: Callable[[], None],
    ) -> None:
        self._client, self._stage, self._scene, self._on_change = client, stage, scene, on_change
        self._theme = Theme(client)
        self.camera_view = CameraView(client, stage, scene, self._theme, on_prediction)
        self._stand_at(stage.eye)  # a browser may have connected before there was a scene to look at
        client.camera.on_update(guarded(lambda _: self._camera_moved()))

    @property
    def entered(self) -> int | None:
        """The camera that is looked through."""
        return self.camera_view.view_id

    def enter(self, view_id: object) -> None:
        """Look through a camera.

        Raises:
            InputError: there is no such camera, or its photo cannot be read.
        """
        found = whole_number(view_id, 0, len(self._scene.views) - 1, "camera")
        self.camera_view.enter(found)
        self._on_change(found)

    def leave(self) -> None:
        """Return to the viewpoint before a camera was entered."""
        if self.entered is not None:
            self.camera_view.leave()
            self._on_change(None)

    def show_mesh(self) -> None:
        self._look_from(self._stage.eye)

    def show_front(self) -> None:
        self._look_from(self._stage.frontal())

    def show_mesh_and_cameras(self) -> None:
        self._look_from(self._stage.overview())

    def switch_theme(self) -> None:
        """Switch between dark and light, also around a photo."""
        self._theme.switch()
        self.camera_view.refresh()

    def close(self) -> None:
        """Compute nothing more."""
        self.camera_view.close()

    def _look_from(self, eye: np.ndarray) -> None:
        self.leave()
        self._stand_at(eye)

    def _stand_at(self, eye: np.ndarray) -> None:
        stage = self._stage
        set_camera_pose(
            self._client, CameraPose(np.array(eye), np.array(stage.target), np.array(stage.up), FIELD_OF_VIEW)
        )

    def _camera_moved(self) -> None:
        if self.camera_view.user_moved_away():
            self.camera_view.detach()
            self._on_change(None)

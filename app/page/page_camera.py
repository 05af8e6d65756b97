"""The camera of one browser: looks at the mesh from standard viewpoints, or through one of the scene's cameras."""

import time
from collections.abc import Callable

import numpy as np
import viser

from app.page.camera_view import CameraView
from app.page.viewpoint import viewpoint
from app.stage import FIELD_OF_VIEW, FREE_HEIGHT, Stage
from app.viser_bridge.camera_pose import CameraPose, get_camera_pose, set_camera_pose
from app.viser_bridge.html_events import Guarded, whole_number
from app.viser_bridge.theme import Theme
from fairing.scene import Scene

FLIGHT = tuple(
    float(x) for x in 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, 13)[1:])
)  # shares of the way: slow, fast, slow
FLIGHT_SECONDS = 0.4
NARROW = 0.7  # width by height: in narrower views the width limits what is seen
PHONE = 0.6  # width by height: narrower views are those of phones
SHEET = 0.54  # of a phone's height: what the main panel covers at most


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

    def look_along(self, direction: np.ndarray) -> None:
        """Look at the mesh from a direction (3,), page, a unit vector; at the distance of `show_mesh`."""
        stage = self._stage
        self._look_from(stage.target + np.linalg.norm(stage.eye - stage.target) * direction)

    def show_mesh(self) -> None:
        self._look_from(self._stage.eye)

    def show_front(self) -> None:
        self._look_from(self._stage.frontal())

    def show_top(self) -> None:
        self._look_from(self._stage.above(), self._stage.target_from_above())

    def fly_to(self, vertex: int, vertices: np.ndarray) -> None:
        """Approach a vertex and look at it from where no face hides it, see `viewpoint`.

        Args:
            vertices: (n, 3) float, page units: of the mesh.
        """
        self.leave()
        before, point, up = get_camera_pose(self._client), vertices[vertex], np.array(self._stage.up)
        eye = viewpoint(vertex, vertices, self._scene.mesh, before.position, up, self._stage.camera_centers)
        for share in FLIGHT:
            position, target = (a + share * (b - a) for a, b in ((before.position, eye), (before.target, point)))
            set_camera_pose(self._client, CameraPose(position, target, up, FIELD_OF_VIEW))
            if share < 1:
                time.sleep(FLIGHT_SECONDS / len(FLIGHT))

    def show_mesh_and_cameras(self) -> None:
        self._look_from(self._stage.overview())

    def switch_theme(self) -> None:
        """Switch between dark and light, also around a photo."""
        self._theme.switch()
        self.camera_view.refresh()

    def close(self) -> None:
        """Compute nothing more."""
        self.camera_view.close()

    def _look_from(self, eye: np.ndarray, target: np.ndarray | None = None) -> None:
        self.leave()
        self._stand_at(eye, target)

    def _stand_at(self, eye: np.ndarray, target: np.ndarray | None = None) -> None:
        """Look at a target (3,), page units, by default that of the stage; from farther away in a narrow view, and on a phone
        so that the mesh is above the main panel."""
        target, aspect = self._stage.target if target is None else target, self._client.camera.aspect
        eye = target + max(1.0, NARROW / aspect, FREE_HEIGHT / (1 - SHEET) if aspect < PHONE else 0) * (eye - target)
        if aspect < PHONE:
            shift = self._below_panel(eye - target)
            eye, target = eye + shift, target + shift
        set_camera_pose(
            self._client, CameraPose(np.array(eye), np.array(target), np.array(self._stage.up), FIELD_OF_VIEW)
        )

    def _below_panel(self, backward: np.ndarray) -> np.ndarray:
        """(3,) float, page units: shift of a phone's camera after which the mesh is in the middle of what its panel leaves free.

        Args:
            backward: (3,) float, page units: from the target to the eye.
        """
        distance, up = np.linalg.norm(backward), np.array(self._stage.up)
        upward = up - (up @ backward) / distance**2 * backward
        # Heights of the view. The stage has raised the mesh above the timeline, at its own distance.
        raised = (1 - FREE_HEIGHT) / 2 * np.linalg.norm(self._stage.eye - self._stage.target) / distance
        down = (SHEET / 2 - raised) * 2 * np.tan(FIELD_OF_VIEW / 2) * distance
        return -down * upward / np.linalg.norm(upward)

    def _camera_moved(self) -> None:
        if self.camera_view.user_moved_away():
            self.camera_view.detach()
            self._on_change(None)

"""The camera of one browser: looks at the mesh from standard viewpoints, or through one of the scene's cameras."""

import time
from collections.abc import Callable

import numpy as np
import viser

from app.page.camera_view import CameraView
from app.stage import FIELD_OF_VIEW, Stage
from app.viser_bridge.camera_pose import CameraPose, get_camera_pose, set_camera_pose
from app.viser_bridge.html_events import Guarded, whole_number
from app.viser_bridge.theme import Theme
from fairing.geometry.normals import face_normals
from fairing.scene import Scene

FLIGHT = tuple(
    float(x) for x in 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, 13)[1:])
)  # shares of the way: slow, fast, slow
FLIGHT_SECONDS = 0.4
AWAY = 20.0  # distance of the eye from a vertex flown to, in mean distances of the corners of its faces
LEAST_FACING = 0.2  # cosine between line of sight and normal below which the surface is seen too obliquely


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

    def show_top(self) -> None:
        self._look_from(self._stage.above(), self._stage.target_from_above())

    def fly_to(self, vertex: int, vertices: np.ndarray) -> None:
        """Approach a vertex along the present line of sight, or from the outer side of the surface if that is hidden.

        Args:
            vertices: (n, 3) float, page units: of the mesh.
        """
        self.leave()
        before, mesh, point = get_camera_pose(self._client), self._scene.mesh, vertices[vertex]
        ring = mesh.faces[mesh.one_rings[vertex]]
        away = before.position - point
        distance = float(np.linalg.norm(away))
        towards = away / max(distance, 1e-9)
        if len(ring):
            distance = min(distance, AWAY * float(np.linalg.norm(vertices[ring] - point, axis=-1).mean()))
            normal = face_normals(vertices, ring).sum(axis=0)
            normal /= max(float(np.linalg.norm(normal)), 1e-300)
            if towards @ normal < LEAST_FACING:
                towards = normal + 0.3 * towards
                towards /= np.linalg.norm(towards)
        eye = point + distance * towards
        for share in FLIGHT:
            position, target = (a + share * (b - a) for a, b in ((before.position, eye), (before.target, point)))
            set_camera_pose(self._client, CameraPose(position, target, np.array(self._stage.up), FIELD_OF_VIEW))
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
        """Look at a target (3,), page units, by default that of the stage."""
        target = self._stage.target if target is None else target
        set_camera_pose(
            self._client, CameraPose(np.array(eye), np.array(target), np.array(self._stage.up), FIELD_OF_VIEW)
        )

    def _camera_moved(self) -> None:
        if self.camera_view.user_moved_away():
            self.camera_view.detach()
            self._on_change(None)

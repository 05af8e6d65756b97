"""The camera of one browser: looks at the mesh from standard viewpoints, or through one of the scene's cameras."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import viser

from app.page.camera_view import MOVED, CameraView
from app.page.viewpoint import viewpoint
from app.stage import FIELD_OF_VIEW, FREE_HEIGHT, SIZE, Stage
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


@dataclass(frozen=True, eq=False)
class StandardView:
    """The standard view chosen last. Where the camera is elsewhere, the user has moved it, or a report of an older pose arrived.

    Attributes:
        eye, target: (3,) float, page units: in a view that is not narrow.
        aspect: width by height of the view that `pose` fits.
        pose: what was sent to the browser.
    """

    eye: np.ndarray
    target: np.ndarray
    aspect: float
    pose: CameraPose


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
        self._standing: StandardView | None = None
        self._placing = threading.Lock()  # a fit to an old aspect must not overtake another view
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
        """Look at a target (3,), page units, by default that of the stage, until the user moves the camera."""
        with self._placing:
            self._place(np.array(eye), np.array(self._stage.target if target is None else target))

    def _place(self, eye: np.ndarray, target: np.ndarray) -> None:
        aspect = float(self._client.camera.aspect)
        pose = self._fitted(eye, target, aspect)
        self._standing = StandardView(eye, target, aspect, pose)
        set_camera_pose(self._client, pose)

    def _fitted(self, eye: np.ndarray, target: np.ndarray, aspect: float) -> CameraPose:
        """The pose from farther away in a narrow view, and on a phone so that the mesh is above the main panel."""
        eye = target + max(1.0, NARROW / aspect, FREE_HEIGHT / (1 - SHEET) if aspect < PHONE else 0) * (eye - target)
        if aspect < PHONE:
            shift = self._below_panel(eye - target)
            eye, target = eye + shift, target + shift
        return CameraPose(eye, target, np.array(self._stage.up), FIELD_OF_VIEW)

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
        if self.entered is None:
            with self._placing:
                self._fit_standing()
        elif self.camera_view.user_moved_away():
            self.camera_view.detach()
            self._on_change(None)

    def _fit_standing(self) -> None:
        """Place a standard view anew if the view has another aspect, unless the user has moved the camera."""
        standing, aspect = self._standing, float(self._client.camera.aspect)
        if standing is None or aspect == standing.aspect or not _is_same(get_camera_pose(self._client), standing.pose):
            return
        if _is_same(self._fitted(standing.eye, standing.target, aspect), standing.pose):
            self._standing = replace(standing, aspect=aspect)
        else:
            self._place(standing.eye, standing.target)


def _is_same(one: CameraPose, other: CameraPose) -> bool:
    """Whether the user sees no difference between two poses."""
    return all(
        np.linalg.norm(a - b) < MOVED * SIZE for a, b in ((one.position, other.position), (one.target, other.target))
    )

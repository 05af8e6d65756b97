"""Camera view: the browser's camera takes the pose of a scene camera, whose photo is shown behind the mesh."""

import threading
from collections.abc import Callable

import numpy as np
import viser
import viser.transforms

from app.debugger.run_state import Activity, RunState
from app.layers.cameras import pose
from app.page_state.page_state import PageState
from app.palette import GROUND
from app.pictures.predictor import Prediction, Predictor
from app.pictures.shown_photo import shown_photo
from app.stage import SIZE, Stage
from app.viser_bridge.camera_pose import CameraPose, get_camera_pose, set_camera_pose
from app.viser_bridge.photo_background import PhotoFit, fit_photo, photo_background
from app.viser_bridge.theme import Theme
from fairing.scene import Scene

MOVED = 1e-3  # of the scene's size, or radians: beyond this the user has left the camera's pose


class CameraView:
    """One browser's view through a camera.

    Args:
        on_ready: called when a prediction for the photo has been computed.
    """

    def __init__(
        self, client: viser.ClientHandle, stage: Stage, scene: Scene, theme: Theme, on_ready: Callable[[], None]
    ) -> None:
        self._theme = theme
        self._predictor = Predictor(scene, on_ready)
        self._share, self._is_swipe = 0.0, False
        self._fitted: tuple[PhotoFit, int, int] | None = None
        self._sent: tuple[Prediction | None, float, bool] | None = None
        self._client, self._stage, self._scene = client, stage, scene
        self._view_id: int | None = None
        self._before: CameraPose | None = None
        self._window = (0, 0)
        self._arrived = False
        self._placing = threading.Lock()  # a fit to an old window size must not overtake the one to the new size

    @property
    def view_id(self) -> int | None:
        """The camera that is looked through."""
        return self._view_id

    def refresh(self) -> None:
        """Send the photo again: the theme has changed, and with it the color around the photo."""
        if self._view_id is not None:
            self._place()

    def enter(self, view_id: int) -> None:
        """Look through a camera.

        Raises:
            InputError: its photo cannot be read. Nothing has changed then.
        """
        self._scene.views[view_id].photo.load()
        if self._view_id is None:
            self._before = get_camera_pose(self._client)
        self._view_id = view_id
        self._place()

    def leave(self) -> None:
        """Return to the pose before the camera was entered."""
        self._remove_photo()
        if self._before is not None:
            set_camera_pose(self._client, self._before)
            self._before = None

    def detach(self) -> None:
        """Leave the camera without moving: the user has begun to look around."""
        self._remove_photo()
        with self._client.atomic():
            self._client.camera.up_direction = self._stage.up
        self._before = None

    def show_overlay(self, state: RunState, vertices: np.ndarray, page_state: PageState) -> None:
        """Blend the photo with the prediction from the other photos and a mesh at vertices (n, 3), world units."""
        view_id = self._view_id
        if view_id is None:
            return
        if page_state.model_share > 0 and state.activity is Activity.PAUSED:
            self._predictor.request(view_id, vertices)
        with self._placing:
            self._share, self._is_swipe = page_state.model_share, page_state.is_swipe
            if self._view_id == view_id:
                self._send_photo(view_id)

    def close(self) -> None:
        """Compute nothing more."""
        self._predictor.close()

    def user_moved_away(self) -> bool:
        """Whether the user has left the camera's pose. Fits the photo again if the window was resized."""
        if self._view_id is None:
            return False
        camera = self._client.camera
        if (camera.image_width, camera.image_height) != self._window:
            self._place()
            return False
        wxyz, position = pose(self._scene.views[self._view_id].camera, self._stage)
        turned = 2 * float(np.arccos(np.clip(abs(np.dot(wxyz, camera.wxyz)), 0, 1)))
        is_there = bool(np.linalg.norm(camera.position - position) < MOVED * SIZE and turned < MOVED)
        # Reports of poses from before the move may still arrive, so only a camera that has arrived can leave.
        has_left = self._arrived and not is_there
        self._arrived |= is_there
        return has_left

    def _remove_photo(self) -> None:
        self._view_id = None
        self._client.scene.set_background_image(None)

    def _place(self) -> None:
        with self._placing:
            if self._view_id is not None:
                self._fit(self._view_id)

    def _fit(self, view_id: int) -> None:
        view = self._scene.views[view_id]
        width, height = int(self._client.camera.image_width), int(self._client.camera.image_height)
        self._window = (width, height)
        self._arrived = False
        fit = fit_photo(view.camera, width, height)
        wxyz, position = pose(view.camera, self._stage)
        _, down, ahead = viser.transforms.SO3(wxyz).as_matrix().T
        depth = max(float(-position @ ahead), 0.1 * SIZE)  # orbiting from here turns about the mesh
        set_camera_pose(self._client, CameraPose(position, position + depth * ahead, -down, fit.fov))
        self._fitted, self._sent = (fit, width, height), None
        self._send_photo(view_id)

    def _send_photo(self, view_id: int) -> None:
        """Send the photo, blended with the model as the user has set it, if that differs from what was sent last."""
        found = self._predictor.newest
        found = found if found is not None and found.view_id == view_id and self._share > 0 else None
        wanted = (found, self._share, self._is_swipe) if found is not None else (None, 0.0, False)
        if self._fitted is None or wanted == self._sent:
            return
        self._sent = wanted
        picture = shown_photo(self._scene.views[view_id])
        if found is not None:
            picture = (found.beside if self._is_swipe else found.over)(picture, self._share)
        background = photo_background(picture, *self._fitted, GROUND[0 if self._theme.is_dark else 1])
        self._client.scene.set_background_image(background, format="jpeg", jpeg_quality=90)

"""Looking through a camera: the browser's camera takes its pose, its photo lies behind the mesh."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import viser
import viser.transforms

from app.debugger.run_state import Activity, RunState
from app.layers.cameras import pose
from app.page_state.page_state import PageState
from app.palette import GROUND, RGB
from app.pictures.predictor import Prediction, Predictor
from app.pictures.shown_photo import shown_photo
from app.stage import SIZE, Stage
from app.viser_bridge.theme import Theme
from fairing.camera import Camera
from fairing.scene import Scene

MOVED = 1e-3  # of the scene's size, or radians: beyond this the user has left the camera's pose


@dataclass(frozen=True)
class Fit:
    """How a photo stands in a window.

    Attributes:
        fov: vertical field of view of the window's camera, radians.
        photo_from_window: (2, 3) affine: a photo's pixel of a window's pixel, both counted from centre to centre.
    """

    fov: float
    photo_from_window: np.ndarray


def fit_photo(camera: Camera, width: int, height: int) -> Fit:
    """Fit the whole photo into a window whose camera has its principal point in the middle and square pixels.

    Unequal focal lengths, skew and a principal point off the middle are taken care of by an affine map of the photo.
    """
    K = camera.K
    w, h = camera.width, camera.height
    corners = np.array([[-0.5, -0.5, 1], [w - 0.5, -0.5, 1], [-0.5, h - 0.5, 1], [w - 0.5, h - 0.5, 1]])
    reach = np.abs((np.linalg.inv(K) @ corners.T)[:2]).max(axis=1)
    focal = min(width / 2 / reach[0], height / 2 / reach[1])
    A = K[:2, :2] / focal
    middle = np.array([width / 2 - 0.5, height / 2 - 0.5])
    return Fit(float(2 * np.arctan(height / 2 / focal)), np.column_stack([A, K[:2, 2] - A @ middle]))


def photo_behind(photo: np.ndarray, fit: Fit, width: int, height: int, ground: RGB) -> np.ndarray:
    """(height, width, 3) uint8: the photo as the window's background, `ground` around it."""
    shrink = 1 / max(1.0, float(np.linalg.norm(fit.photo_from_window[:, 0])))
    M = fit.photo_from_window.copy()
    if shrink < 0.75:  # the affine map reads single pixels; average first
        size = (max(1, round(photo.shape[1] * shrink)), max(1, round(photo.shape[0] * shrink)))
        scale = np.array([size[0] / photo.shape[1], size[1] / photo.shape[0]])
        photo = cv2.resize(photo, size, interpolation=cv2.INTER_AREA)
        M = M * scale[:, None]
        M[:, 2] += 0.5 * (scale - 1)
    return cv2.warpAffine(
        photo,
        M,
        (width, height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=ground,
    )


class CameraView:
    """Takes one browser into a camera and back."""

    def __init__(
        self, client: viser.ClientHandle, stage: Stage, scene: Scene, theme: Theme, on_ready: Callable[[], None]
    ) -> None:
        self._theme = theme
        self._predictor = Predictor(scene, on_ready)
        self._share, self._swipes = 0.0, False
        self._fitted: tuple[Fit, int, int] | None = None
        self._laid: tuple[Prediction | None, float, bool] | None = None
        self._client, self._stage, self._scene = client, stage, scene
        self._inside: int | None = None
        self._outside: tuple[np.ndarray, np.ndarray, np.ndarray, float] | None = None
        self._window = (0, 0)
        self._arrived = False
        self._placing = threading.Lock()  # or a fit to an old window could overtake the one to the new

    @property
    def inside(self) -> int | None:
        """The camera looked through."""
        return self._inside

    def renew(self) -> None:
        """The theme has changed: the ground around a photo is dark or light."""
        if self._inside is not None:
            self._place()

    def enter(self, view_id: int) -> None:
        """Look through a camera."""
        self._scene.views[view_id].photo.load()  # before anything changes: it may be unreadable
        camera = self._client.camera
        if self._inside is None:
            self._outside = (
                np.array(camera.position),
                np.array(camera.look_at),
                np.array(camera.up_direction),
                float(camera.fov),
            )
        self._inside = view_id
        self._place()

    def leave(self) -> None:
        """Back to where the user stood before."""
        self._forget()
        if self._outside is not None:
            position, target, up, fov = self._outside
            with self._client.atomic():
                self._client.camera.up_direction = up
                self._client.camera.position = position
                self._client.camera.look_at = target
                self._client.camera.fov = fov
            self._outside = None

    def lay_over(self, state: RunState, vertices: np.ndarray, view: PageState) -> None:
        """Lay the model over the photo: what the other photos and a mesh at vertices (n, 3), world units, predict."""
        view_id = self._inside
        if view_id is None:
            return
        if view.model_share > 0 and state.activity is Activity.PAUSED:
            self._predictor.request(view_id, vertices)
        with self._placing:
            self._share, self._swipes = view.model_share, view.swipes
            if self._inside == view_id:
                self._lay_behind(view_id)

    def close(self) -> None:
        """The browser is gone."""
        self._predictor.close()

    def follow(self) -> bool:
        """Fit the photo to a resized window. Returns whether the user has moved out of the camera's pose."""
        if self._inside is None:
            return False
        camera = self._client.camera
        if (camera.image_width, camera.image_height) != self._window:
            self._place()
            return False
        wxyz, position = pose(self._scene.views[self._inside].camera, self._stage)
        turned = 2 * float(np.arccos(np.clip(abs(np.dot(wxyz, camera.wxyz)), 0, 1)))
        is_there = bool(np.linalg.norm(camera.position - position) < MOVED * SIZE and turned < MOVED)
        # Poses from before the move may still be on their way: only who has arrived can leave.
        has_left = self._arrived and not is_there
        self._arrived |= is_there
        return has_left

    def stay(self) -> None:
        """Give up the camera, but not the place: the user has begun to look around."""
        self._forget()
        with self._client.atomic():
            self._client.camera.up_direction = self._stage.up
        self._outside = None

    def _forget(self) -> None:
        self._inside = None
        self._client.scene.set_background_image(None)

    def _place(self) -> None:
        with self._placing:
            if self._inside is not None:
                self._fit(self._inside)

    def _fit(self, view_id: int) -> None:
        view = self._scene.views[view_id]
        width, height = int(self._client.camera.image_width), int(self._client.camera.image_height)
        self._window = (width, height)
        self._arrived = False
        fit = fit_photo(view.camera, width, height)
        wxyz, position = pose(view.camera, self._stage)
        right, down, ahead = viser.transforms.SO3(wxyz).as_matrix().T
        depth = max(float(-position @ ahead), 0.1 * SIZE)  # who turns the view from here turns it about the mesh
        camera = self._client.camera
        # viser sends only what differs from the browser's last report, and that may be older than our own last word:
        # everything is set to something else first.
        with self._client.atomic():
            for up, eye, target, fov in (
                (right, position + SIZE, position + SIZE + right, fit.fov / 2),
                (-down, position, position + depth * ahead, fit.fov),
            ):
                camera.position = eye
                camera.look_at = target
                camera.up_direction = up
                camera.fov = fov
        self._fitted, self._laid = (fit, width, height), None
        self._lay_behind(view_id)

    def _lay_behind(self, view_id: int) -> None:
        """The photo, with as much of the model over it as asked for; sent only when it differs."""
        found = self._predictor.newest
        found = found if found is not None and found.view_id == view_id and self._share > 0 else None
        wanted = (found, self._share, self._swipes) if found is not None else (None, 0.0, False)
        if self._fitted is None or wanted == self._laid:
            return
        self._laid = wanted
        picture = shown_photo(self._scene.views[view_id])
        if found is not None:
            picture = (found.beside if self._swipes else found.over)(picture, self._share)
        behind = photo_behind(picture, *self._fitted, GROUND[0 if self._theme.is_dark else 1])
        self._client.scene.set_background_image(behind, format="jpeg", jpeg_quality=90)

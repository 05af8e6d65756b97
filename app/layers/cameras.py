"""Cameras layer: a frustum with its photo for every camera. A click on a frustum looks through the camera."""

from collections.abc import Callable

import cv2
import numpy as np
import viser
import viser.transforms

from app.background_worker import BackgroundWorker
from app.debugger.run_state import RunState
from app.page_state.page_state import PageState
from app.palette import CAMERA
from app.pictures.shown_photo import shown_photo
from app.stage import Stage
from app.viser_bridge.frustum_fading import fade_frusta_before
from app.viser_bridge.node_events import BackgroundClicks
from fairing.camera import Camera
from fairing.errors import InputError
from fairing.scene import Scene

MISSING = 60  # grey level of a photo that cannot be read
THUMBNAIL = 320  # px, the longer side


def pose(camera: Camera, stage: Stage) -> tuple[np.ndarray, np.ndarray]:
    """Orientation (4,) as a quaternion wxyz and position (3,) of a camera, page units."""
    world_from_camera = camera.camera_from_world[:, :3].T
    return viser.transforms.SO3.from_matrix(world_from_camera).wxyz, (camera.center - stage.origin) * stage.scale


class Thumbnails:
    """Thumbnails of the photos, decoded once for all browsers on a background thread."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._images: dict[int, np.ndarray] = {}
        self._worker = BackgroundWorker()

    def send(self, view_id: int, take: Callable[[np.ndarray], None]) -> None:
        """Pass the thumbnail of a photo, (h, w, 3) uint8, to `take` on the background thread."""
        self._worker.post((take, view_id), lambda: self._image(view_id), take)

    def close(self) -> None:
        self._worker.close()

    def _image(self, view_id: int) -> np.ndarray:
        if view_id not in self._images:
            view = self._scene.views[view_id]
            try:
                pixels = shown_photo(view)
            except InputError:  # the photo was removed since the scene was opened; its camera is shown in grey
                pixels = np.full((view.camera.height, view.camera.width, 3), MISSING, dtype=np.uint8)
            height, width = pixels.shape[:2]
            factor = min(1.0, THUMBNAIL / max(width, height))
            size = (max(1, round(width * factor)), max(1, round(height * factor)))
            self._images[view_id] = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
        return self._images[view_id]


class CamerasLayer:
    """One frustum per camera; the photos arrive later. Hidden while a camera is looked through.

    Frusta that stand in front of the mesh are faint.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        stage: Stage,
        scene: Scene,
        thumbnails: Thumbnails,
        on_enter: Callable[[int], None],
        background: BackgroundClicks | None = None,
    ) -> None:
        self._root = client.scene.add_frame("/cameras", show_axes=False)
        for view_id, view in enumerate(scene.views):
            K, camera = view.camera.K, view.camera
            wxyz, position = pose(camera, stage)
            frustum = client.scene.add_camera_frustum(
                f"/cameras/{view_id}",
                fov=float(2 * np.arctan(camera.height / (2 * K[1, 1]))),
                aspect=float(camera.width / K[0, 0] / (camera.height / K[1, 1])),
                scale=stage.camera_scale,
                thickness=1.5,
                thickness_units="screen",
                color=CAMERA,
                format="jpeg",
                jpeg_quality=85,
                wxyz=wxyz,
                position=position,
                cast_shadow=False,
                receive_shadow=False,
            )

            @frustum.on_click
            def _(_event: viser.SceneNodePointerEvent, view_id: int = view_id) -> None:
                on_enter(view_id)

            if background is not None:
                background.ignore_clicks_on(frustum)
            thumbnails.send(view_id, lambda image, frustum=frustum: setattr(frustum, "image", image))
        fade_frusta_before(client, "/mesh/now", "/cameras", len(scene.views), stage.camera_scale)

    def show(self, state: RunState, page_state: PageState) -> None:
        self.set_visible(page_state.shows("cameras") and page_state.entered is None)

    def set_visible(self, visible: bool) -> None:
        self._root.visible = visible

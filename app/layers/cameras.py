"""Cameras layer: a frustum with its photo for every camera. A click on a frustum looks through the camera."""

import threading
from collections.abc import Callable

import cv2
import numpy as np
import viser
import viser.transforms

from app.background_worker import BackgroundWorker
from app.debugger.run_state import RunState
from app.layers.obstruction import covering
from app.page_state.page_state import LARGE_MESH, PageState
from app.palette import CAMERA, RGB
from app.pictures.shown_photo import shown_photo
from app.stage import Stage
from app.viser_bridge.node_events import BackgroundClicks
from fairing.camera import Camera
from fairing.errors import InputError
from fairing.scene import Scene

LARGE_MESH_SCALE = 0.5  # of frusta beside a mesh of more than `LARGE_MESH` vertices
OUTLINE_SCALE = 0.4  # of a frustum that would cover the mesh
REACH = 2.0  # radius of the sphere around a frustum, in its `scale`
MISSING = 60  # grey level of a photo that cannot be read
THUMBNAIL = 320  # px, the longer side


def pose(camera: Camera, stage: Stage) -> tuple[np.ndarray, np.ndarray]:
    """Orientation (4,) as a quaternion wxyz and position (3,) of a camera, page units."""
    world_from_camera = camera.camera_from_world[:, :3].T
    return viser.transforms.SO3.from_matrix(world_from_camera).wxyz, (camera.center - stage.origin) * stage.scale


def frustum_scale(stage: Stage, scene: Scene) -> float:
    """Size of a frustum, page units."""
    return stage.camera_scale * (LARGE_MESH_SCALE if len(scene.mesh.vertices) > LARGE_MESH else 1.0)


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
    """One frustum with its photo per camera; the photos arrive later. Hidden while a camera is looked through.

    A frustum that would cover the mesh is drawn small and without its photo; what covers the mesh follows the viewpoint.
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
        self._client, self._stage = client, stage
        used = np.unique(scene.mesh.faces)
        self._mesh_points = stage.page_from_world(scene.mesh.vertices[used]).astype(np.float64)
        self._root = client.scene.add_frame("/cameras", show_axes=False)
        scale = frustum_scale(stage, scene)
        self._frusta: list[viser.CameraFrustumHandle] = []
        self._outlines: list[viser.CameraFrustumHandle] = []
        for view_id, view in enumerate(scene.views):
            for frusta, name, size, thickness in (
                (self._frusta, "", scale, 1.5),
                (self._outlines, "outline_", OUTLINE_SCALE * scale, 1.0),
            ):
                frustum = add_frustum(client, f"/cameras/{name}{view_id}", view.camera, stage, size, thickness)
                frusta.append(frustum)

                @frustum.on_click
                def _(_event: viser.SceneNodePointerEvent, view_id: int = view_id) -> None:
                    on_enter(view_id)

                if background is not None:
                    background.ignore_clicks_on(frustum)
            thumbnails.send(view_id, lambda image, frustum=self._frusta[-1]: setattr(frustum, "image", image))
        self._radius = REACH * scale
        self._middles = stage.camera_centers + 0.5 * self._radius * np.array([_forward(v.camera) for v in scene.views])
        self._lock = threading.Lock()
        self._covering: np.ndarray | None = None
        self._uncover(stage.eye)
        client.camera.on_update(lambda _: self._uncover(np.array(client.camera.position)))

    def show(self, state: RunState, page_state: PageState) -> None:
        self.set_visible(page_state.shows("cameras") and page_state.entered is None)

    def set_visible(self, visible: bool) -> None:
        self._root.visible = visible

    def _uncover(self, eye: np.ndarray) -> None:
        """Reduce the frusta that would cover the mesh from here to small outlines."""
        found = covering(eye, self._mesh_points, self._middles, self._radius)
        with self._lock:
            before, self._covering = self._covering, found
            changed = np.arange(len(found)) if before is None else np.flatnonzero(found != before)
            for k in changed:
                self._frusta[k].visible, self._outlines[k].visible = not found[k], bool(found[k])


def add_frustum(
    client: viser.ClientHandle,
    name: str,
    camera: Camera,
    stage: Stage,
    scale: float,
    thickness: float,
    color: RGB = CAMERA,
) -> viser.CameraFrustumHandle:
    """A frustum at the place of a camera.

    Args:
        scale: page units. thickness: px.
    """
    wxyz, position = pose(camera, stage)
    return client.scene.add_camera_frustum(
        name,
        fov=float(2 * np.arctan(camera.height / (2 * camera.K[1, 1]))),
        aspect=float(camera.width / camera.K[0, 0] / (camera.height / camera.K[1, 1])),
        scale=scale,
        thickness=thickness,
        thickness_units="screen",
        color=color,
        format="jpeg",
        jpeg_quality=85,
        wxyz=wxyz,
        position=position,
        cast_shadow=False,
        receive_shadow=False,
    )


def _forward(camera: Camera) -> np.ndarray:
    """(3,) float: the unit direction in which a camera looks, world and page axes."""
    return camera.camera_from_world[2, :3] / np.linalg.norm(camera.camera_from_world[2, :3])

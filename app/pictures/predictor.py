"""Photo prediction: one photo rendered from the model and the other photos, by a background worker."""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.background_worker import BackgroundWorker
from fairing.judge.render import Renderer
from fairing.scene import Scene

SEAM = 236  # grey level of the line between photo and prediction


@dataclass(frozen=True, eq=False)
class Prediction:
    """A photo predicted from the mesh and the other photos.

    Attributes:
        view_id: of the photo.
        vertices: (n, 3) float, world units: vertices of the mesh.
        image: (h, w, 3) float32, RGB grey levels.
        is_known: (h, w) bool: pixels that the other photos predict.
    """

    view_id: int
    vertices: np.ndarray
    image: np.ndarray
    is_known: np.ndarray

    def over(self, photo: np.ndarray, share: float) -> np.ndarray:
        """(h, w, 3) uint8: blend of the photo (h, w, 3) and the prediction, weighted by `share`, 0 to 1, where known."""
        weight = (share * self.is_known)[..., None].astype(np.float32)
        return np.clip(photo + weight * (self.image - photo) + 0.5, 0, 255).astype(np.uint8)

    def beside(self, photo: np.ndarray, share: float) -> np.ndarray:
        """(h, w, 3) uint8: the photo at the left and the prediction at the right, on a `share`, 0 to 1, of the width."""
        shown, width = self.over(photo, 1.0), photo.shape[1]
        seam, thickness = round((1 - share) * width), max(1, width // 400)
        shown[:, :seam] = photo[:, :seam]
        shown[:, max(0, seam - thickness) : seam + thickness] = SEAM
        return shown


class Predictor:
    """Renders the photo of the latest request."""

    def __init__(self, scene: Scene, on_ready: Callable[[], None]) -> None:
        self._scene, self._on_ready = scene, on_ready
        self._worker = BackgroundWorker(name="prediction")
        self._requested: tuple[int, np.ndarray] | None = None
        self._lock = threading.Lock()
        self.newest: Prediction | None = None

    def request(self, view_id: int, vertices: np.ndarray) -> None:
        """Render a photo from vertices (n, 3), identified by the array; `on_ready` is called when it is done."""
        with self._lock:
            if self._requested is None or self._requested[0] != view_id or self._requested[1] is not vertices:
                self._requested = (view_id, vertices)
                self._worker.post("prediction", lambda: self._render(view_id, vertices), self._store)

    def close(self) -> None:
        self._worker.close(timeout=0)

    def _render(self, view_id: int, vertices: np.ndarray) -> Prediction:
        found = Renderer(self._scene, vertices).render(view_id)
        camera = self._scene.views[view_id].camera
        return Prediction(view_id, vertices, *found.at_size(camera.width, camera.height))

    def _store(self, prediction: Prediction | Exception) -> None:
        if isinstance(prediction, Exception):
            # A photo may have been removed; the debugger works without predictions.
            logging.getLogger(__name__).error("a photo could not be predicted", exc_info=prediction)
            return
        self.newest = prediction
        self._on_ready()

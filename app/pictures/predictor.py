"""The photos as the model predicts them from the other photos, rendered on a thread of its own."""

import logging
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from fairing.judge.render import Renderer
from fairing.scene import Scene

SEAM = 236  # grey level of the line between photo and prediction


@dataclass(frozen=True, eq=False)
class Prediction:
    """One photo as the model predicts it.

    Attributes:
        view_id: of the photo.
        vertices: (n, 3) float, world units: the mesh it was rendered from.
        image: (h, w, 3) float32, RGB grey levels.
        is_known: (h, w) bool: where the other photos say anything.
    """

    view_id: int
    vertices: np.ndarray
    image: np.ndarray
    is_known: np.ndarray

    def over(self, photo: np.ndarray, share: float) -> np.ndarray:
        """(h, w, 3) uint8: the photo with a share, 0 to 1, of the prediction laid over it where that is known."""
        weight = (share * self.is_known)[..., None].astype(np.float32)
        return np.clip(photo + weight * (self.image - photo) + 0.5, 0, 255).astype(np.uint8)

    def beside(self, photo: np.ndarray, share: float) -> np.ndarray:
        """(h, w, 3) uint8: the photo, and right of a line the prediction, on a share, 0 to 1, of the width."""
        shown, width = self.over(photo, 1.0), photo.shape[1]
        seam, thickness = round((1 - share) * width), max(1, width // 400)
        shown[:, :seam] = photo[:, :seam]
        shown[:, max(0, seam - thickness) : seam + thickness] = SEAM
        return shown


class Predictor:
    """Renders the newest that was asked for."""

    def __init__(self, scene: Scene, on_ready: Callable[[], None]) -> None:
        self._scene, self._on_ready = scene, on_ready
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="prediction")
        self._wanted: tuple[int, np.ndarray] | None = None
        self._lock = threading.Lock()
        self.newest: Prediction | None = None

    def ask(self, view_id: int, vertices: np.ndarray) -> None:
        """Have a photo rendered from vertices (n, 3), told apart by the array; `on_ready` is called when it is done."""
        with self._lock:
            if self._wanted is None or self._wanted[0] != view_id or self._wanted[1] is not vertices:
                self._wanted = (view_id, vertices)
                self._pool.submit(self._render, self._wanted)

    def close(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _render(self, wanted: tuple[int, np.ndarray]) -> None:
        if wanted is not self._wanted:
            return  # something newer waits
        view_id, vertices = wanted
        try:
            found = Renderer(self._scene, vertices).render(view_id)
        except Exception:  # a photo may be gone; the debugger works without predictions
            logging.getLogger(__name__).exception("a photo could not be predicted")
            return
        camera = self._scene.views[view_id].camera
        self.newest = Prediction(view_id, vertices, *found.at_size(camera.width, camera.height))
        self._on_ready()

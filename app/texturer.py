"""Paints the mesh from its photos on a thread of its own, whenever a run rests."""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from app.atlas import PhotoTexture
from app.stage import SIZE, Stage
from fairing.io.glb import write_glb
from fairing.scene import Scene

JPEG_QUALITY = 92
BEHIND = 0.0015 * SIZE


@dataclass(frozen=True, eq=False)
class TexturedMesh:
    """A painted mesh as the page wants it.

    Attributes:
        vertices: (n, 3) float, world units: the positions it was painted at.
        glb: the file.
    """

    vertices: np.ndarray
    glb: bytes


class Texturer:
    """Keeps one painted mesh, the newest asked for."""

    def __init__(self, scene: Scene, stage: Stage, on_ready: Callable[[], None]) -> None:
        self._scene, self._stage, self._on_ready = scene, stage, on_ready
        self._wanted: np.ndarray | None = None
        self._changed = threading.Condition()
        self._closing = False
        self.newest: TexturedMesh | None = None
        self.problem = ""
        self._thread = threading.Thread(target=self._work, name="texture", daemon=True)
        self._thread.start()

    def request(self, vertices: np.ndarray) -> None:
        """Ask for the mesh at these positions; what was asked before and not begun is dropped."""
        with self._changed:
            if self._wanted is vertices or (self.newest is not None and self.newest.vertices is vertices):
                return
            self._wanted = vertices
            self._changed.notify_all()

    def close(self) -> None:
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._thread.join(timeout=10)

    def _work(self) -> None:
        texture: PhotoTexture | None = None
        done: np.ndarray | None = None
        while True:
            with self._changed:
                self._changed.wait_for(lambda done=done: self._closing or self._wanted is not done)
                if self._closing:
                    return
                done = self._wanted
            if done is None:
                continue
            try:
                texture = texture or PhotoTexture(self._scene)
                self.newest = self._paint(texture, done)
                self.problem = ""
            except Exception as error:  # a photo may be gone; the debugger works without texture
                logging.getLogger(__name__).exception("the texture could not be painted")
                self.problem = f"no texture: {error}"
            self._on_ready()

    def _behind_its_edges(self, vertices: np.ndarray) -> np.ndarray:
        """(n, 3) float, page units: a little farther from the photos, so that lines at the true place lie in front."""
        points = self._stage.page_from_world(vertices).astype(np.float64)
        corners = points[self._scene.mesh.faces]
        face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = np.zeros_like(points)
        for k in range(3):
            np.add.at(normals, self._scene.mesh.faces[:, k], face_normals)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        centers = self._stage.page_from_world(np.array([view.camera.center for view in self._scene.views]))
        towards = np.sign(np.median(np.einsum("mc,mc->m", face_normals, centers.mean(0) - corners.mean(1))))
        return points - towards * BEHIND * normals

    def _paint(self, texture: PhotoTexture, vertices: np.ndarray) -> TexturedMesh:
        image = texture.paint(vertices)
        _, encoded = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        corners = self._behind_its_edges(vertices)[texture.faces].reshape(-1, 3)
        faces = np.arange(len(corners)).reshape(-1, 3)
        return TexturedMesh(vertices, write_glb(corners, faces, texture.layout.uv, encoded.tobytes()))

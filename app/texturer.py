"""Paints meshes from the photos on a thread of its own."""

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from app.set_back import set_back
from app.stage import Stage
from fairing.io.glb import write_glb
from fairing.scene import Scene
from fairing.texture import textured_model

JPEG_QUALITY = 92
LARGEST = 2048  # texels: what a browser unpacks within a second even without a graphics card
KEPT = 8  # painted meshes, so that going back and forth between shapes paints nothing again


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
    """Paints what pages look at; of what one page has asked for, only the newest."""

    def __init__(self, scene: Scene, stage: Stage, on_ready: Callable[[], None]) -> None:
        self._scene, self._stage, self._on_ready = scene, stage, on_ready
        self._wanted: dict[int, np.ndarray] = {}
        self._kept: OrderedDict[int, TexturedMesh] = OrderedDict()
        self._changed = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._work, name="texture", daemon=True)
        self._thread.start()

    def painted(self, asker: object, vertices: np.ndarray) -> TexturedMesh | None:
        """The mesh at these positions (n, 3), or None: then it is painted and `on_ready` is called.

        Positions are told apart by the array, not by its content.
        """
        with self._changed:
            found = self._kept.get(id(vertices))
            if found is not None:
                self._kept.move_to_end(id(vertices))
                self._wanted.pop(id(asker), None)
            elif self._wanted.get(id(asker)) is not vertices:
                self._wanted[id(asker)] = vertices
                self._changed.notify_all()
            return found

    def close(self) -> None:
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._thread.join(timeout=10)

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closing or self._wanted)
                if self._closing:
                    return
                asker, vertices = next(iter(self._wanted.items()))
            painted = None
            try:
                painted = self._paint(vertices)
            except Exception:  # a photo may be gone; the debugger works without texture
                logging.getLogger(__name__).exception("the texture could not be painted")
            with self._changed:
                if self._wanted.get(asker) is vertices:
                    del self._wanted[asker]
                if painted is not None:
                    self._kept[id(vertices)] = painted
                    while len(self._kept) > KEPT:
                        self._kept.popitem(last=False)
            if painted is not None:
                self._on_ready()

    def _paint(self, vertices: np.ndarray) -> TexturedMesh:
        model = textured_model(self._scene, vertices, LARGEST)
        _, encoded = cv2.imencode(".jpg", model.image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        corners = set_back(vertices, self._scene, self._stage)[model.faces].reshape(-1, 3)
        faces = np.arange(len(corners)).reshape(-1, 3)
        return TexturedMesh(vertices, write_glb(corners, faces, model.uv.reshape(-1, 2), encoded.tobytes()))

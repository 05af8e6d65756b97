"""Paints meshes from the photos on threads of their own: one image, or one that follows the eye."""

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import cv2
import numpy as np

from app.background_worker import Background
from app.stage import Stage
from app.surface_offset import set_back
from fairing.io.glb import write_glb
from fairing.scene import Scene
from fairing.texture import AtlasLayout, EigenTexture, eigen_texture, textured_model
from fairing.texture.eigen import GUTTER

JPEG_QUALITY = 92
LARGEST = 2048  # texels: what a browser unpacks within a second even without a graphics card
LARGEST_VIEW_DEPENDENT = 1024  # texels: sent anew several times a second
MOST_FACES, MOST_FACES_VIEW_DEPENDENT = (
    AtlasLayout.most_faces(LARGEST),
    AtlasLayout.most_faces(LARGEST_VIEW_DEPENDENT, GUTTER),
)
KEPT_VIEW_DEPENDENT = 3  # these hold their eigenspaces, up to 50 MB each
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


@dataclass(frozen=True, eq=False)
class ViewDependentMesh:
    """A mesh painted for every eye.

    Attributes:
        vertices: (n, 3) float, world units: the positions it was painted at.
        texture: the image for an eye.
        corners: (3 m, 3) float, page units: where the faces' corners are drawn.
    """

    vertices: np.ndarray
    texture: EigenTexture
    corners: np.ndarray

    def seen_from(self, eye: np.ndarray) -> TexturedMesh:
        """As an eye at (3,), world units, sees it."""
        image = self.texture.image_for(eye)
        return TexturedMesh(self.vertices, _glb(self.corners, self.texture.layout.uv, image))


Painted = TypeVar("Painted", TexturedMesh, ViewDependentMesh)


class Painter(Generic[Painted]):
    """Paints what pages look at; of what one page has asked for, only the newest."""

    def __init__(self, paint: Callable[[np.ndarray], Painted], kept: int, on_ready: Callable[[], None]) -> None:
        self._paint, self._most_kept, self._on_ready = paint, kept, on_ready
        self._wanted: dict[int, np.ndarray] = {}
        self._kept: OrderedDict[int, Painted] = OrderedDict()
        self._failed: np.ndarray | None = None
        self._changed = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._work, name="texture", daemon=True)
        self._thread.start()

    def painted(self, asker: object, vertices: np.ndarray) -> Painted | None:
        """The mesh at these positions (n, 3), or None: then it is painted and `on_ready` is called.

        Positions are told apart by the array, not by its content.
        """
        with self._changed:
            found = self._kept.get(id(vertices))
            if found is not None:
                self._kept.move_to_end(id(vertices))
                self._wanted.pop(id(asker), None)
            elif vertices is not self._failed and self._wanted.get(id(asker)) is not vertices:
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
                if painted is None:  # asking again, as pages do with every state, would not help
                    self._failed = vertices
                else:
                    self._kept[id(vertices)] = painted
                    while len(self._kept) > self._most_kept:
                        self._kept.popitem(last=False)
            if painted is not None:
                self._on_ready()


class Texturer:
    """The painters that all pages share.

    Attributes:
        static: paints meshes with one image.
        by_eye: paints meshes whose image depends on the eye.
        frames: makes the images for an eye, of those one page wants only the newest.
    """

    def __init__(self, scene: Scene, stage: Stage, on_ready: Callable[[], None]) -> None:
        self._scene, self._stage = scene, stage
        self.static = Painter(lambda vertices: paint(scene, stage, vertices), KEPT, on_ready)
        self.view_dependent = Painter(self._paint_view_dependent, KEPT_VIEW_DEPENDENT, on_ready)
        self.frames = Background(lambda: None)

    def close(self) -> None:
        for worker in (self.static, self.view_dependent, self.frames):
            worker.close()

    def _paint_view_dependent(self, vertices: np.ndarray) -> ViewDependentMesh:
        texture = eigen_texture(self._scene, vertices, LARGEST_VIEW_DEPENDENT)
        return ViewDependentMesh(vertices, texture, _corners(self._scene, self._stage, vertices))


def paint(scene: Scene, stage: Stage, vertices: np.ndarray) -> TexturedMesh:
    """The mesh of a scene at vertices (n, 3), world units, with one image."""
    model = textured_model(scene, vertices, LARGEST)
    return TexturedMesh(vertices, _glb(_corners(scene, stage, vertices), model.uv, model.image))


def _corners(scene: Scene, stage: Stage, vertices: np.ndarray) -> np.ndarray:
    """(3 m, 3) float, page units: where the faces' corners are drawn."""
    return set_back(vertices, scene, stage)[scene.mesh.faces].reshape(-1, 3)


def _glb(corners: np.ndarray, uv: np.ndarray, image: np.ndarray) -> bytes:
    _, encoded = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    faces = np.arange(len(corners)).reshape(-1, 3)
    return write_glb(corners, faces, uv.reshape(-1, 2), encoded.tobytes())

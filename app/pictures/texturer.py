"""Texturer: computes textures of meshes from the photos on background threads, static or view-dependent."""

import logging
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import cv2
import numpy as np

from app.background_worker import BackgroundWorker
from app.stage import Stage
from app.surface_offset import set_back
from fairing.io.glb import write_glb
from fairing.scene import Scene
from fairing.texture import AtlasLayout, EigenTexture, eigen_texture, textured_model
from fairing.texture.eigen import GUTTER

JPEG_QUALITY = 92
LARGEST = 2048  # texels per side: a browser unpacks it within 1 s even without a graphics card
# Texels per side: the smallest that holds the faces. (ledger: textures during a run)
LARGEST_DRAFTS = (512, 1024, LARGEST)
LARGEST_VIEW_DEPENDENT = 1024  # texels per side: sent several times per second
MOST_FACES, MOST_FACES_VIEW_DEPENDENT = (
    AtlasLayout.most_faces(LARGEST),
    AtlasLayout.most_faces(LARGEST_VIEW_DEPENDENT, GUTTER),
)
KEPT_VIEW_DEPENDENT = 3  # cached meshes; each holds its eigenspaces, up to 50 MB
KEPT = 8  # cached meshes, so that switching between start, now and truth paints nothing again


@dataclass(frozen=True, eq=False)
class TexturedMesh:
    """A mesh with a static texture.

    Attributes:
        vertices: (n, 3) float, world units: the positions it was painted at.
        glb: contents of a GLB file, vertices in page units.
        cost: processor time of its painting, s.
    """

    vertices: np.ndarray
    glb: bytes
    cost: float = 0.0


@dataclass(frozen=True, eq=False)
class ViewDependentMesh:
    """A mesh with a view-dependent texture.

    Attributes:
        vertices: (n, 3) float, world units: the positions it was painted at.
        texture: renders the texture for a viewpoint.
        corners: (3 m, 3) float, page units: positions at which the corners of the faces are drawn.
    """

    vertices: np.ndarray
    texture: EigenTexture
    corners: np.ndarray

    def seen_from(self, eye: np.ndarray) -> TexturedMesh:
        """The mesh with its texture for a viewpoint (3,), world units."""
        image = self.texture.image_for(eye)
        return TexturedMesh(self.vertices, _glb(self.corners, self.texture.layout.uv, image))


Painted = TypeVar("Painted", TexturedMesh, ViewDependentMesh)


class Painter(Generic[Painted]):
    """Paints the meshes that pages show, on a thread of its own; of each page's requests, only the latest is painted."""

    def __init__(self, paint: Callable[[np.ndarray], Painted], kept: int, on_ready: Callable[[], None]) -> None:
        self._paint, self._most_kept, self._on_ready = paint, kept, on_ready
        self._requested: dict[int, np.ndarray] = {}
        self._kept: OrderedDict[int, Painted] = OrderedDict()
        self._failed: np.ndarray | None = None
        self._lock = threading.Lock()
        self._worker = BackgroundWorker(name="texture")

    def painted(self, requester: object, vertices: np.ndarray) -> Painted | None:
        """The mesh at these positions (n, 3), or None: then it is painted and `on_ready` is called.

        Positions are identified by the array, not by its content.
        """
        key = id(requester)
        with self._lock:
            found = self._kept.get(id(vertices))
            if found is not None:
                self._kept.move_to_end(id(vertices))
                self._requested.pop(key, None)
                self._worker.cancel(key)
            elif vertices is not self._failed and self._requested.get(key) is not vertices:
                self._requested[key] = vertices
                self._worker.post(key, lambda: self._paint(vertices), lambda found: self._store(key, vertices, found))
            return found

    def has_failed(self, vertices: np.ndarray) -> bool:
        """Whether the mesh at these positions could not be painted."""
        return vertices is self._failed

    def close(self) -> None:
        self._worker.close()

    def _store(self, key: int, vertices: np.ndarray, painted: Painted | Exception) -> None:
        with self._lock:
            if self._requested.get(key) is vertices:
                del self._requested[key]
            if isinstance(painted, Exception):  # pages request it with every state; another attempt would fail, too
                self._failed = vertices
            else:
                self._kept[id(vertices)] = painted
                while len(self._kept) > self._most_kept:
                    self._kept.popitem(last=False)
        if isinstance(painted, Exception):
            # A photo may have been removed; the debugger works without the texture.
            logging.getLogger(__name__).error("the texture could not be painted", exc_info=painted)
        else:
            self._on_ready()


class Texturer:
    """The painters shared by all pages.

    Attributes:
        static: paints meshes with static textures.
        draft: paints them with smaller textures, several times faster, while a run moves the mesh.
        view_dependent: paints meshes with view-dependent textures.
        frames: renders the textures for a viewpoint; of each page's requests only the latest.
    """

    def __init__(self, scene: Scene, stage: Stage, on_ready: Callable[[], None], wait: Callable[[], None]) -> None:
        """Args:
        on_ready: called when a mesh has been painted.
        wait: called on the painting thread before each mesh; returns when the first one can be painted.
        """
        self._scene, self._stage, self._wait = scene, stage, wait
        self.static = Painter(self._paint_static, KEPT, on_ready)
        self.draft = Painter(self._paint_draft, KEPT, on_ready)
        self.view_dependent = Painter(self._paint_view_dependent, KEPT_VIEW_DEPENDENT, on_ready)
        self.frames = BackgroundWorker()

    def close(self) -> None:
        for worker in (self.static, self.draft, self.view_dependent, self.frames):
            worker.close()

    def _paint_static(self, vertices: np.ndarray) -> TexturedMesh:
        self._wait()
        return paint(self._scene, self._stage, vertices)

    def _paint_draft(self, vertices: np.ndarray) -> TexturedMesh:
        self._wait()
        n_faces = len(self._scene.mesh.faces)
        largest = next((size for size in LARGEST_DRAFTS if AtlasLayout.most_faces(size) >= n_faces), LARGEST)
        return paint(self._scene, self._stage, vertices, largest)

    def _paint_view_dependent(self, vertices: np.ndarray) -> ViewDependentMesh:
        texture = eigen_texture(self._scene, vertices, LARGEST_VIEW_DEPENDENT)
        return ViewDependentMesh(vertices, texture, _corners(self._scene, self._stage, vertices))


def paint(scene: Scene, stage: Stage, vertices: np.ndarray, largest: int = LARGEST) -> TexturedMesh:
    """The mesh of a scene at vertices (n, 3), world units, with a static texture of at most `largest` texels per side."""
    began = time.thread_time()
    model = textured_model(scene, vertices, largest)
    glb = _glb(_corners(scene, stage, vertices), model.uv, model.image)
    return TexturedMesh(vertices, glb, time.thread_time() - began)


def _corners(scene: Scene, stage: Stage, vertices: np.ndarray) -> np.ndarray:
    """(3 m, 3) float, page units: positions at which the corners of the faces are drawn."""
    return set_back(vertices, scene, stage)[scene.mesh.faces].reshape(-1, 3)


def _glb(corners: np.ndarray, uv: np.ndarray, image: np.ndarray) -> bytes:
    _, encoded = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    faces = np.arange(len(corners)).reshape(-1, 3)
    return write_glb(corners, faces, uv.reshape(-1, 2), encoded.tobytes())

"""The textured model seen from one of the cameras, without that camera's photo: does the model predict the photo?

A pixel's surface point is looked up in the other photos that see it; their colours are averaged robustly, each weighing
as much as it resolves the surface.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from fairing.camera import Camera
from fairing.rasterize import rasterize
from fairing.scene import Scene

# A point is hidden when something stands in front of it by more than this many pixels' worth of depth.
HIDDEN_DEPTH = 4.0
# Colours farther than this from the others, grey levels, are taken for a reflection or for something in the way.
OUTLIER = 20.0
ROBUST_ROUNDS = 3
MIN_SOURCES = 2


@dataclass(frozen=True, eq=False)
class RenderedView:
    """A photo as the model predicts it.

    Attributes:
        image: (h, w, 3) float32, RGB grey levels; 0 where nothing is known.
        n_sources: (h, w) int: photos that contributed.
    """

    image: np.ndarray
    n_sources: np.ndarray

    @property
    def is_known(self) -> np.ndarray:
        """(h, w) bool: at least two photos agreed on a colour."""
        return self.n_sources >= MIN_SOURCES


class Renderer:
    """Renders one state of a mesh into any of the scene's cameras from chosen photos.

    Args:
        vertices: (n, 3) float, world units.
    """

    def __init__(self, scene: Scene, vertices: np.ndarray) -> None:
        self._scene = scene
        self._vertices = vertices
        self._seen: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._photos: dict[int, np.ndarray] = {}

    def render(self, view: int, sources: Sequence[int] | None = None) -> RenderedView:
        """The model in the camera of a view.

        Args:
            sources: views to take the texture from; default: all others.
        """
        scene = self._scene
        camera = scene.views[view].camera
        sources = [v for v in range(len(scene.views)) if v != view] if sources is None else sources
        face_id, depth = self._depth(view)
        rows, columns = np.nonzero(face_id >= 0)
        face = face_id[rows, columns]
        points = _points(camera, columns, rows, depth[rows, columns])
        area = _areas(self._vertices, scene.mesh.faces, camera)
        colors = np.zeros((len(sources), len(rows), 3), dtype=np.float32)
        weights = np.zeros((len(sources), len(rows)), dtype=np.float32)
        for s, source in enumerate(sources):
            other = scene.views[source].camera
            resolved = _areas(self._vertices, scene.mesh.faces, other) / np.maximum(area, 1e-9)
            tolerance = HIDDEN_DEPTH / other.K[0, 0]
            _look_up(
                other.image_from_world, points, face, np.minimum(resolved, 1), *self._depth(source), tolerance,
                self._photo(source), colors[s], weights[s],
            )  # fmt: skip
        image = np.zeros((camera.height, camera.width, 3), dtype=np.float32)
        n_sources = np.zeros((camera.height, camera.width), dtype=np.int64)
        image[rows, columns] = robust_mean(colors, weights)
        n_sources[rows, columns] = (weights > 0).sum(axis=0)
        return RenderedView(image, n_sources)

    def _photo(self, view: int) -> np.ndarray:
        if view not in self._photos:
            self._photos[view] = self._scene.views[view].photo.load()
        return self._photos[view]

    def _depth(self, view: int) -> tuple[np.ndarray, np.ndarray]:
        if view not in self._seen:
            self._seen[view] = rasterize(self._vertices, self._scene.mesh.faces, self._scene.views[view].camera)
        return self._seen[view]


@njit(cache=True, nogil=True)
def _look_up(P, points, face, resolved, face_id, depth, tolerance, photo, color, weight):
    """Colour (q, 3) and weight (q,) that one photo gives points (q, 3); the weight stays 0 where it does not see them.

    Args:
        P: (3, 4) image_from_world.
        face: (q,) face of each point.
        resolved: (m,) the weight of a point of each face.
        face_id, depth: what the photo's camera sees.
        tolerance: depth by which something must stand in front to hide a point, as a fraction of the depth.
    """
    height, width = face_id.shape
    for q in range(points.shape[0]):
        a, b, c = points[q, 0], points[q, 1], points[q, 2]
        z = P[2, 0] * a + P[2, 1] * b + P[2, 2] * c + P[2, 3]
        if z <= 0:
            continue
        x = (P[0, 0] * a + P[0, 1] * b + P[0, 2] * c + P[0, 3]) / z
        y = (P[1, 0] * a + P[1, 1] * b + P[1, 2] * c + P[1, 3]) / z
        if not (1 <= x <= width - 2 and 1 <= y <= height - 2):
            continue
        nearest_y, nearest_x = int(y + 0.5), int(x + 0.5)
        # A neighbouring face of about the same depth is no occluder.
        if face_id[nearest_y, nearest_x] != face[q] and z - depth[nearest_y, nearest_x] > tolerance * z:
            continue
        weight[q] = resolved[face[q]]
        ix, iy = int(x), int(y)
        fx, fy = x - ix, y - iy
        for channel in range(3):
            upper = (1 - fx) * photo[iy, ix, channel] + fx * photo[iy, ix + 1, channel]
            lower = (1 - fx) * photo[iy + 1, ix, channel] + fx * photo[iy + 1, ix + 1, channel]
            color[q, channel] = (1 - fy) * upper + fy * lower


@njit(cache=True, nogil=True)
def robust_mean(colors, weights):
    """(q, 3) float32: mean of the colours (s, q, 3) with weights (s, q), outliers losing their weight; 0 without any.

    Begins at the median and reweights three times (Geman-McClure).
    """
    n_sources, n_points = weights.shape
    result = np.zeros((n_points, 3), dtype=np.float32)
    values = np.empty(n_sources)
    center = np.empty(3)
    for q in range(n_points):
        count = 0
        for channel in range(3):
            count = 0
            for s in range(n_sources):
                if weights[s, q] > 0:
                    # Insertion keeps the few values sorted.
                    at = count
                    while at > 0 and values[at - 1] > colors[s, q, channel]:
                        values[at] = values[at - 1]
                        at -= 1
                    values[at] = colors[s, q, channel]
                    count += 1
            center[channel] = 0.5 * (values[(count - 1) // 2] + values[count // 2]) if count > 0 else 0.0
        for _ in range(ROBUST_ROUNDS if count > 0 else 0):
            total, r, g, b = 0.0, 0.0, 0.0, 0.0
            for s in range(n_sources):
                if weights[s, q] <= 0:
                    continue
                squared = 0.0
                for channel in range(3):
                    squared += (colors[s, q, channel] - center[channel]) ** 2 / 3
                trust = weights[s, q] / (1 + squared / OUTLIER**2) ** 2
                total += trust
                r += trust * colors[s, q, 0]
                g += trust * colors[s, q, 1]
                b += trust * colors[s, q, 2]
            center[0], center[1], center[2] = r / total, g / total, b / total
        for channel in range(3):
            result[q, channel] = center[channel]
    return result


def _points(camera: Camera, x: np.ndarray, y: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """World points (q, 3) at pixels and depths."""
    M, t = camera.image_from_world[:, :3], camera.image_from_world[:, 3]
    rays = depth * np.stack([x, y, np.ones_like(x)])
    return np.ascontiguousarray(np.linalg.solve(M, rays - t[:, None]).T)


def _areas(vertices: np.ndarray, faces: np.ndarray, camera: Camera) -> np.ndarray:
    """(m,) float, px^2: area of every face in a photo; 0 behind the camera."""
    uv, depth = camera.project(vertices)
    a, b, c = (uv[faces[:, j]] for j in range(3))
    with np.errstate(invalid="ignore", over="ignore"):
        u, v = b - a, c - a
        area = 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    return np.where((depth[faces] > 0).all(axis=1), area, 0)

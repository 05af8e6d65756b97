"""Rendering of the textured model into one of the cameras, from the other photos only.

The surface point at each pixel is projected into the other photos that see it; their colours are averaged robustly, weighted
by the resolution at which each photo shows the surface.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numba import njit

from fairing.camera import Camera
from fairing.geometry.rasterize import HIDDEN_DEPTH, rasterize
from fairing.scene import Scene, View
from fairing.util.bounded_cache import BoundedCache

# Scale of the robust mean, grey levels: colours farther from the others are attributed to reflections or occluders.
OUTLIER = 20.0
ROBUST_ROUNDS = 3
MIN_SOURCES = 2
MOST_SOURCES = 24
LARGEST = 2_000_000  # pixels: larger photos are rendered, and evaluated, at this size
PHOTO_BYTES, DEPTH_BYTES = 300_000_000, 1_000_000_000  # size of the caches; 24 sources of `LARGEST` need half of it
SURVEY_REDUCTION = 4  # photo px per pixel of the images that count how much of each face a view shows


@dataclass(frozen=True, eq=False)
class RenderedView:
    """A photo predicted by the model.

    Attributes:
        image: (h, w, 3) float32, RGB grey levels; 0 where unknown.
        n_sources: (h, w) int: photos that contributed.
    """

    image: np.ndarray
    n_sources: np.ndarray

    @property
    def is_known(self) -> np.ndarray:
        """(h, w) bool: at least `MIN_SOURCES` photos contributed."""
        return self.n_sources >= MIN_SOURCES

    def at_size(self, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
        """`image` (height, width, 3) and `is_known` (height, width), resampled to another size, px."""
        if self.n_sources.shape == (height, width):
            return self.image, self.is_known
        image = cv2.resize(self.image, (width, height), interpolation=cv2.INTER_LINEAR)
        return image, cv2.resize(self.is_known.astype(np.float32), (width, height)) > 1 - 1e-4


class Renderer:
    """Renders one state of a mesh into any of the scene's cameras from the other photos, in bounded memory.

    Masked pixels neither contribute colours nor are predicted. Photos contribute in proportion to their weight.

    Args:
        vertices: (n, 3) float, world units.
        photos: cache of decoded photos, to share with the renderer of another state.

    Attributes:
        views: the scene's views; those of more than `LARGEST` pixels are reduced to that size.
    """

    def __init__(self, scene: Scene, vertices: np.ndarray, photos: BoundedCache[int] | None = None) -> None:
        self.views = tuple(_of_bounded_size(view) for view in scene.views)
        self._faces = scene.mesh.faces
        self._vertices = vertices
        self._depths: BoundedCache[int] = BoundedCache(DEPTH_BYTES)
        self._photos: BoundedCache[int] = BoundedCache(PHOTO_BYTES) if photos is None else photos

    def render(self, view: int) -> RenderedView:
        """The model rendered into the camera of a view, at its size in `views`.

        Raises:
            InputError: a photo cannot be decoded.
        """
        camera = self.views[view].camera
        face_id, depth = self._depth(view)
        rows, columns = np.nonzero(face_id >= 0)
        face = face_id[rows, columns]
        points = _points(camera, columns, rows, depth[rows, columns])
        area = _areas(self._vertices, self._faces, camera)
        sources = self._sources(view)
        colors = np.zeros((len(sources), len(rows), 3), dtype=np.float32)
        weights = np.zeros((len(sources), len(rows)), dtype=np.float32)
        for s, source in enumerate(sources):
            other = self.views[source]
            resolved = _areas(self._vertices, self._faces, other.camera) / np.maximum(area, 1e-9)
            tolerance = HIDDEN_DEPTH / other.camera.K[0, 0]
            source_face, source_depth = self._depth(source)
            _look_up(
                other.camera.image_from_world, points, face, other.weight * np.minimum(resolved, 1),
                source_face, source_depth, tolerance, self.photo(source), colors[s], weights[s],
            )  # fmt: skip
        image = np.zeros((camera.height, camera.width, 3), dtype=np.float32)
        n_sources = np.zeros((camera.height, camera.width), dtype=np.int64)
        image[rows, columns] = robust_mean(colors, weights)
        n_sources[rows, columns] = (weights > 0).sum(axis=0)
        return RenderedView(image, n_sources)

    def photo(self, view: int) -> np.ndarray:
        """(h, w, 3) uint8, RGB: the photo at its size in `views`."""
        return self._photos.get(view, lambda: (self.views[view].photo.load(),))[0]

    def _sources(self, view: int) -> list[int]:
        """The other views; of more than `MOST_SOURCES`, those that share most pixels of the same faces with this one."""
        others = [v for v in range(len(self.views)) if v != view]
        if len(others) <= MOST_SOURCES:
            return others
        shared = np.minimum(self._shown, self._shown[view]).sum(axis=1)
        ranked = sorted(others, key=lambda v: -shared[v])
        return sorted(ranked[:MOST_SOURCES])

    @cached_property
    def _shown(self) -> np.ndarray:
        """(V, m) float32: pixels of each view that show each face, counted in a reduced image."""
        shown = np.zeros((len(self.views), len(self._faces)), dtype=np.float32)
        for v, view in enumerate(self.views):
            width, height = (max(1, size // SURVEY_REDUCTION) for size in (view.camera.width, view.camera.height))
            face_id, _ = rasterize(self._vertices, self._faces, view.camera.resized(width, height))
            shown[v] = np.bincount(face_id[face_id >= 0], minlength=len(self._faces))
        return shown

    def _depth(self, view: int) -> tuple[np.ndarray, ...]:
        """Face ids (h, w) and depths (h, w) of a view. Masked pixels and their neighbours have depth 0, so they hide everything."""

        def make() -> tuple[np.ndarray, ...]:
            face_id, depth = rasterize(self._vertices, self._faces, self.views[view].camera)
            mask = self.views[view].mask
            if mask is not None:
                out = cv2.dilate((~mask.load()).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
                face_id[out], depth[out] = -1, 0
            return face_id, depth

        return self._depths.get(view, make)


def _of_bounded_size(view: View) -> View:
    pixels = view.camera.width * view.camera.height
    if pixels <= LARGEST:
        return view
    scale = np.sqrt(LARGEST / pixels)
    return view.resized(*(max(1, int(scale * size)) for size in (view.camera.width, view.camera.height)))


@njit(cache=True, nogil=True)
def _look_up(P, points, face, resolved, face_id, depth, tolerance, photo, color, weight):
    """Colours (q, 3) and weights (q,) of points (q, 3) in one photo; the weight stays 0 where the photo does not see a point.

    Args:
        P: (3, 4) image_from_world.
        face: (q,) face of each point.
        resolved: (m,) the weight of a point of each face.
        face_id, depth: (h, w): visible faces and depths of the photo's camera.
        tolerance: depth by which a surface must lie in front of a point to hide it, as a fraction of the depth.
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
        # A neighbouring face at about the same depth is not an occluder.
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
    """(q, 3) float32: robust mean of colours (s, q, 3), grey levels, with weights (s, q); 0 where all weights are 0.

    Starts at the median and reweights `ROBUST_ROUNDS` times (Geman-McClure).
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

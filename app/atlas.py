"""A texture for a mesh from its photos: the mean, by face, of the photos that see it best.

Where the mesh is wrong, the photos do not agree and the mean shows ghosts; they vanish as the mesh is faired.
"""

from dataclasses import dataclass

import cv2
import numba
import numpy as np

from fairing.camera import Camera
from fairing.rasterize import rasterize
from fairing.scene import Scene

PADDING = 2  # texels around a face that continue its texture, so that filtering never reads the neighbour's
VIEWS_PER_FACE = 6
SMALLEST_SINE = np.sin(np.radians(12.0))
PHOTO_BUDGET = 300e6  # bytes of photos held
Z_TOLERANCE = 0.01  # of the depth: what is farther behind the nearest face is hidden
HIDDEN_SHARE = 1e-3  # not nothing, so that a texel which no photo sees is filled with something near
UNSEEN = 96.0  # grey level of faces that no photo sees


@dataclass(frozen=True, eq=False)
class AtlasLayout:
    """Where each face lies in the texture: two faces, one turned by 180 degrees, share a square.

    Attributes:
        size: texels along the texture's edge.
        uv: (3 m, 2) float: texture coordinates of each face's three corners, 0 to 1.
        face: (size, size) int: the face a texel belongs to, -1 for none.
        weights: (size, size, 3) float32: its barycentric weights, slightly outside of the face in the padding.
    """

    size: int
    uv: np.ndarray
    face: np.ndarray
    weights: np.ndarray

    @classmethod
    def plan(cls, n_faces: int, largest: int = 1536, cell: int = 320) -> "AtlasLayout":
        """A layout of square textures of at most `largest` texels, with at most `cell` texels along a face's legs."""
        per_row = int(np.ceil(np.sqrt((n_faces + 1) // 2)))
        tile = max(2 * PADDING + 4, min(cell + 3 * PADDING, largest // per_row))
        size = tile * per_row
        legs = tile - 3 * PADDING - 1  # the diagonal takes one padding for each face, the legs one
        row, column = np.mgrid[0:tile, 0:tile]
        first = row + column < tile
        # Texel centres in the lower-left face's frame; the other face is the same, turned.
        u, v = (column - PADDING) / legs, (row - PADDING) / legs
        turned_u, turned_v = (tile - 1 - column - PADDING) / legs, (tile - 1 - row - PADDING) / legs
        b = np.where(first, u, turned_u)
        c = np.where(first, v, turned_v)
        weights = np.stack([1 - b - c, b, c], axis=-1).astype(np.float32)
        slots = np.arange(per_row * per_row)
        tile_faces = np.where(first, 2 * slots[:, None, None], 2 * slots[:, None, None] + 1)
        tile_faces = np.where(tile_faces < n_faces, tile_faces, -1)
        face = tile_faces.reshape(per_row, per_row, tile, tile).transpose(0, 2, 1, 3).reshape(size, size)
        corner = np.array([[PADDING, PADDING], [PADDING + legs, PADDING], [PADDING, PADDING + legs]], float)
        faces = np.arange(n_faces)
        offset = tile * np.stack([faces // 2 % per_row, faces // 2 // per_row], axis=1)
        local = np.where((faces % 2 == 0)[:, None, None], corner, tile - 1 - corner)
        uv = (offset[:, None] + local + 0.5) / size
        return cls(size, uv.reshape(-1, 2), face, np.tile(weights, (per_row, per_row, 1)))


class PhotoTexture:
    """Paints the atlas of one scene for any vertex positions.

    Photos are decoded on first use and shrunk to a memory budget.
    """

    def __init__(self, scene: Scene) -> None:
        self.faces = scene.mesh.faces
        self.layout = AtlasLayout.plan(len(self.faces))
        self._views = scene.views
        pixels = sum(view.camera.width * view.camera.height * 3 for view in scene.views)
        self._shrink = min(1.0, float(np.sqrt(PHOTO_BUDGET / pixels)))
        self._photos: dict[int, np.ndarray] = {}
        self._cameras = [_resized(view.camera, self._shrink) for view in scene.views]

    def paint(self, vertices: np.ndarray) -> np.ndarray:
        """(size, size, 3) uint8, RGB: the mean of the photos that see each face best."""
        chosen, depths = self._best_views(vertices)
        total = np.zeros((self.layout.size, self.layout.size, 3), dtype=np.float32)
        count = np.zeros((self.layout.size, self.layout.size), dtype=np.float32)
        for v in np.flatnonzero(chosen.any(axis=0)):
            P = self._cameras[v].image_from_world
            corners = (vertices @ P[:, :3].T + P[:, 3])[self.faces]
            _add_photo(
                self.layout.face,
                self.layout.weights,
                chosen[:, v],
                corners,
                self._photo(int(v)),
                depths[v],
                total,
                count,
            )
        texture = total / np.maximum(count, 1e-9)[..., None]
        texture[count == 0] = UNSEEN
        return np.clip(texture + 0.5, 0, 255).astype(np.uint8)

    def _best_views(self, vertices: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """(m, V) bool: views that paint each face; and every view's depth (h, w), infinite where it sees no face."""
        corners = vertices[self.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        score = np.zeros((len(self.faces), len(self._cameras)))
        depths = []
        for v, camera in enumerate(self._cameras):
            ids, depth = rasterize(vertices, self.faces, camera)
            depths.append(depth)
            pixels = np.bincount(ids[ids >= 0], minlength=len(self.faces))
            sight = camera.center - corners.mean(1)
            sine = np.abs((normals * sight).sum(1)) / np.maximum(np.linalg.norm(sight, axis=1), 1e-300)
            score[:, v] = np.where(sine > SMALLEST_SINE, pixels * sine, 0)
        # Views that see much less of the face than the best one blur more than they help.
        order = np.argsort(-score, axis=1, kind="stable")[:, :VIEWS_PER_FACE]
        chosen = np.zeros(score.shape, dtype=bool)
        np.put_along_axis(chosen, order, True, axis=1)
        return chosen & (score > 0) & (score >= 0.25 * score.max(axis=1, keepdims=True)), depths

    def _photo(self, v: int) -> np.ndarray:
        if v not in self._photos:
            pixels = self._views[v].photo.load()
            if self._shrink < 1:
                camera = self._cameras[v]
                pixels = cv2.resize(pixels, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
            self._photos[v] = pixels
        return self._photos[v]


def _resized(camera: Camera, factor: float) -> Camera:
    """The camera of the photo resized by a factor; pixel centres are at integers."""
    if factor == 1:
        return camera
    width, height = max(1, round(camera.width * factor)), max(1, round(camera.height * factor))
    sx, sy = width / camera.width, height / camera.height
    resize = np.array([[sx, 0, 0.5 * (sx - 1)], [0, sy, 0.5 * (sy - 1)], [0, 0, 1]])
    return Camera(resize @ camera.image_from_world, width, height)


@numba.njit(cache=True, nogil=True)
def _add_photo(face, weights, chosen, corners, photo, depths, total, count):
    """Add one photo's colours to the texels of the chosen faces; what it does not see counts next to nothing.

    Args:
        corners: (m, 3, 3) float64: homogeneous pixels of the faces' corners, the depth last.
    """
    height, width = depths.shape
    for row in range(face.shape[0]):
        for column in range(face.shape[1]):
            f = face[row, column]
            if f < 0 or not chosen[f]:
                continue
            a, b, c = weights[row, column, 0], weights[row, column, 1], weights[row, column, 2]
            w = a * corners[f, 0, 2] + b * corners[f, 1, 2] + c * corners[f, 2, 2]
            if w <= 0:
                continue
            x = (a * corners[f, 0, 0] + b * corners[f, 1, 0] + c * corners[f, 2, 0]) / w
            y = (a * corners[f, 0, 1] + b * corners[f, 1, 1] + c * corners[f, 2, 1]) / w
            x, y = min(max(x, 0.0), width - 1.001), min(max(y, 0.0), height - 1.001)
            ix, iy = int(x), int(y)
            fx, fy = x - ix, y - iy
            share = 1.0 if w <= depths[int(y + 0.5), int(x + 0.5)] * (1 + Z_TOLERANCE) else HIDDEN_SHARE
            for k in range(3):
                top = photo[iy, ix, k] * (1 - fx) + photo[iy, ix + 1, k] * fx
                bottom = photo[iy + 1, ix, k] * (1 - fx) + photo[iy + 1, ix + 1, k] * fx
                total[row, column, k] += share * (top * (1 - fy) + bottom * fy)
            count[row, column] += share

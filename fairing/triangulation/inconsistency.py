"""Inconsistency of existing and candidate faces: the loss of the eigenspace, photo by photo.

Morris and Kanade (CVPR 2000) compare photos with their average, warped to the face; here one eigenvector replaces the average,
as in fairing, and the Geman-McClure norm the square. A face's loss in a photo is a mean over the visible pixels, so that photos
that see little of the face do not appear consistent.
"""

from dataclasses import dataclass, replace

import numpy as np

from fairing.cells.context import build_context
from fairing.cells.depth_map import DepthMap, depth_map
from fairing.cells.sample_masks import Occluders
from fairing.cells.scale_space import ScaleSpace
from fairing.cells.visibility import mesh_orientation
from fairing.geometry.normals import face_normals
from fairing.mesh import Mesh
from fairing.options import FairingOptions, LevelOptions, VisibilityOptions
from fairing.scene import Scene
from fairing.solve.energy import Evaluator
from fairing.triangulation.options import TriangulationOptions

UNSEEN_LOSS = 0.25
"""Loss per pixel of a face that fewer than three photos see: that of residuals of 0.6 sigma."""
_BYTES_PER_MAP_PIXEL = 9
_MAX_MAP_BYTES = 1.5e9
"""Depth maps of all photos; their resolution is reduced to stay below."""


def judging_options(options: TriangulationOptions) -> FairingOptions:
    """The engine's options for measuring faces: those of the middle levels of fairing, at one blur.

    Thin faces take part down to a height of 1 px x blur (fairing: 2), else no flip could remove them. Up to 20 photos per
    face (fairing: 12), so that neighbouring faces use the same photos.
    """
    return FairingOptions(
        levels=(LevelOptions(options.blur, dimensions=1, sigma_rule="fixed"),),
        visibility=VisibilityOptions(min_footprint=1.0, max_views=20),
        threads=options.threads,
    )


@dataclass(frozen=True, eq=False)
class FaceLosses:
    """Losses of F faces in V photos.

    Attributes:
        weight: (F, V) float, px: photo pixels that a face covers, times the photo's weight; 0 where the photo is not used.
        loss: (F, V) float, 0 to 1: mean of the robust norm over the face's samples, corrected for the eigenspace's
            degrees of freedom, so that few photos do not appear as a good fit.
    """

    weight: np.ndarray
    loss: np.ndarray

    @property
    def n_views(self) -> np.ndarray:
        """(F,) int: photos that take part."""
        return (self.weight > 0).sum(axis=1)

    def mean(self) -> np.ndarray:
        """(F,) float: loss per pixel over a face's photos; `UNSEEN_LOSS` for a face that has none."""
        total = self.weight.sum(axis=1)
        return np.where(total > 0, (self.weight * self.loss).sum(axis=1) / np.maximum(total, 1e-300), UNSEEN_LOSS)

    def of(self, rows: np.ndarray) -> "FaceLosses":
        """The losses of some faces, by index (k,) int."""
        return FaceLosses(self.weight[rows], self.loss[rows])


def common_loss(pairs: list[FaceLosses]) -> tuple[np.ndarray, np.ndarray]:
    """Loss per pixel of several pairs of faces over the same quads, in the photos that all faces of a quad take part in.

    All pairs cover the same pixels there, so their losses are comparable.

    Args:
        pairs: P entries, each with the losses of 2 Q faces: the first face of each quad, then the second of each.

    Returns:
        (P, Q) float: losses, 0 without common photos; and (Q,) int: number of common photos.
    """
    quads = len(pairs[0].weight) // 2
    shape = (2, quads, -1)
    is_common = np.logical_and.reduce([(pair.weight.reshape(shape) > 0).all(axis=0) for pair in pairs])
    losses = []
    for pair in pairs:
        weight = pair.weight.reshape(shape) * is_common
        total = (weight * pair.loss.reshape(shape)).sum(axis=(0, 2))
        losses.append(total / np.maximum(weight.sum(axis=(0, 2)), 1e-300))
    return np.stack(losses), is_common.sum(axis=1)


class Judge:
    """Measures losses of faces between the fixed vertices of a scene.

    Args:
        evaluator: whose threads it uses.

    Attributes:
        vertices: (n, 3) float, world units.
        orientation: 1 if faces are counter-clockwise seen from the photos, else -1.
    """

    def __init__(self, scene: Scene, options: TriangulationOptions, evaluator: Evaluator) -> None:
        self._scene, self._evaluator = scene, evaluator
        self._options = judging_options(options)
        cameras = [view.camera for view in scene.views]
        pixels = sum(camera.width * camera.height for camera in cameras)
        coarse = int(np.ceil(np.sqrt(_BYTES_PER_MAP_PIXEL * pixels / _MAX_MAP_BYTES)))
        visibility = replace(self._options.visibility, reduction=max(self._options.visibility.reduction, coarse))
        self._options = replace(self._options, visibility=visibility)
        self._photos = ScaleSpace(scene, color=False)
        self.vertices = scene.mesh.vertices
        self.orientation = mesh_orientation(scene, self.vertices)

    def depth_maps(self, faces: np.ndarray) -> list[DepthMap]:
        """Depth maps of the mesh with these faces (m, 3) int, one per photo."""
        reduction = self._options.visibility.reduction

        def one(v: int) -> DepthMap:
            camera = self._scene.views[v].camera
            return depth_map(self.vertices, faces, camera, reduction, self._photos.mask(v, reduction))

        return list(self._evaluator.pool.map(one, range(len(self._scene.views))))

    def losses(self, faces: np.ndarray, depth_maps: list[DepthMap], replaced: np.ndarray) -> FaceLosses:
        """Losses of existing or candidate faces.

        Args:
            faces: (F, 3) int: vertex ids.
            depth_maps: of the current mesh.
            replaced: (F, 2) int: the faces of the current mesh that each would replace.
        """
        scene = replace(self._scene, mesh=Mesh(self.vertices, faces))
        context = build_context(
            scene, self._photos, self._options, 0, self.vertices, self.orientation, np.ones(len(faces), dtype=bool),
            self._evaluator.pool, Occluders(depth_maps, np.asarray(replaced, dtype=np.int64)),
        )  # fmt: skip
        data = context.kernel
        everything = np.arange(len(faces))
        scale = np.full(len(faces), self._options.robust.sigma**2)
        measured = self._evaluator.energies(context, self.vertices, everything, scale)

        n_pairs = np.diff(data.pair_start)
        face = np.repeat(everything, n_pairs)
        samples = np.diff(data.grid_start)[data.face_grid[face]]
        seen = samples.astype(float)
        masked = np.flatnonzero(data.pair_mask >= 0)
        counts = np.concatenate([[0], np.cumsum(data.masks, dtype=np.int64)])
        seen[masked] = counts[data.pair_mask[masked] + samples[masked]] - counts[data.pair_mask[masked]]
        k = data.face_dimensions[face]
        takes_part = k > 0
        freedom = n_pairs[face] / np.maximum(n_pairs[face] - k, 1)
        shape = (len(faces), len(scene.views))
        weight, loss = np.zeros(shape), np.zeros(shape)
        weight[face, data.pair_view] = np.where(takes_part, data.pair_weight * samples, 0)
        mean = measured.pair_energy / np.maximum(data.pair_weight * seen, 1e-300)
        loss[face, data.pair_view] = np.where(takes_part, mean * freedom, 0)
        return FaceLosses(weight, loss)

    def surface(self, faces: np.ndarray) -> np.ndarray:
        """(F,) float, world units^2: areas of faces (F, 3) int."""
        return 0.5 * np.linalg.norm(face_normals(self.vertices, faces), axis=1)

    def shown_side(self, faces: np.ndarray) -> np.ndarray:
        """(F, V) float, world units^3: positive where a photo lies on the outer side of a face (F, 3) int."""
        normals = self.orientation * face_normals(self.vertices, faces)
        centers = np.stack([view.camera.center for view in self._scene.views])
        return normals @ centers.T - (normals * self.vertices[faces[:, 0]]).sum(axis=1)[:, None]

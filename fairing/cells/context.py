"""Cell context: the fixed data of all faces at one level (photos, samples, weights).

A context is a function of the level and of the vertex positions it was built at. It stays fixed while vertices move, so that
energies before and after a step are comparable, and is rebuilt at the beginning of each sweep.
"""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fairing.cells.layout import CellLayout, plan_cells
from fairing.cells.pair_photos import ANTI_ALIASING, PairPhotos, blurred_photos_for_pairs
from fairing.cells.point_spread import PATCH_MARGIN, common_psf_patches, patch_pixels
from fairing.cells.sample_masks import Occluders, ViewMasks, mask_views
from fairing.cells.scale_space import ScaleSpace, exceeds
from fairing.cells.visibility import Footprints, Visibility, footprints_in_views, mark_surplus
from fairing.kernels.data import KernelData
from fairing.norms.built_in import norm_of
from fairing.norms.norm import Tabulated
from fairing.options import FairingOptions
from fairing.scene import Scene


@dataclass(frozen=True, eq=False)
class CellContext:
    """Everything about the cells that stays fixed while vertices move.

    m faces, V views, n vertices, P pairs of a face and a view that takes part in it.

    Attributes:
        level: level of the schedule.
        kernel: arrays for `fairing.kernels`.
        reasons: (m, V) int8 `Visibility` of every face in every view.
        n_views: (m,) int: views that take part.
        footprint_area: (m,) float: mean over those views, px^2.
        vertex_views: (n, V) bool: views that take part in a face of the vertex.
        vertices: (n, 3) float: positions the context was built at, world units.
        point_spread_fallback: whether photos are as seen although the level's option is a common point spread function,
            because the patches would take too much memory, see `exceeds`.
        norm: of the residuals.
    """

    level: int
    kernel: KernelData
    reasons: np.ndarray
    n_views: np.ndarray
    footprint_area: np.ndarray
    vertex_views: np.ndarray
    vertices: np.ndarray
    point_spread_fallback: bool
    norm: Tabulated

    @property
    def takes_part(self) -> np.ndarray:
        """(m,) bool: faces with enough views to have an energy."""
        return self.kernel.face_dimensions > 0

    def pairs_of(self, face: int) -> slice:
        """The pairs of a face in the pair arrays."""
        return slice(int(self.kernel.pair_start[face]), int(self.kernel.pair_start[face + 1]))

    def broadcast_to_pairs(self, face_values: np.ndarray) -> np.ndarray:
        """(P,) values of the pairs' faces, from (m,) values by face."""
        return np.repeat(face_values, np.diff(self.kernel.pair_start))

    def sum_by_view(self, pair_values: np.ndarray) -> np.ndarray:
        """(V,) float: sums of (P,) values by view."""
        return np.bincount(self.kernel.pair_view, weights=pair_values, minlength=self.reasons.shape[1])


def build_context(
    scene: Scene,
    photos: ScaleSpace,
    options: FairingOptions,
    level: int,
    vertices: np.ndarray,
    orientation: int,
    face_mask: np.ndarray,
    pool: Executor,
    occluders: Occluders | None = None,
    on_view: Callable[[], None] = lambda: None,
    patch_margin: float = PATCH_MARGIN,
    own_norm: Tabulated | None = None,
) -> CellContext:
    """Judge visibility at the given positions and lay out the cells of a level.

    Args:
        photos: blurred photos of the scene.
        vertices: (n, 3) float, world units.
        orientation: see `mesh_orientation`.
        face_mask: (m,) bool: the faces to include; the others take no part.
        pool: executes several photos at a time.
        occluders: what hides the cells; by default the mesh itself.
        on_view: called before each photo is judged, from the pool's threads.
        patch_margin: px around a face that are blurred too, if its photos get a common point spread function.
        own_norm: a norm of one's own, for options that name it.

    Raises:
        InputError: a photo cannot be decoded.
    """
    faces, at = scene.mesh.faces, options.levels[level]
    blur = at.blur
    cameras = [view.camera for view in scene.views]
    outlines = footprints_in_views(vertices, faces, cameras, orientation, options.visibility, blur, pool)
    reasons = outlines.reason
    reasons[~face_mask] = Visibility.DEGENERATE
    is_candidate = reasons == Visibility.SEEN
    layout = plan_cells(options, level, outlines.longest_edge, outlines.height, is_candidate)
    view_masks = mask_views(
        vertices, faces, cameras, photos, layout, options.visibility, blur, reasons, occluders, pool, on_view
    )
    mark_surplus(reasons, outlines.area, options.visibility.max_views)

    takes_part = reasons <= Visibility.PARTLY_SEEN
    n_views = takes_part.sum(1)
    pairs = _find_pairs(takes_part)
    masks, pair_mask = _pair_masks(view_masks, layout, reasons, pairs)
    pair_photos, is_fallback = _pair_photos(
        scene, photos, options, level, vertices, outlines, layout, pairs, pool, patch_margin
    )
    weight = np.ones(len(pairs.face))
    if options.cells.weighting == "photo_area":
        weight = outlines.area[pairs.face, pairs.view] / layout.samples[pairs.face]
    weight *= np.array([view.weight for view in scene.views])[pairs.view]
    P = np.stack([camera.image_from_world for camera in cameras])
    norm = norm_of(options.robust.norm, own_norm)
    kernel = KernelData(
        faces=faces,
        image_from_world=np.concatenate([P, pair_photos.reduced_cameras]),
        pixels=pair_photos.pixels,
        channels=photos.channels,
        pair_start=pairs.start,
        pair_view=pairs.view.astype(np.int64),
        pair_camera=pair_photos.camera.astype(np.int64),
        pair_base=pair_photos.base,
        pair_frame=pair_photos.frame,
        pair_weight=weight,
        pair_mask=pair_mask,
        masks=masks,
        face_dimensions=_dimensions(at.dimensions, options.eigenspace.centered, n_views),
        face_inset=layout.inset,
        face_grid=layout.face_grid,
        grid_start=layout.grid_start,
        ramp=layout.ramp,
        affine=options.cells.warp == "affine",
        cubic=at.interpolation == "cubic",
        remove_bias=options.cells.remove_bias,
        centered=options.eigenspace.centered,
        norm=int(norm.kernel),
        norm_table=norm.table,
    )
    mean_area = np.where(takes_part, outlines.area, 0).sum(1) / np.maximum(n_views, 1)
    vertex_views = np.zeros((len(vertices), len(cameras)), dtype=bool)
    vertex_views[faces[pairs.face], pairs.view[:, None]] = True
    return CellContext(level, kernel, reasons, n_views, mean_area, vertex_views, vertices.copy(), is_fallback, norm)


def _dimensions(wanted: int, centered: bool, n_views: np.ndarray) -> np.ndarray:
    """(m,) int64: eigenspace dimensions k of each face, as far as its views (m,) allow; 0 for too few views."""
    dimensions = np.minimum(wanted, n_views - 2 - int(centered))
    dimensions[(n_views < 3) | (dimensions < 1)] = 0
    return dimensions.astype(np.int64)


class _Pairs(NamedTuple):
    """The P pairs of a face and a view that takes part in it, face by face.

    Attributes:
        face, view: (P,) int.
        start: (m + 1,) int64: the pairs of face f are start[f] : start[f + 1].
    """

    face: np.ndarray
    view: np.ndarray
    start: np.ndarray


def _find_pairs(takes_part: np.ndarray) -> _Pairs:
    face, view = np.nonzero(takes_part)
    return _Pairs(face, view, np.searchsorted(face, np.arange(len(takes_part) + 1)).astype(np.int64))


def _pair_masks(
    view_masks: list[ViewMasks], layout: CellLayout, reasons: np.ndarray, pairs: _Pairs
) -> tuple[np.ndarray, np.ndarray]:
    """`masks` and `pair_mask` of `KernelData`: the masks of the partly seen pairs that still take part, view by view."""
    samples = layout.samples
    masks = [
        masks[np.repeat(reasons[ids, v] == Visibility.PARTLY_SEEN, samples[ids])]
        for v, (ids, masks) in enumerate(view_masks)
    ]
    view_order = np.argsort(pairs.view, kind="stable")
    partly = view_order[(reasons[pairs.face, pairs.view] == Visibility.PARTLY_SEEN)[view_order]]
    lengths = samples[pairs.face[partly]]
    pair_mask = np.full(len(pairs.face), -1, dtype=np.int64)
    pair_mask[partly] = np.cumsum(lengths) - lengths
    return np.concatenate(masks), pair_mask


def _pair_photos(
    scene: Scene,
    photos: ScaleSpace,
    options: FairingOptions,
    level: int,
    vertices: np.ndarray,
    outlines: Footprints,
    layout: CellLayout,
    pairs: _Pairs,
    pool: Executor,
    patch_margin: float,
) -> tuple[PairPhotos, bool]:
    """The pixels of all pairs by the level's point spread option, and whether memory forced photos as seen instead."""
    cameras = [view.camera for view in scene.views]
    at = options.levels[level]
    blur, cubic = at.blur, at.interpolation == "cubic"
    longest, height = outlines.longest_edge[pairs.face, pairs.view], outlines.height[pairs.face, pairs.view]
    spacing = longest / layout.grid_sizes[layout.face_grid[pairs.face]]
    is_common = at.point_spread == "common"
    if is_common and not exceeds(float(patch_pixels(longest, height).sum())):
        min_sigma = np.maximum(blur, ANTI_ALIASING * spacing)
        corners = vertices[scene.mesh.faces]
        patches = common_psf_patches(
            photos, cameras, pairs.view, pairs.start, corners, min_sigma, cubic, pool, patch_margin
        )
        return PairPhotos(*patches, camera=pairs.view, reduced_cameras=np.zeros((0, 3, 4))), False
    P = np.stack([camera.image_from_world for camera in cameras])
    return blurred_photos_for_pairs(photos, blur, cubic, spacing, P, pairs.view, pool), is_common

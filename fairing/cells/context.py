"""The cells of all faces at one level: which photos, which samples, how finely, with what weight.

A context is a function of the level and of the vertex positions it was made at. It stays fixed while vertices move, so
that energies before and after a step compare like with like, and is made anew at the beginning of each sweep.
"""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from fairing.cells.point_spread import MOST_PIXELS, equally_sharp, pixels_around
from fairing.cells.scale_space import ScaleSpace
from fairing.cells.visibility import DepthMap, Visibility, depth_map, footprints, mask_samples
from fairing.kernels.data import (
    NORM_GEMAN_MCCLURE,
    NORM_HUBER,
    NORM_LEAST_SQUARES,
    KernelData,
)
from fairing.options import FairingOptions, by_level
from fairing.scene import Scene

GRID_SIZES = (8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
NORMS = {
    "geman_mcclure": NORM_GEMAN_MCCLURE,
    "geman_mcclure_printed": NORM_GEMAN_MCCLURE,
    "huber": NORM_HUBER,
    "least_squares": NORM_LEAST_SQUARES,
}
# A photo sampled every d pixels needs a blur of about d / 2, or its fine detail turns into noise.
ANTI_ALIASING = 0.5
# The border left out is at most this part of the face, else small faces would lose everything.
MAX_INSET = 0.08


def cell_grid(size: int) -> np.ndarray:
    """(2, size * (size + 1) / 2) float32: barycentric weights of corners 0 and 1 at the samples of a cell.

    Sample (row r, column c) of the right triangle sits at ((c + 1/3) / size, (r + 1/3) / size), c + r < size, so that
    the three corners are treated alike.
    """
    row, column = np.nonzero(np.add.outer(np.arange(size), np.arange(size)) < size)
    return np.stack([(column + 1 / 3) / size, (row + 1 / 3) / size]).astype(np.float32)


@dataclass(frozen=True, eq=False)
class CellContext:
    """Everything about the cells that stays fixed while vertices move.

    Attributes:
        level: level of the schedule.
        kernel: arrays for `fairing.kernels`.
        reasons: (m, V) int8 `Visibility` of every face in every view.
        n_views: (m,) int: views that take part.
        footprint_area: (m,) float: mean over those views, px^2.
        vertex_views: (n, V) bool: views that take part in a face of the vertex.
        vertices: (n, 3): positions the context was made at.
        too_many_parts: whether photos are as seen although the level wants them equally sharp (`point_spread`).
    """

    level: int
    kernel: KernelData
    reasons: np.ndarray
    n_views: np.ndarray
    footprint_area: np.ndarray
    vertex_views: np.ndarray
    vertices: np.ndarray
    too_many_parts: bool

    @property
    def takes_part(self) -> np.ndarray:
        """(m,) bool: faces with enough views to say anything."""
        return self.kernel.face_dimensions > 0

    def without_noise_dimensions(self, singular_value_ratio: np.ndarray, least: float) -> "CellContext":
        """The context with one dimension less for faces whose last one stands out less than `least`, see `FaceSystem`."""
        k = self.kernel.face_dimensions
        idle = (k > 1) & (singular_value_ratio < least)
        return replace(self, kernel=self.kernel._replace(face_dimensions=k - idle)) if idle.any() else self

    def pairs_of(self, face: int) -> slice:
        """The pairs of a face in the pair arrays."""
        return slice(int(self.kernel.pair_start[face]), int(self.kernel.pair_start[face + 1]))

    def by_pair(self, faces: np.ndarray) -> np.ndarray:
        """(P,) values by face and view, from values (m,) by face."""
        return np.repeat(faces, np.diff(self.kernel.pair_start))

    def by_view(self, pairs: np.ndarray, faces: np.ndarray | None = None) -> np.ndarray:
        """(V,) float: sums of values (P,) by face and view, over the faces of a mask (m,) or over all."""
        if faces is not None:
            pairs = pairs * self.by_pair(faces)
        return np.bincount(self.kernel.pair_view, weights=pairs, minlength=self.reasons.shape[1])


@dataclass(frozen=True, eq=False)
class Occluders:
    """The surface that hides cells, where it is not the one the cells' faces make up: faces that are only tried.

    Attributes:
        depth_maps: one a photo.
        transparent: (m, 2) int: for each face of the cells those of that surface it would replace, which do not hide
            it; -1 for none.
    """

    depth_maps: list[DepthMap]
    transparent: np.ndarray


def facing(scene: Scene, vertices: np.ndarray) -> int:
    """1 if the photos see mostly the counter-clockwise side of the faces, -1 if the clockwise side."""
    balance = 0
    faces = scene.mesh.faces
    points = vertices[faces]
    normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    for view in scene.views[:: max(1, len(scene.views) // 8)]:
        face_id = depth_map(vertices, faces, view.camera, reduction=4).face_id
        counts = np.bincount(face_id[face_id >= 0], minlength=len(faces))
        balance += int((counts * np.sign(((view.camera.center - points[:, 0]) * normal).sum(1))).sum())
    return 1 if balance >= 0 else -1


def build_context(
    scene: Scene,
    photos: ScaleSpace,
    options: FairingOptions,
    level: int,
    vertices: np.ndarray,
    orientation: int,
    judged_faces: np.ndarray,
    pool: Executor,
    occluders: Occluders | None = None,
    on_view: Callable[[], None] = lambda: None,
) -> CellContext:
    """Judge visibility at the given positions and lay out the cells of a level.

    Args:
        photos: blurred photos of the scene.
        vertices: (n, 3) float, world units.
        orientation: see `facing`.
        judged_faces: (m,) bool: the faces wanted; the others take no part.
        pool: works on several photos at a time.
        occluders: what hides the cells; by default the mesh itself.
        on_view: called before each photo is judged, from the pool's threads.
    """
    faces = scene.mesh.faces
    blur = options.schedule.blur[level]
    n_views, n_faces = len(scene.views), len(faces)
    cameras = [view.camera for view in scene.views]
    # By face first: numpy's sums over the views of a face depend on how the rows lie.
    area, longest, height = (np.empty((n_faces, n_views)) for _ in range(3))
    reasons = np.empty((n_faces, n_views), dtype=np.int8)

    def outline_view(v: int) -> None:
        outline = footprints(vertices, faces, cameras[v], orientation, options.visibility, blur)
        area[:, v], longest[:, v], height[:, v] = outline.area, outline.longest_edge, outline.height
        reasons[:, v] = outline.reason

    list(pool.map(outline_view, range(n_views)))
    reasons[~judged_faces] = Visibility.DEGENERATE

    candidate = reasons == Visibility.SEEN
    size = by_level(options.cells.size, level)
    grid_sizes = [s for s in GRID_SIZES if s < size] + [size] if options.cells.adaptive else [size]
    wanted = np.where(candidate, longest, 0).max(axis=1) / (by_level(options.cells.spacing, level) * max(1.0, blur))
    face_grid = np.minimum(np.searchsorted(grid_sizes, wanted), len(grid_sizes) - 1)
    grids = [cell_grid(s) for s in grid_sizes]
    grid_start = np.concatenate([[0], np.cumsum([g.shape[1] for g in grids])])
    ramp = np.concatenate(grids, axis=1)
    samples = np.diff(grid_start)[face_grid]
    typical_height = np.where(candidate, height, 0).sum(1) / np.maximum(candidate.sum(1), 1)
    inset = np.minimum(by_level(options.cells.inset, level) / np.maximum(typical_height, 1e-9), MAX_INSET)

    margin = options.visibility.edge_margin * blur + 1.0
    P = np.stack([camera.image_from_world for camera in cameras])

    def mask_view(v: int) -> tuple[np.ndarray, np.ndarray]:
        """Occlusion in one photo: updates its column of `reasons`, returns partly seen faces and their masks."""
        chosen = np.flatnonzero(candidate[:, v])
        on_view()
        if len(chosen) == 0:
            return chosen, np.zeros(0, dtype=np.uint8)
        reduction = options.visibility.reduction
        if occluders is None:
            depths = depth_map(vertices, faces, cameras[v], reduction, photos.mask(v, reduction))
            transparent = np.full((len(chosen), 2), -1, dtype=np.int64)
        else:
            depths, transparent = occluders.depth_maps[v], occluders.transparent[chosen]
        starts = np.concatenate([[0], np.cumsum(samples[chosen])])
        masks, seen = np.empty(starts[-1], dtype=np.uint8), np.empty(len(chosen), dtype=np.int64)
        mask_samples(
            vertices @ P[v, :, :3].T + P[v, :, 3], faces[chosen], face_grid[chosen], grid_start, ramp, inset[chosen],
            depths.inverse_depth, depths.edge_distance, depths.face_id, transparent, depths.focal_length,
            depths.reduction, 1.0 + blur, margin, (cameras[v].width, cameras[v].height), masks, starts[:-1], seen,
        )  # fmt: skip
        partly = seen < samples[chosen]
        reasons[chosen[partly], v] = Visibility.PARTLY_SEEN
        hidden = seen < options.visibility.min_samples * samples[chosen]
        reasons[chosen[hidden], v] = Visibility.HIDDEN
        kept = partly & ~hidden
        return chosen[kept], masks[np.repeat(kept, samples[chosen])]

    partly_seen = list(pool.map(mask_view, range(n_views)))
    _leave_out_surplus(reasons, area, options.visibility.max_views)
    part = reasons <= Visibility.PARTLY_SEEN
    masks = [
        masks[np.repeat(reasons[ids, v] == Visibility.PARTLY_SEEN, samples[ids])]
        for v, (ids, masks) in enumerate(partly_seen)
    ]
    count = part.sum(1)
    rank_limit = count - 2 - int(options.eigenspace.centered)
    dimensions = np.minimum(by_level(options.eigenspace.dimensions, level), rank_limit)
    dimensions[(count < 3) | (dimensions < 1)] = 0

    pair_face, pair_view = np.nonzero(part)
    by_view = np.argsort(pair_view, kind="stable")
    partly = by_view[(reasons[pair_face, pair_view] == Visibility.PARTLY_SEEN)[by_view]]
    mask_lengths = samples[pair_face[partly]]
    pair_mask = np.full(len(pair_face), -1, dtype=np.int64)
    pair_mask[partly] = np.cumsum(mask_lengths) - mask_lengths
    weight = np.ones(len(pair_face))
    if options.cells.weighting == "photo_area":
        weight = area[pair_face, pair_view] / samples[pair_face]
    weight *= np.array([view.weight for view in scene.views])[pair_view]
    cubic = by_level(options.cells.interpolation, level) == "cubic"
    sample_spacing = longest[pair_face, pair_view] / np.asarray(grid_sizes)[face_grid[pair_face]]
    pair_start = np.searchsorted(pair_face, np.arange(n_faces + 1)).astype(np.int64)
    wants_common = by_level(options.cells.point_spread, level) == "common"
    around = pixels_around(longest[pair_face, pair_view], height[pair_face, pair_view])
    is_common = wants_common and float(around.sum()) <= MOST_PIXELS
    if is_common:
        least = np.maximum(blur, ANTI_ALIASING * sample_spacing)
        pixels, base, frame = equally_sharp(photos, cameras, pair_view, pair_start, vertices[faces], least, cubic, pool)
        smaller, pair_camera = P[:0], pair_view
    else:
        pixels, base, frame, smaller, pair_camera = _photos_for_pairs(
            photos, blur, cubic, sample_spacing, P, pair_view, pool
        )
    kernel = KernelData(
        faces=faces,
        image_from_world=np.concatenate([P, smaller]),
        pixels=pixels,
        channels=photos.channels,
        pair_start=pair_start,
        pair_view=pair_view.astype(np.int64),
        pair_camera=pair_camera.astype(np.int64),
        pair_base=base,
        pair_frame=frame,
        pair_weight=weight,
        pair_mask=pair_mask,
        masks=np.concatenate(masks),
        face_dimensions=dimensions.astype(np.int64),
        face_inset=inset,
        face_grid=face_grid.astype(np.int64),
        grid_start=grid_start.astype(np.int64),
        ramp=ramp,
        affine=options.cells.warp == "affine",
        cubic=cubic,
        remove_bias=options.cells.remove_bias,
        centered=options.eigenspace.centered,
        norm=NORMS[options.robust.norm],
    )
    mean_area = np.where(part, area, 0).sum(1) / np.maximum(count, 1)
    vertex_views = np.zeros((len(vertices), n_views), dtype=bool)
    vertex_views[faces[pair_face], pair_view[:, None]] = True
    too_many = wants_common and not is_common
    return CellContext(level, kernel, reasons, count, mean_area, vertex_views, vertices.copy(), too_many)


def _leave_out_surplus(reasons: np.ndarray, area: np.ndarray, max_views: int) -> None:
    """Mark all but the `max_views` largest footprints (m, V) of each face as surplus, in `reasons` (m, V)."""
    crowded = np.flatnonzero((reasons <= Visibility.PARTLY_SEEN).sum(1) > max_views)
    for rows in np.array_split(crowded, len(crowded) // 10_000 + 1):
        part = reasons[rows] <= Visibility.PARTLY_SEEN
        ranked = np.argsort(np.where(part, -area[rows], np.inf), axis=1, kind="stable")
        for rank in range(max_views, part.shape[1]):
            which = part[np.arange(len(rows)), ranked[:, rank]]
            reasons[rows[which], ranked[which, rank]] = Visibility.SURPLUS


def blur_rungs(spacing: np.ndarray, blur: float) -> np.ndarray:
    """int64: by how many doublings a photo must be blurred more than the level asks where samples lie `spacing` px apart."""
    needed = ANTI_ALIASING * spacing / max(blur, 1.0)
    # A quarter more than the blur at hand is let pass.
    return np.where(needed > 1.25, np.ceil(np.log2(np.maximum(needed, 1.0))), 0).astype(np.int64)


def blur_of_rung(rung: int, blur: float) -> float:
    """How blurred the photo of a rung is at a level of some blur, px; rung 0 is the level's own."""
    return blur if rung == 0 else max(blur, 1.0) * 2.0**rung


def _photos_for_pairs(
    photos: ScaleSpace,
    blur: float,
    cubic: bool,
    spacing: np.ndarray,
    P: np.ndarray,
    pair_view: np.ndarray,
    pool: Executor,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The photos at the level's blur, and more blurred ones where a cell's samples lie far apart in the photo.

    Args:
        spacing: (P,) float: distance of a pair's samples, px.
        P: (V, 3, 4) float: `image_from_world` of the views.

    Returns:
        `pixels`, `pair_base` and `pair_frame` of `fairing.kernels.data.KernelData`, `image_from_world` of the photos that
        are kept smaller, and `pair_camera`.
    """
    rung = blur_rungs(spacing, blur)
    rungs = int(rung.max(initial=0)) + 1
    kinds, kind = np.unique(pair_view * rungs + rung, return_inverse=True)
    wanted = [(v, blur_of_rung(r, blur)) for v, r in (divmod(int(k), rungs) for k in kinds)]
    pixels, starts = photos.lay_out(blur, cubic, wanted, pool)
    base, frame, camera = (np.zeros(shape, np.int64) for shape in (len(wanted), (len(wanted), 4), len(wanted)))
    smaller = []
    for k, (view, sigma) in enumerate(wanted):
        base[k], frame[k, 2:], camera[k] = starts[view, sigma], photos.size_at(view, sigma), view
        factor = photos.reduction(view, sigma)
        if factor > 1:
            camera[k] = len(P) + len(smaller)
            smaller.append(np.diag([1 / factor, 1 / factor, 1]) @ P[view])
    return pixels, base[kind], frame[kind], np.array(smaller).reshape(-1, 3, 4), camera[kind]

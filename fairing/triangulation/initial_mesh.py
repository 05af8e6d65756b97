"""Initial mesh from sparse points: Delaunay triangulations of their projections in central photos.

The central photo sees most points from about the mean direction. Surfaces that it does not see (the sides of a building, the
back of a statue) become further patches, each from the photo that is central to the remaining points. Patches are not joined.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, QhullError

from fairing.camera import Camera
from fairing.errors import InputError
from fairing.geometry.normals import face_normals, face_quality
from fairing.geometry.rasterize import rasterize
from fairing.scene import SparsePoints, View
from fairing.triangulation.options import TriangulationOptions
from fairing.triangulation.points import PointFacts, judge_points, spread_out
from fairing.triangulation.quads import MIN_QUALITY

LEAST_ANGLE = 15.0
"""Degrees between a face and the central photo's line of sight; flatter faces span a depth discontinuity."""
LONG = 4.0
"""A boundary face is removed if an edge of it is longer than this times the median edge, in the photo."""
LEAST_ISLAND = 0.02
"""Components of a patch with less than this fraction of its faces are removed."""
LEAST_PATCH = 0.05
"""A further patch must contain this fraction of the usable points."""
MOST_PATCHES = 12


@dataclass(frozen=True, eq=False)
class StartMesh:
    """Vertices and faces, counter-clockwise seen from the photos, and their origin.

    Attributes:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        point_ids: (n,) int: the sparse point of each vertex.
        central_views: ids of the photos of the Delaunay triangulations, one per patch.
        left_out: number of points that are not vertices, by reason.
    """

    vertices: np.ndarray
    faces: np.ndarray
    point_ids: np.ndarray
    central_views: tuple[int, ...]
    left_out: dict[str, int]


@dataclass(frozen=True, eq=False)
class _Patch:
    camera: Camera
    ids: np.ndarray
    faces: np.ndarray  # into all points
    face_id: np.ndarray
    depth: np.ndarray
    tolerance: np.ndarray


def start_mesh(views: Sequence[View], points: SparsePoints, options: TriangulationOptions) -> StartMesh:
    """Triangulate sparse points.

    Raises:
        InputError: too few points, or no usable triangle.
    """
    facts, patches, central = _patches(views, points, options, None)
    if options.max_vertices is not None:
        # The limit is distributed over the patches in proportion to their sizes without a limit.
        whole = [len(patch.ids) for patch in patches]
        shares = [int(options.max_vertices * size / max(sum(whole), options.max_vertices)) for size in whole]
        plan = [(v, share) for v, share in zip(central, shares, strict=True) if share >= 3]
        facts, patches, central = _patches(views, points, options, plan)
    if not patches:
        raise InputError(
            "triangulation: expected sparse points that span a surface in some photo, found none; "
            "give a mesh with --mesh"
        )
    ids, corners = np.unique(np.concatenate([patch.faces for patch in patches]), return_inverse=True)
    reasons, counts = np.unique(facts.left_out[facts.left_out != "vertex"].astype(str), return_counts=True)
    left_out = dict(zip(reasons.tolist(), counts.tolist(), strict=True))
    return StartMesh(points.positions[ids], corners.reshape(-1, 3), ids, tuple(central), left_out)


def _patches(
    views: Sequence[View], points: SparsePoints, options: TriangulationOptions, plan: list[tuple[int, int]] | None
) -> tuple[PointFacts, list[_Patch], list[int]]:
    """Patches with their central photos, and the status of every point.

    Args:
        plan: central photo and largest number of vertices of each patch; None: all patches, without limit.
    """
    facts = judge_points(views, points, options)
    usable = int(facts.usable.sum())
    patches: list[_Patch] = []
    central: list[int] = []
    for turn in range(MOST_PATCHES if plan is None else len(plan)):
        v, most = (_central_view(views, points, facts), None) if plan is None else plan[turn]
        seen = np.flatnonzero(facts.seen_by[v] & facts.usable)
        if len(seen) < (max(3, LEAST_PATCH * usable) if patches else 3):
            break
        patch = _patch(views[v].camera, seen, points.positions, facts, most, options, patches)
        if patch is None:
            facts.leave_out(seen, "only at the border, on thin or single faces")
            continue
        patches.append(patch)
        central.append(v)
        facts.left_out[patch.ids] = "vertex"
        facts.leave_out(seen, "beside stronger points, or only on faces left out")
        rest = np.flatnonzero(facts.usable)
        facts.leave_out(rest[_is_on(patch, points.positions[rest])], "on the surface of others")
    facts.leave_out(np.flatnonzero(facts.usable), "seen from other sides by too few points")
    return facts, patches, central


def _central_view(views: Sequence[View], points: SparsePoints, facts: PointFacts) -> int:
    """The photo that sees most usable points from about the mean direction."""
    sees = facts.seen_by & facts.usable
    directions = np.zeros((len(views), 3))
    for v, view in enumerate(views):
        sight = view.camera.center - points.positions[sees[v]]
        directions[v] = (sight / np.maximum(np.linalg.norm(sight, axis=1, keepdims=True), 1e-300)).sum(axis=0)
    mean = directions.sum(axis=0)
    unit = directions / np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-300)
    cosine = np.maximum(unit @ mean / max(float(np.linalg.norm(mean)), 1e-300), 0)
    # The square favours photos near the mean direction.
    return int(np.argmax(sees.sum(axis=1) * (cosine**2 + 1e-9)))


def _patch(
    camera: Camera,
    seen: np.ndarray,
    positions: np.ndarray,
    facts: PointFacts,
    most: int | None,
    options: TriangulationOptions,
    others: list[_Patch],
) -> _Patch | None:
    """The Delaunay triangulation of points in a photo, without triangles that cannot be surface; None if none remains."""
    uv, depth = camera.project(positions)
    strength = facts.n_photos - np.minimum(facts.error / 1e3, 0.5)
    ids = seen[spread_out(uv[seen], strength[seen], options.spacing, most)]
    while True:
        if len(ids) < 3:
            return None
        try:
            triangles = ids[Delaunay(uv[ids]).simplices]
        except QhullError:  # all in one line
            return None
        lonely = _off_in_depth(triangles, ids, uv, depth, camera)
        if not lonely.any():
            break
        facts.leave_out(ids[lonely], "far before or behind its neighbours")
        ids = ids[~lonely]
    triangles = _facing(np.sort(triangles, axis=1), positions, camera)
    triangles = triangles[np.lexsort(triangles.T[::-1])]
    normals = face_normals(positions, triangles)
    sight = camera.center - positions[triangles].mean(axis=1)
    lengths = np.linalg.norm(normals, axis=1) * np.linalg.norm(sight, axis=1)
    sine = (normals * sight).sum(axis=1) / np.maximum(lengths, 1e-300)
    triangles = triangles[sine > np.sin(np.deg2rad(LEAST_ANGLE))]
    for other in others:
        triangles = triangles[~_bridges(other, positions[triangles])]
    triangles = _without_islands(_peeled(triangles, uv, positions, facts))
    if len(triangles) == 0:
        return None
    face_id, map_depth = rasterize(positions, triangles, camera)
    sides = np.linalg.norm(uv[triangles[:, [1, 2, 0]]] - uv[triangles], axis=2).max(axis=1)
    return _Patch(camera, np.unique(triangles), triangles, face_id, map_depth, 0.5 * sides)


def _facing(triangles: np.ndarray, positions: np.ndarray, camera: Camera) -> np.ndarray:
    """The triangles (t, 3), oriented so that the camera sees them counter-clockwise."""
    away = (face_normals(positions, triangles) * (camera.center - positions[triangles[:, 0]])).sum(axis=1) < 0
    return np.where(away[:, None], triangles[:, [0, 2, 1]], triangles)


def _off_in_depth(
    triangles: np.ndarray, ids: np.ndarray, uv: np.ndarray, depth: np.ndarray, camera: Camera
) -> np.ndarray:
    """(len(ids),) bool: points whose edges in the triangulation all run steeply along the line of sight."""
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    run = np.linalg.norm(uv[ends[:, 0]] - uv[ends[:, 1]], axis=1)
    rise = np.abs(depth[ends[:, 0]] - depth[ends[:, 1]]) * camera.K[0, 0] / depth[ends].mean(axis=1)
    steep = rise * np.tan(np.deg2rad(LEAST_ANGLE)) > run
    has_gentle = np.zeros(len(uv), dtype=bool)
    has_gentle[ends[~steep]] = True
    return ~has_gentle[ids]


def _peeled(triangles: np.ndarray, uv: np.ndarray, positions: np.ndarray, facts: PointFacts) -> np.ndarray:
    """Remove boundary faces, layer by layer, that are long, thin, or whose corners no two photos share."""
    if len(triangles) == 0:
        return triangles
    sides = np.linalg.norm(uv[triangles[:, [1, 2, 0]]] - uv[triangles], axis=2)
    shared = facts.seen_by[:, triangles].all(axis=2).sum(axis=0)
    flat = np.column_stack([uv, np.zeros(len(uv))])
    bad = (sides.max(axis=1) > LONG * np.median(sides)) | (shared < 2)
    bad |= np.minimum(face_quality(flat, triangles), face_quality(positions, triangles)) < MIN_QUALITY
    while True:
        ends = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        _, edge, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
        at_border = (count[edge.ravel()] == 1).reshape(-1, 3).any(axis=1)
        keep = ~(bad & at_border)
        if keep.all():
            return triangles
        triangles, bad = triangles[keep], bad[keep]


def _without_islands(triangles: np.ndarray) -> np.ndarray:
    """Remove edge-connected components with less than `LEAST_ISLAND` of the faces."""
    if len(triangles) == 0:
        return triangles
    ends = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, edge = np.unique(ends, axis=0, return_inverse=True)
    edge = edge.ravel() + len(triangles)
    nodes = int(edge.max()) + 1
    graph = coo_array((np.ones(len(edge)), (np.repeat(np.arange(len(triangles)), 3), edge)), shape=(nodes, nodes))
    part = connected_components(graph, directed=False)[1][: len(triangles)]
    return triangles[np.bincount(part)[part] >= LEAST_ISLAND * len(triangles)]


def _is_on(patch: _Patch, points: np.ndarray) -> np.ndarray:
    """(p,) bool: points (p, 3) on a patch, within half the size of the face that they project onto."""
    uv, depth = patch.camera.project(points)
    height, width = patch.face_id.shape
    with np.errstate(invalid="ignore"):
        column, row = np.nan_to_num(np.rint(uv), nan=-1, posinf=-1, neginf=-1).clip(-1, 2**30).astype(np.int64).T
    inside = (depth > 0) & (column >= 0) & (row >= 0) & (column < width) & (row < height)
    column, row = np.where(inside, column, 0), np.where(inside, row, 0)
    face = patch.face_id[row, column]
    inside &= face >= 0
    off = np.abs(depth - np.where(inside, patch.depth[row, column], 0)) * patch.camera.K[0, 0]
    return inside & (off <= patch.tolerance[face] * depth)


def _bridges(patch: _Patch, corners: np.ndarray) -> np.ndarray:
    """(m,) bool: faces (m, 3, 3) of which more than one of four inner points lies on a patch."""
    weights = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]], dtype=float)
    weights /= weights.sum(axis=1, keepdims=True)
    inner = np.einsum("kc,mcx->mkx", weights, corners)
    return _is_on(patch, inner.reshape(-1, 3)).reshape(-1, 4).sum(axis=1) > 1

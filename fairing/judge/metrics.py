"""Metrics of a mesh: distances to the truth where it is known, distances to sparse points, and energy.

Distances are given in world units and in percent of the diagonal of the scene's start mesh.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fairing.geometry.closest_point import SurfaceTree
from fairing.geometry.normals import face_normals, unit_normals
from fairing.geometry.rasterize import rasterize
from fairing.mesh import Mesh
from fairing.run.session import Session
from fairing.scene import Scene
from fairing.solve.energy import Evaluator
from fairing.solve.point_split import held_out_points, observed_held_out_points
from fairing.terms.point_rays import FARTHEST, points_on_surface

SURFACE_SAMPLES = 20_000
SEEN_FRACTION = 0.3
"""A photo sees a true face if at least this fraction of its outline shows the face ..."""
SEEN_PIXELS = 30
"""... and at least this many pixels."""
SPAN_TOLERANCE = 0.05
"""Normals that span less than this (sine of their angle) count as parallel."""


@dataclass(frozen=True, eq=False)
class Distances:
    """Distances with the length that percentages refer to.

    Attributes:
        values: (n,) float, world units.
        diagonal: diagonal of the start mesh, world units.
    """

    values: np.ndarray
    diagonal: float

    @property
    def percent(self) -> np.ndarray:
        """(n,) float, percent of the diagonal."""
        return 100 * self.values / self.diagonal

    def summary(self) -> dict[str, float]:
        """Root mean square, mean, median and maximum, in percent of the diagonal and in world units."""
        result = {}
        for suffix, values in (("percent", self.percent), ("world", self.values)):
            result |= {
                f"rms_{suffix}": float(np.sqrt((values**2).mean())),
                f"mean_{suffix}": float(values.mean()),
                f"median_{suffix}": float(np.median(values)),
                f"max_{suffix}": float(values.max()),
            }
        return result


@dataclass(frozen=True, eq=False)
class VertexErrors:
    """Distances of vertices to their true positions, split by what photos can determine.

    Attributes:
        total: the whole error.
        determined: its component in the span of the normals of the true surfaces that meet at the vertex.
        sliding: the rest: tangential, along a plane or an edge, where the surface moves within itself.
        seen: the component of `determined` in the span of the normals of the true faces that at least three photos see.
    """

    total: Distances
    determined: Distances
    sliding: Distances
    seen: Distances


def vertex_errors(scene: Scene, vertices: np.ndarray) -> VertexErrors:
    """Distances of vertices to their true positions. Without known normals the whole error counts as determined.

    Args:
        scene: its truth must name vertices.
        vertices: (n, 3) float, world units.
    """
    error = vertices - _true_vertices(scene)
    determined = determined_part(scene, error)
    diagonal = scene.mesh.diagonal
    parts = (error, determined, error - determined, seen_part(scene, determined))
    return VertexErrors(*(Distances(np.linalg.norm(part, axis=1), diagonal) for part in parts))


def determined_part(scene: Scene, error: np.ndarray) -> np.ndarray:
    """Projection of each vertex's error on the span of its true normals.

    Args:
        error: (n, 3) float, world units.

    Returns:
        (n, 3) float, world units.
    """
    normals = scene.truth.normals if scene.truth is not None else None
    if normals is None:
        return error.copy()
    result = np.empty_like(error)
    for v, meeting in enumerate(normals):
        _, strength, directions = np.linalg.svd(meeting, full_matrices=False)
        basis = directions[strength > SPAN_TOLERANCE * strength[0]]
        result[v] = basis.T @ (basis @ error[v])
    return result


def seen_part(scene: Scene, error: np.ndarray) -> np.ndarray:
    """Projection of each vertex's error on the span of the normals of those of its true faces that three photos see.

    No photo can correct what lies inside a porch or behind a pillar. A photo sees a face if at least `SEEN_FRACTION` of its
    outline and `SEEN_PIXELS` pixels show the face itself; the energy needs at least three photos.

    Args:
        error: (n, 3) float, world units.

    Returns:
        (n, 3) float, world units.
    """
    vertices, faces = _true_vertices(scene), scene.mesh.faces
    normals, _ = unit_normals(vertices, faces)
    photos = np.zeros(len(faces), dtype=int)
    for view in scene.views:
        shown = rasterize(vertices, faces, view.camera)[0]
        pixels = np.bincount(shown[shown >= 0], minlength=len(faces))
        uv, depth = view.camera.project(vertices)
        a, b, c = uv[faces].transpose(1, 0, 2)
        area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
        front = (normals * (view.camera.center - vertices[faces[:, 0]])).sum(axis=1) > 0
        photos += front & (depth[faces] > 0).all(axis=1) & (pixels >= np.maximum(SEEN_FRACTION * area, SEEN_PIXELS))
    result = np.zeros_like(error)
    for v, ring in enumerate(scene.mesh.one_rings):
        seen = ring[photos[ring] >= 3]
        if len(seen) == 0:
            continue
        _, strength, directions = np.linalg.svd(normals[seen], full_matrices=False)
        basis = directions[strength > SPAN_TOLERANCE * strength[0]]
        result[v] = basis.T @ (basis @ error[v])
    return result


def sample_surface(mesh: Mesh, count: int = SURFACE_SAMPLES, seed: int = 0) -> np.ndarray:
    """(count, 3) float, world units: points spread evenly over the area of a mesh, the same in every call."""
    rng = np.random.default_rng(seed)
    area = np.linalg.norm(face_normals(mesh.vertices, mesh.faces), axis=1)
    # Stratified along the summed areas: lower variance than independent draws.
    where = (np.arange(count) + rng.random(count)) / count * area.sum()
    face = np.minimum(np.searchsorted(np.cumsum(area), where, side="right"), len(area) - 1)
    a, b = rng.random(count), rng.random(count)
    a, b = np.where(a + b > 1, 1 - a, a), np.where(a + b > 1, 1 - b, b)
    corners = mesh.vertices[mesh.faces[face]]
    return a[:, None] * corners[:, 0] + b[:, None] * corners[:, 1] + (1 - a - b)[:, None] * corners[:, 2]


def surface_distance(mesh: Mesh, surface: Mesh | SurfaceTree, diagonal: float) -> Distances:
    """Exact distances of `SURFACE_SAMPLES` samples of a mesh to a true or reference surface.

    Args:
        diagonal: diagonal of the start mesh, world units.
    """
    tree = surface if isinstance(surface, SurfaceTree) else SurfaceTree(surface)
    return Distances(tree.distance(sample_surface(mesh)), diagonal)


@dataclass(frozen=True, eq=False)
class HeldOutDistances:
    """Distances of the held-out sparse points that belong to the surface, which no fit uses, before and after a run.

    Attributes:
        before, after: of the same points.
        held_out: number of held-out points, with those of the ground, the background and everything else.
    """

    before: Distances
    after: Distances
    held_out: int

    def summary(self) -> dict[str, Any]:
        """Numbers of points, and the distances of those on the surface before and after, if there are any."""
        counts = {"held_out": self.held_out, "on_surface": len(self.before.values)}
        if counts["on_surface"] == 0:
            return counts
        return counts | {"before": self.before.summary(), "after": self.after.summary()}


def held_out_distances(scene: Scene, start: np.ndarray, end: np.ndarray) -> HeldOutDistances | None:
    """Distances of the held-out sparse points to the surface before and after a run.

    A point belongs to the surface if it does at the start or at the end: where its photos are known, they see the mesh in its
    direction, within a tenth of the diagonal (`points_on_surface`); else it lies within a tenth of the diagonal.

    Args:
        start, end: (n, 3) float, world units: vertices of the welded mesh.

    Returns:
        None if the scene has no such points.
    """
    found = held_out_distances_of(scene, [scene.mesh.moved(vertices) for vertices in (start, end)])
    return None if found is None else HeldOutDistances(found[0], found[1], len(held_out_points(scene)))


def held_out_distances_of(scene: Scene, meshes: Sequence[Mesh]) -> tuple[Distances, ...] | None:
    """Distances of the same held-out sparse points to the surfaces of several meshes: of those that belong to any of them.

    A point belongs to a surface as in `held_out_distances`, which also says when the result is None.
    """
    held_out, observed = held_out_points(scene), observed_held_out_points(scene)
    if len(held_out) == 0:
        return None
    diagonal, trees = scene.mesh.diagonal, [SurfaceTree(mesh) for mesh in meshes]
    if len(observed):
        cameras = [view.camera for view in scene.views]
        belongs = np.logical_or.reduce([points_on_surface(mesh, cameras, observed) for mesh in meshes])
        found = [tree.distance(observed.positions[belongs]) for tree in trees]
    else:
        found = [tree.distance(held_out) for tree in trees]
        belongs = np.min(found, axis=0) < FARTHEST / 100 * diagonal
        found = [distances[belongs] for distances in found]
    return tuple(Distances(distances, diagonal) for distances in found)


def reprojection_error(scene: Scene, vertices: np.ndarray, determined_only: bool = True) -> np.ndarray:
    """Distance of the projections of vertices and of their true positions, rms over the photos that contain them.

    Args:
        vertices: (n, 3) float, world units.
        determined_only: exclude the component of the error that slides along the surface.

    Returns:
        (n,) float, px; NaN for a vertex outside all photos.
    """
    truth = _true_vertices(scene)
    error = vertices - truth
    moved = truth + (determined_part(scene, error) if determined_only else error)
    total, count = np.zeros(len(vertices)), np.zeros(len(vertices))
    for view in scene.views:
        (there, depth), (here, _) = view.camera.project(truth), view.camera.project(moved)
        size = np.array([view.camera.width, view.camera.height])
        inside = (depth > 0) & (there >= 0).all(axis=1) & (there <= size - 1).all(axis=1)
        total[inside] += ((here - there)[inside] ** 2).sum(axis=1)
        count += inside
    with np.errstate(invalid="ignore"):
        return np.sqrt(total / count)


def flipped_faces(start: np.ndarray, end: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Faces whose normal has turned by more than a right angle between two states.

    Args:
        start, end: (n, 3) float: vertices of both states, in any unit.
        faces: (m, 3) int.

    Returns:
        (f,) int: face ids.
    """
    return np.flatnonzero((face_normals(start, faces) * face_normals(end, faces)).sum(axis=1) < 0)


@dataclass(frozen=True, eq=False)
class EnergySummary:
    """E of Eq. 2 at one moment, under the visibility and robust scale of that moment's sweep.

    Attributes:
        total: sum over faces.
        by_face: (m,) float.
        by_view: (V,) float.
        median_residual: (m,) float, grey levels; 0 for faces that take no part.
    """

    total: float
    by_face: np.ndarray
    by_view: np.ndarray
    median_residual: np.ndarray


def energy_summary(session: Session, moment: int | None = None) -> EnergySummary:
    """The energy of all faces at a moment (default: the present one)."""
    moment = session.moment if moment is None else moment
    sweep = session.sweep_state(moment)
    everything = np.arange(len(session.scene.mesh.faces))
    evaluator = Evaluator(session.options.threads)
    found = evaluator.measure(sweep.context, session.trace.vertices_at(moment), everything, sweep.scale)
    by_view = sweep.context.sum_by_view(found.pair_energy)
    return EnergySummary(float(found.energy.sum()), found.energy, by_view, found.median)


def quality_report(scene: Scene, start: np.ndarray, end: np.ndarray) -> dict[str, Any]:
    """All metrics of a run that need no rendering, as plain numbers before and after.

    Args:
        start, end: (n, 3) float, world units: vertices of the welded mesh.
    """
    report: dict[str, Any] = {"flipped_faces": flipped_faces(start, end, scene.mesh.faces).tolist()}
    states = {"before": start, "after": end}
    if (distances := held_out_distances(scene, start, end)) is not None:
        report["sparse_points_to_surface"] = distances.summary()
    if scene.truth is None:
        return report
    tree = SurfaceTree(scene.truth.surface)
    report["surface_to_truth"] = {
        name: surface_distance(scene.mesh.moved(vertices), tree, scene.mesh.diagonal).summary()
        for name, vertices in states.items()
    }
    if scene.truth.vertices is not None:
        errors = {name: vertex_errors(scene, vertices) for name, vertices in states.items()}
        for part in ("total", "determined", "sliding", "seen"):
            report[f"vertices_{part}"] = {name: getattr(error, part).summary() for name, error in errors.items()}
        worse = errors["after"].determined.percent - errors["before"].determined.percent
        report["vertices_determined"]["most_worsened_percent"] = float(worse.max())
        report["reprojection_px"] = {
            name: {
                "rms": float(np.sqrt(np.nanmean(e**2))),
                "median": float(np.nanmedian(e)),
                "max": float(np.nanmax(e)),
            }
            for name, e in ((name, reprojection_error(scene, vertices)) for name, vertices in states.items())
        }
    return report


def _true_vertices(scene: Scene) -> np.ndarray:
    assert scene.truth is not None, "the scene has no truth"
    assert scene.truth.vertices is not None, "the scene's truth names no vertices"
    return scene.truth.vertices

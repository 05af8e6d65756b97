"""State of a sweep: visibility, robust scale, the terms of the objective, and the blocks of vertices in their order."""

from dataclasses import dataclass

import numpy as np

from fairing.cells.context import CellContext
from fairing.creases.alignment import aligned_to_image_edges
from fairing.features.points import FeaturePoints
from fairing.geometry.normal_filter import smoothed
from fairing.geometry.normals import unit_normals
from fairing.mesh import Mesh
from fairing.run.fits import points_prior
from fairing.run.phases import Level
from fairing.run.stages import Photos
from fairing.scene import Scene
from fairing.solve.blocks import Block, plan_blocks
from fairing.solve.energy import FaceSystem, robust_scale
from fairing.solve.face_loss import loss_of_faces
from fairing.solve.normal_equations import Prior, QuadraticPrior, faded, vertex_systems
from fairing.solve.problem import Problem
from fairing.solve.step_limits import pixels_moved, pixels_per_unit
from fairing.terms.names import IMAGE_EDGES, SMOOTHNESS, START

# Of the residuals around a vertex, grey levels^2: the prior to the points fades below it (ledger: prior to points).
POINTS_VARIANCE = 8.0
# px^2 of the photos: the area over which residuals of what is not on the mesh agree (ledger: prior to the start).
RESIDUAL_AREA = 10_000.0
CREASE_PRECISION = 4.0  # 1 / px^2: of a vertex aligned with image edges, at most (ledger: prior to image edges)
BUILDING = 2.0  # factor of the strength of image edges where the mesh has a Manhattan frame (ledger: Manhattan frame)
FLAT = 0.01  # variance of the unit normals around a vertex along a direction below which the surface is flat along it
VERTEX_PASSES = 3  # of the filter that gives the targets of the smoothness prior


@dataclass(frozen=True, eq=False)
class SweepState:
    """What is constant during a sweep: a function of the vertices at its beginning.

    Attributes:
        moment: at which the sweep began.
        stage: the stage the sweep belongs to.
        context: cells and visibility.
        sigma: (m,) float: scale parameter of the robust loss by face, grey levels.
        scale: (m,) float: the value of the kernels for it, see `robust_scale`.
        prior: quadratic priors of the vertices.
        origin: (n, 3) float: positions at the prepared start, or after the last manual edit of a vertex, world units.
        free: (n,) bool: vertices that are not locked and that enough photos see.
        blocks: in their order.
        pixels_per_unit: (n,) float: largest motion of a vertex in a photo, px per world unit; 0 where unseen.
        near_points: of the surface sweeps of the last fit; None without any.
        system: normal equations of all faces at the beginning, by all corners, for a first step of all vertices at once; else None.
    """

    moment: int
    stage: Photos
    context: CellContext
    sigma: np.ndarray
    scale: np.ndarray
    prior: Prior
    origin: np.ndarray
    free: np.ndarray
    blocks: list[Block]
    pixels_per_unit: np.ndarray
    near_points: FeaturePoints | None
    system: FaceSystem | None

    def longest_move(self, scene: Scene, vertices: np.ndarray) -> float:
        """Longest move of a free vertex in a photo since the beginning of the sweep, px; vertices (n, 3): positions now."""
        ids, begun = np.flatnonzero(self.free), self.context.vertices
        moved = pixels_moved(scene.views, self.context.vertex_views, begun, ids, vertices[ids] - begun[ids])
        return float(moved.max(initial=0))


def begin_sweep(
    problem: Problem,
    level: Level,
    stage: Photos,
    moment: int,
    vertices: np.ndarray,
    origin: np.ndarray,
    near_points: FeaturePoints | None = None,
) -> SweepState:
    """Compute visibility, robust scale, priors and blocks.

    Args:
        level: gives the strengths of the priors.
        stage: the stage the sweep belongs to.
        moment: of the beginning.
        vertices: (n, 3) float: positions then, world units.
        origin: (n, 3) float, see `SweepState`.
        near_points: see `SweepState`.

    Raises:
        InputError: no photo sees any face well enough at the last level.
        Cancelled: cancellation was requested.
    """
    options, mesh = problem.options, problem.scene.mesh
    context = problem.context(level.number, vertices)
    sigma = problem.sigma(context, vertices)
    scale = robust_scale(options.robust, sigma)
    everything = np.arange(len(mesh.faces))
    system = problem.linearise(context, vertices, everything, np.full(len(everything), -1), scale)
    H, _ = vertex_systems(mesh, system)
    information = np.linalg.eigvalsh(H)[:, 2]
    informed = information > 0
    typical = float(np.median(information[informed])) if informed.any() else 0.0
    pixels = pixels_per_unit(problem.scene.views, context.vertex_views, vertices)
    loss = _vertex_losses(mesh, context, system)
    is_smoothed = level.smoothing > 0 and informed.any()
    if level.start_sigma > 0:
        terms = [_to_start(origin, loss, level.prior * (pixels / level.start_sigma) ** 2)]
    else:
        terms = [_within_surface(mesh, vertices, origin, context.takes_part, level.prior * np.maximum(information, 0))]
    if is_smoothed:
        terms.append(_to_smoothed(mesh, vertices, level.smoothing * typical))
    if level.attraction > 0:
        variance = _vertex_losses(mesh, context, system, sigma**2)
        terms.append(_to_points(problem, vertices, near_points, level.attraction * typical, variance))
    if level.creases > 0:
        strength = level.creases * RESIDUAL_AREA * loss
        terms.append(_to_image_edges(problem, vertices, level.edge_reach, pixels, strength, H))
    free = ~problem.locked & (informed | is_smoothed)  # the smoothness prior determines vertices that no photo sees
    movable = free & ((pixels > 0) | is_smoothed)
    blocks = plan_blocks(mesh, movable, options.schedule.order, system.energy)
    return SweepState(
        moment,
        stage,
        context,
        sigma,
        scale,
        Prior(tuple(terms)),
        origin,
        free,
        blocks,
        pixels,
        near_points,
        system if options.schedule.order == "joint" else None,
    )


def _to_start(origin: np.ndarray, loss: np.ndarray, precision: np.ndarray) -> QuadraticPrior:
    """Prior to the origin (n, 3): strong where photos contradict each other, negligible where they agree.

    It holds what nothing else determines. (ledger: prior to the start)

    Args:
        loss: (n,) float: mean loss per photo px around each vertex.
        precision: (n,) float: 1 / variance of the start, 1 / world unit^2.
    """
    strength = RESIDUAL_AREA * loss * precision
    return QuadraticPrior(strength[:, None, None] * np.eye(3), origin, START)


def _within_surface(
    mesh: Mesh, vertices: np.ndarray, origin: np.ndarray, takes_part: np.ndarray, strength: np.ndarray
) -> QuadraticPrior:
    """Prior to the origin (n, 3) in directions in which the surface moves within itself: within a plane, along an edge.

    The normals of the faces around a vertex have no spread along these. Photos that show little texture there would let the
    vertex slide; perpendicular to them the prior has no strength. (ledger: prior to the start)

    Args:
        vertices: (n, 3) float, world units.
        takes_part: (m,) bool: faces that enough photos see.
        strength: (n,) float: energy / world unit^2.
    """
    normals, area = unit_normals(vertices, mesh.faces)
    weight = np.repeat(area * takes_part, 3)
    spread, total = np.zeros((len(vertices), 3, 3)), np.zeros(len(vertices))
    np.add.at(
        spread, mesh.faces.ravel(), weight[:, None, None] * np.repeat(normals[:, :, None] * normals[:, None], 3, axis=0)
    )
    np.add.at(total, mesh.faces.ravel(), weight)
    values, vectors = np.linalg.eigh(spread / np.maximum(total, 1e-300)[:, None, None])
    flat = (values < FLAT) * strength[:, None]
    return QuadraticPrior(np.einsum("vik,vk,vjk->vij", vectors, flat, vectors), origin, START)


def _to_smoothed(mesh: Mesh, vertices: np.ndarray, strength: float) -> QuadraticPrior:
    """Smoothness prior: to vertices (n, 3) after smoothing; strength: energy / world unit^2."""
    hessians = np.tile(strength * np.eye(3), (len(vertices), 1, 1))
    return QuadraticPrior(hessians, smoothed(mesh, vertices, VERTEX_PASSES), SMOOTHNESS)


def _to_points(
    problem: Problem, vertices: np.ndarray, near_points: FeaturePoints | None, strength: float, variance: np.ndarray
) -> QuadraticPrior:
    """Prior to the vertices (n, 3) fitted to the points; it fades where the photos agree.

    Args:
        near_points: see `SweepState`.
        strength: energy / world unit^2 in an average direction of a vertex.
        variance: (n,) float: of the residuals around each vertex, grey levels^2; 0 where no photo sees the mesh.
    """
    to_points = points_prior(problem, vertices, near_points)
    share = np.minimum(1.0, np.where(variance == 0, np.inf, variance) / POINTS_VARIANCE)
    return to_points._replace(hessians=(strength * share)[:, None, None] * to_points.hessians)


def _to_image_edges(
    problem: Problem, vertices: np.ndarray, reach: float, pixels: np.ndarray, strength: np.ndarray, H: np.ndarray
) -> QuadraticPrior:
    """Prior to the vertices aligned with image edges; it fades in directions that the cells determine better.

    Args:
        vertices: (n, 3) float, world units.
        reach: distance from a crease within which its image edge is sought, px.
        pixels: (n,) float: largest motion in a photo, px per world unit.
        strength: (n,) float: energy of a deviation, times px^2.
        H: (n, 3, 3) float: normal matrices of the cells, energy / world unit^2.
    """
    aligned = aligned_to_image_edges(
        problem.scene.views,
        vertices,
        problem.scene.mesh.faces,
        problem.locked,
        problem.orientation,
        reach,
        problem.evaluator.pool,
        problem.raise_if_cancelled,
    )
    # Offsets of one vertex err together, so that more of them add nothing beyond a limit.
    largest = np.linalg.eigvalsh(aligned.information)[:, 2]
    limited = np.minimum(1.0, CREASE_PRECISION * pixels**2 / np.where(largest > 0, largest, np.inf))
    edges = (strength * limited * (BUILDING if aligned.is_building else 1.0))[:, None, None] * aligned.information
    # Offsets are less accurate than vertices that the cells determine well (ledger: prior to image edges).
    return QuadraticPrior(faded(edges, H), aligned.vertices, IMAGE_EDGES)


def _vertex_losses(mesh: Mesh, context: CellContext, system: FaceSystem, unit: np.ndarray | None = None) -> np.ndarray:
    """(n,) float: mean loss per photo px of the faces around each vertex; 0 where no photo sees them.

    Args:
        unit: (m,) float: of the loss of each face; default: 1.
    """
    loss, pixels = loss_of_faces(context, system.energy, system.faces)
    if unit is not None:
        loss = loss * unit[system.faces]
    total, weight = (
        np.bincount(mesh.faces[system.faces].ravel(), weights=np.repeat(values, 3), minlength=len(mesh.vertices))
        for values in (loss * pixels, pixels)
    )
    return total / np.maximum(weight, 1e-300)

"""State of a sweep: visibility, robust scale, priors, and the blocks of vertices in their order."""

from dataclasses import dataclass, replace

import numpy as np

from fairing.cells.context import CellContext
from fairing.creases.alignment import aligned_to_image_edges
from fairing.features.points import FeaturePoints
from fairing.geometry.normal_filter import smoothed
from fairing.mesh import Mesh
from fairing.options import by_level
from fairing.run.phases import GaussNewton, Level, LocalSearch, Phase, Restart, SecondFit
from fairing.scene import Scene
from fairing.solve.blocks import Block, plan_blocks, restart_block
from fairing.solve.energy import FaceSystem, fixed_sigma, robust_scale, robust_sigma
from fairing.solve.face_loss import loss_of_faces
from fairing.solve.normal_equations import Prior, QuadraticPrior, faded, undetermined_directions, vertex_systems
from fairing.solve.point_fit import fitted_to_points
from fairing.solve.problem import Problem
from fairing.solve.step_limits import pixels_moved, pixels_per_unit

POOR_FIT = 2.0  # in units of the median loss: vertices above it are restarted
WELL_SEEN = 0.6  # fraction of the faces around a vertex (ledger: well-seen vertices)
# Of the residuals around a vertex, grey levels^2: the prior to the points fades below it (ledger: prior to points).
POINTS_VARIANCE = 8.0
# px^2 of the photos: the area over which residuals of what is not on the mesh agree (ledger: prior to the start).
RESIDUAL_AREA = 10_000.0
CREASE_PRECISION = 4.0  # 1 / px^2: of a vertex aligned with image edges, at most (ledger: prior to image edges)
BUILDING = 2.0  # factor of the strength of image edges where the mesh has a Manhattan frame (ledger: Manhattan frame)
FIT_ROUNDS = 2  # of the fit to the sparse points, from the vertices at the beginning of the sweep
VERTEX_PASSES = 3  # of the filter that gives the targets of the smoothness prior


@dataclass(frozen=True, eq=False)
class SweepState:
    """What is constant during a sweep: a function of the vertices at its beginning.

    Attributes:
        moment: at which the sweep began.
        phase: the phase the sweep belongs to.
        context: cells and visibility.
        sigma: (m,) float: scale parameter of the robust loss by face, grey levels.
        scale: (m,) float: the value of the kernels for it, see `robust_scale`.
        prior: quadratic priors of the vertices.
        origin: (n, 3) float: positions at the prepared start, or after the last manual edit of a vertex, world units.
        free: (n,) bool: vertices that are not locked and that enough photos see.
        blocks: in their order.
        pixels_per_unit: (n,) float: largest motion of a vertex in a photo, px per world unit; 0 where unseen.
        mean_loss: of the mesh, per photo px.
        near_points: of the surface sweeps of the last fit; None without any.
        system: normal equations of all faces at the beginning, by all corners, for a first step of all vertices at once; else None.
    """

    moment: int
    phase: Phase
    context: CellContext
    sigma: np.ndarray
    scale: np.ndarray
    prior: Prior
    origin: np.ndarray
    free: np.ndarray
    blocks: list[Block]
    pixels_per_unit: np.ndarray
    mean_loss: float
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
    phase: Phase,
    moment: int,
    vertices: np.ndarray,
    origin: np.ndarray,
    among: np.ndarray | None = None,
    near_points: FeaturePoints | None = None,
) -> SweepState:
    """Compute visibility, robust scale, priors and blocks.

    Args:
        level: gives the strengths of the priors.
        phase: what the sweep does; it need not be one of the level's.
        moment: of the beginning.
        vertices: (n, 3) float: positions then, world units.
        origin: (n, 3) float, see `SweepState`.
        among: (n,) bool: only these vertices may move, and only the faces around them are evaluated; default: all.
        near_points: see `SweepState`.

    Raises:
        InputError: no photo sees any face well enough at the last level.
        Cancelled: cancellation was requested.
    """
    options, mesh = problem.options, problem.scene.mesh
    context, sigma = _context_and_sigma(problem, level.number, phase, vertices, among)
    scale = robust_scale(options.robust, sigma)
    everything = np.arange(len(mesh.faces))
    system = problem.linearise(context, vertices, everything, np.full(len(everything), -1), scale)
    H, _ = vertex_systems(mesh, system)
    information = np.linalg.eigvalsh(H)[:, 2]
    informed = information > 0
    typical = float(np.median(information[informed])) if informed.any() else 0.0
    tangential, weak = undetermined_directions(vertices, mesh, H, context.takes_part, options.step, level.prior)
    terms = [QuadraticPrior(tangential, origin)]
    pixels = pixels_per_unit(problem.scene.views, context.vertex_views, vertices)
    free = informed & ~problem.locked
    if among is not None:
        free &= among
    movable = free & (pixels > 0)
    loss = _vertex_losses(mesh, context, system)
    if level.start_sigma > 0:
        # Where photos contradict each other, the start counts for more; where they agree, its share is negligible.
        strength = RESIDUAL_AREA * loss * (pixels / level.start_sigma) ** 2
        terms.append(QuadraticPrior(strength[:, None, None] * np.eye(3), origin))
    else:  # nothing else keeps weakly seen directions from diverging (ledger: prior of weak directions)
        terms.append(QuadraticPrior(weak + _inertia(information, pixels, level.inertia), vertices))
    if level.smoothing > 0 and informed.any():
        targets = smoothed(mesh, vertices, VERTEX_PASSES)
        terms.append(QuadraticPrior(np.tile(level.smoothing * typical * np.eye(3), (len(vertices), 1, 1)), targets))
        movable = free = ~problem.locked  # the smoothness prior determines vertices that no photo sees
    area = float((context.footprint_area * context.n_views)[context.takes_part].sum())
    mean_loss = float(system.energy.sum()) / area if area > 0 else 0.0
    if level.attraction > 0:
        to_points = fitted_to_points(problem, vertices, FIT_ROUNDS, near_points)
        variance = _vertex_losses(mesh, context, system, sigma**2)
        variance[variance == 0] = np.inf  # where no photo sees the mesh, the points alone count
        strength = level.attraction * typical * np.minimum(1.0, variance / POINTS_VARIANCE)
        terms.append(to_points._replace(hessians=strength[:, None, None] * to_points.hessians))
    if level.creases > 0 and among is None and isinstance(phase, GaussNewton):
        strength = level.creases * RESIDUAL_AREA * loss
        terms.append(_to_image_edges(problem, vertices, level.edge_reach, pixels, strength, H))
    match phase:
        case GaussNewton():
            blocks = plan_blocks(mesh, movable, options.schedule.order, system.energy)
        case LocalSearch():
            blocks = plan_blocks(mesh, movable & _well_seen(mesh, context.takes_part), "independent", system.energy)
        case Restart() | SecondFit():
            blocks = [restart_block(mesh, np.flatnonzero(free))] if free.any() else []
    return SweepState(
        moment,
        phase,
        context,
        sigma,
        scale,
        Prior(tuple(terms)),
        origin,
        free,
        blocks,
        pixels,
        mean_loss,
        near_points,
        system if isinstance(phase, GaussNewton) and options.schedule.order == "joint" else None,
    )


def _inertia(information: np.ndarray, pixels: np.ndarray, inertia: float) -> np.ndarray:
    """Hessians (n, 3, 3) float of a prior that resists the same move in a photo equally at all vertices.

    Where there is hardly any texture, vertices would drift on the noise of the photos (ledger: inertia).

    Args:
        information: (n,) float: largest eigenvalue of the cells' normal matrix, energy / world unit^2.
        pixels: (n,) float: largest motion in a photo, px per world unit.
        inertia: see `Level`.
    """
    seen = (information > 0) & (pixels > 0)
    typical = float(np.median(information[seen] / pixels[seen] ** 2)) if seen.any() else 0.0
    return (inertia * typical * pixels**2)[:, None, None] * np.eye(3)


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
    limited = np.minimum(1.0, CREASE_PRECISION * pixels**2 / np.maximum(largest, 1e-300))
    edges = (strength * limited * (BUILDING if aligned.is_building else 1.0))[:, None, None] * aligned.information
    # Offsets are less accurate than vertices that the cells determine well (ledger: prior to image edges).
    return QuadraticPrior(faded(edges, H), aligned.vertices)


def fits_poorly(mesh: Mesh, context: CellContext, system: FaceSystem, among: np.ndarray) -> np.ndarray:
    """(n,) bool: vertices whose faces have a mean loss above `POOR_FIT` times the median over a mask (n,) bool."""
    mean = _vertex_losses(mesh, context, system)
    return mean > POOR_FIT * np.median(mean[among]) if among.any() else among


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


def _context_and_sigma(
    problem: Problem, level: int, phase: Phase, vertices: np.ndarray, among: np.ndarray | None
) -> tuple[CellContext, np.ndarray]:
    """Cells with their final eigenspace dimensions, and the scale parameter (m,) by face, grey levels."""
    options = problem.options
    context = problem.context(level, vertices, among)
    # A search compares positions with different residuals, so all of them need the same sigma (ledger: sigma of searches).
    robust = options.robust if isinstance(phase, GaussNewton) else replace(options.robust, sigma_rule=("fixed",))
    fixed = fixed_sigma(robust, level)
    significance = by_level(options.eigenspace.significance, level)
    if fixed is not None and significance == 0:
        return context, np.full(len(problem.scene.mesh.faces), fixed)
    unscaled = np.ones(len(problem.scene.mesh.faces))
    measured = problem.measure(context, vertices, unscaled)
    shorter = context.with_reduced_dimensions(measured.singular_value_ratio, significance)
    sigma = robust_sigma(robust, level, measured)
    if fixed is None:
        changed = np.flatnonzero(shorter.kernel.face_dimensions != context.kernel.face_dimensions)
        again = problem.evaluator.measure(shorter, vertices, changed, unscaled)
        sigma[changed] = robust_sigma(robust, level, again)
    return shorter, sigma


def _well_seen(mesh: Mesh, takes_part: np.ndarray) -> np.ndarray:
    """(n,) bool: vertices with enough faces that take part.

    If most faces around a vertex are unseen, a distant position that fits the few seen ones is seldom right.
    """
    count, seen = (
        np.bincount(mesh.faces.ravel(), weights=np.repeat(part, 3), minlength=len(mesh.vertices))
        for part in (np.ones(len(mesh.faces)), takes_part.astype(float))
    )
    return seen >= WELL_SEEN * np.maximum(count, 1)

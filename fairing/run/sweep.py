"""What holds for a whole sweep: visibility, robust scale, priors, and what moves together in which order."""

from dataclasses import dataclass, replace

import numpy as np

from fairing.cells.context import CellContext
from fairing.geometry.normal_filter import smoothed
from fairing.mesh import Mesh
from fairing.options import by_level
from fairing.run.local_search import loss_of_faces
from fairing.scene import Scene
from fairing.solve.blocks import Block, plan_blocks, restart_block
from fairing.solve.energy import FaceSystem, robust_scale, robust_sigma
from fairing.solve.normal_equations import Prior, QuadraticPrior, undetermined_directions, vertex_systems
from fairing.solve.point_fit import fitted_to_points
from fairing.solve.problem import Problem
from fairing.solve.step_limits import pixels_moved, pixels_per_unit

BADLY = 2.0  # times the median loss: a vertex that is tried again
WELL_SEEN = 0.6  # part of the faces around a vertex
FIT_ROUNDS = 3  # to the sparse points, from where the sweep begins
VERTEX_PASSES = 3  # of the filter whose result a noisy start is pulled to


@dataclass(frozen=True, eq=False)
class SweepState:
    """What holds for a whole sweep, a function of the vertices at its beginning.

    Attributes:
        moment: when the sweep began.
        context: cells and visibility.
        sigma: (m,) float, grey levels, scale of the robust norm by face.
        scale: (m,) float, what the kernel wants of it.
        prior: what holds vertices besides the photos.
        origin: (n, 3) float: their start, or where a hand put them, world units.
        free: (n,) bool: vertices that may move and that enough photos see.
        units: what moves together, in order.
        search_radius: px; 0 for a sweep of Gauss-Newton.
        pixels_per_unit: (n,) float: how far a vertex moves at most in a photo, px per world unit; 0 where unseen.
        mean_loss: of the mesh, per photo px.
    """

    moment: int
    context: CellContext
    sigma: np.ndarray
    scale: np.ndarray
    prior: Prior
    origin: np.ndarray
    free: np.ndarray
    units: list[Block]
    search_radius: float
    pixels_per_unit: np.ndarray
    mean_loss: float

    def longest_move(self, scene: Scene, vertices: np.ndarray) -> float:
        """How far the sweep has moved any of its vertices in a photo, px; vertices (n, 3) are where they are now."""
        ids, begun = np.flatnonzero(self.free), self.context.vertices
        moved = pixels_moved(scene.views, self.context.vertex_views, begun, ids, vertices[ids] - begun[ids])
        return float(moved.max(initial=0))


def begin_sweep(
    problem: Problem,
    level: int,
    moment: int,
    vertices: np.ndarray,
    origin: np.ndarray,
    prior_strength: float,
    search_radius: float = 0.0,
    smoothing: float = 0.0,
    attraction: float = 0.0,
    restart_level: int | None = None,
    only_again: bool = False,
    among: np.ndarray | None = None,
) -> SweepState:
    """Judge visibility and plan what moves.

    Args:
        level, moment: the sweep's.
        vertices: (n, 3) float: where they are then, world units.
        origin: (n, 3) float: their start, or where a hand put them.
        prior_strength: of the pull along what the photos do not determine, see `StepOptions.prior`.
        search_radius: how far from each vertex to look for a better place, px; 0 for a sweep of Gauss-Newton.
        smoothing: pull to where the faces would be smooth, as a fraction of the median of the vertices' largest
            eigenvalues; vertices that no photo determines then move, too.
        attraction: pull to the sparse points in a direction they know as well as others on average, in the same units.
        restart_level: level from which a search tries again what fits badly, when its other units are done.
        only_again: the search has no other units, and any vertex may be tried again.
        among: (n,) bool: only these vertices may move, and only the faces around them are judged.

    Raises:
        InputError: no photo sees any face well enough at the last level.
        Cancelled: nobody wants it any more.
    """
    options, mesh = problem.options, problem.scene.mesh
    context = problem.context(level, vertices, among)
    unscaled = np.ones(len(mesh.faces))
    measured = problem.measure(context, vertices, unscaled)
    shorter = context.with_reduced_dimensions(
        measured.singular_value_ratio, by_level(options.eigenspace.significance, level)
    )
    if shorter is not context:
        context = shorter
        measured = problem.measure(context, vertices, unscaled)
    # A search compares places whose residuals differ, by one yardstick (facade at the finest blur, all vertices searched:
    # determined rms 0.393 -> 0.379 % with the paper's sigma, which follows each face's largest residual, 0.366 with one).
    robust = replace(options.robust, sigma_rule=("fixed",)) if search_radius > 0 else options.robust
    sigma = robust_sigma(robust, level, measured)
    scale = robust_scale(options.robust, sigma)
    everything = np.arange(len(mesh.faces))
    system = problem.linearise(context, vertices, everything, np.full(len(everything), -1), scale)
    H, _ = vertex_systems(mesh, system)
    strength = np.linalg.eigvalsh(H)[:, 2]
    informed = strength > 0
    sliding, weak = undetermined_directions(vertices, mesh, H, context.takes_part, options.step, prior_strength)
    pulls = [QuadraticPrior(sliding, origin), QuadraticPrior(weak, vertices)]
    pixels = pixels_per_unit(problem.scene.views, context.vertex_views, vertices)
    free = informed & ~problem.locked
    if among is not None:
        free &= among
    movable = free & (pixels > 0)
    typical = float(np.median(strength[informed])) if informed.any() else 0.0
    if attraction > 0:
        to_points = fitted_to_points(problem, vertices, FIT_ROUNDS)
        pulls.append(to_points._replace(blocks=attraction * typical * to_points.blocks))
    if smoothing > 0 and informed.any():
        smooth_places = smoothed(mesh, vertices, VERTEX_PASSES)
        pulls.append(QuadraticPrior(np.tile(smoothing * typical * np.eye(3), (len(vertices), 1, 1)), smooth_places))
        movable = free = ~problem.locked
    badly = np.zeros(len(vertices), dtype=bool)
    if search_radius > 0:
        movable = movable & _well_seen(mesh, context.takes_part)
        if by_level(options.cells.point_spread, level) == "common":
            badly = movable & fits_badly(mesh, context, system, movable, BADLY)
            movable &= fits_badly(mesh, context, system, movable, 1.0)
    order = "independent" if search_radius > 0 else options.schedule.order
    units = [] if only_again else plan_blocks(mesh, movable, order, system.energy)
    # After Gauss-Newton the second try itself tells which of all vertices fit badly (facade, at the end of a run: determined rms
    # 0.262 instead of 0.275 %).
    again = free if only_again else badly
    if restart_level is not None and again.any():
        units.append(restart_block(mesh, np.flatnonzero(again), restart_level))
    area = float((context.footprint_area * context.n_views)[context.takes_part].sum())
    mean_loss = float(system.energy.sum()) / area if area > 0 else 0.0
    return SweepState(
        moment, context, sigma, scale, Prior(tuple(pulls)), origin, free, units, search_radius, pixels, mean_loss
    )


def _well_seen(mesh: Mesh, takes_part: np.ndarray) -> np.ndarray:
    """(n,) bool: vertices of whose faces enough take part for a search to be trusted.

    Where most of the faces around a vertex are unseen, a far place that suits the few seen ones is seldom the right
    one (facade: such vertices went from 0.70 to 1.06 % rms).
    """
    count, seen = (
        np.bincount(mesh.faces.ravel(), weights=np.repeat(part, 3), minlength=len(mesh.vertices))
        for part in (np.ones(len(mesh.faces)), takes_part.astype(float))
    )
    return seen >= WELL_SEEN * np.maximum(count, 1)


def fits_badly(mesh: Mesh, context: CellContext, system: FaceSystem, among: np.ndarray, factor: float) -> np.ndarray:
    """(n,) bool: vertices around which faces fit worse than a factor times the median of a mask (n,).

    Sharp cells tell which those are (facade: determined rms after the search 0.366 with all vertices, 0.347 with those above
    the median, at two thirds of the time).
    """
    loss, pixels = loss_of_faces(context, system.energy, system.faces)
    total, weight = (
        np.bincount(mesh.faces[system.faces].ravel(), weights=np.repeat(values, 3), minlength=len(mesh.vertices))
        for values in (loss * pixels, pixels)
    )
    mean = total / np.maximum(weight, 1e-300)
    return mean > factor * np.median(mean[among]) if among.any() else among

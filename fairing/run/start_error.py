"""Start error: the distance of the start's vertices from their true positions, by sparse points or by trial searches."""

import numpy as np

from fairing.features.robust_fit import displacement, distances_px
from fairing.run.phases import GaussNewton, Level, LocalSearch
from fairing.run.search_step import search_around
from fairing.run.sweep import begin_sweep
from fairing.solve.blocks import independent_block, independent_sets
from fairing.solve.problem import Problem

SEARCHED_ERROR = 3.0  # px: Gauss-Newton reaches that far at the first levels (ledger: search after a fit)
PROBES = 48  # vertices
PROBE_RADII = (3.0, 6.0, 12.0)  # px
PROBE_GAIN = 0.1  # smallest relative decrease of the loss
PROBE_QUANTILE = 0.5
PROBE_MAJORITY = 0.5


def measured_start_error(problem: Problem, start: np.ndarray) -> float:
    """Distance of the start's vertices from their true positions, px, by the observed sparse points; 0 without points.

    Args:
        start: (n, 3) float: positions of the vertices, world units.
    """
    cameras = [view.camera for view in problem.scene.views]
    return displacement(distances_px(problem.scene.mesh.moved(start), cameras, problem.observed_points))


def estimate_start_error(problem: Problem, level: int, start: np.ndarray) -> float:
    """Distance of the start's vertices from their true positions, px, by trial searches; 0 if most find no better position.

    A sample of vertices is searched at several radii. The estimate is the median distance of the positions that lower the
    loss clearly; a vertex without one counts as 0. (ledger: start error)

    Args:
        level: level of the searches.
        start: (n, 3) float: positions of the vertices, world units.
    """
    mesh, options = problem.scene.mesh, problem.options
    sweep = begin_sweep(problem, Level(level, options.step.prior), GaussNewton(1, 1), 0, start, start)
    ids = np.flatnonzero(sweep.free & (sweep.pixels_per_unit > 0))
    if len(ids) == 0:
        return 0.0
    group = max(independent_sets(mesh, ids), key=len)
    block = independent_block(mesh, group[:: -(-len(group) // PROBES)])
    distance, best = np.zeros(len(block.vertices)), np.full(len(block.vertices), 1 - PROBE_GAIN)
    with problem.work.doing("estimating the start error", len(PROBE_RADII), "search") as work:
        for radius in work.each(PROBE_RADII):
            found = search_around(problem, sweep, block, start, LocalSearch(radius, 2 * radius))
            gain = found.score_after / np.maximum(found.score_before, 1e-300)
            moved = np.linalg.norm(found.after - start[block.vertices], axis=1)
            improved = gain < best
            distance[improved] = (moved * sweep.pixels_per_unit[block.vertices])[improved]
            best = np.minimum(best, gain)
    estimate = float(np.quantile(distance, PROBE_QUANTILE))
    return estimate if (distance > 1.0).mean() > PROBE_MAJORITY else 0.0

"""Planning: computes the run plan of a start mesh, see `RunPlan`."""

from typing import NamedTuple

import numpy as np

from fairing.cells.level_choice import first_fine_level, first_level, level_for_error
from fairing.creases.alignment import STAGES
from fairing.geometry.manhattan import relations
from fairing.geometry.pixel_size import pixel_size
from fairing.options import FairingOptions
from fairing.run.phases import first_searching_level
from fairing.run.preparation import Preparations, points_can_judge
from fairing.run.start_error import SEARCHED_ERROR, estimate_start_error, measured_start_error
from fairing.run_plan import RunPlan
from fairing.solve.problem import Problem
from fairing.trace import StepReason

LEAST_ERROR = 1.0  # px: Gauss-Newton reaches that far at every level


def make_plan(problem: Problem, preparations: Preparations) -> RunPlan:
    """The plan of a run: a function of the scene and the options alone. It reads the photos and may take many seconds.

    Raises:
        InputError: no photo sees any face well enough.
        Cancelled: cancellation was requested.
    """
    schedule, searching = problem.options.schedule, first_searching_level(problem.options)
    first = first_level(problem.scene, problem.start, problem.orientation, problem.options)
    prepared = preparations.find()
    is_smoothed, is_fitted = (
        any(preparation.reason == reason for preparation in prepared)
        for reason in (StepReason.SMOOTHED, StepReason.FITTED_TO_POINTS)
    )
    measured = _measure(problem, preparations, prepared[0].after if is_smoothed else problem.start, is_fitted)
    if measured is not None and schedule.first_level == "auto":
        first = max(first, _level_by_points(measured, is_fitted, problem.options))
    represents = measured is not None and measured.represents_surface
    error = schedule.start_error
    if error < 0:
        # If the faces are large enough for levels coarser than the first one with a search, those reduce the error. Smaller
        # faces match wrong places by chance (ledger: start error), and so do faces too coarse for the surface: where points
        # measure the start, no search is tried (ledger: trial searches where points measure the start).
        is_tried = first == searching and not prepared and measured is None
        error = estimate_start_error(problem, first, problem.start) if is_tried else 0.0
    reach = _edge_reach(measured.error) if measured is not None and represents and is_fitted else RunPlan.edge_reach
    is_estimated = schedule.start_error < 0 and searching is not None and first >= searching
    is_near_truth = is_estimated and schedule.first_level == "auto" and not prepared and error == 0
    return RunPlan(
        first_level=first,
        is_smoothed=is_smoothed,
        is_fitted_to_points=is_fitted,
        start_error=float(error),
        is_near_truth=is_near_truth,
        # A start that has to be searched for is nothing to hold vertices to (ledger: prior to the start).
        start_sigma=max(measured.sigma, LEAST_ERROR) if measured is not None and error == 0 else 0.0,
        edge_reach=reach,
        represents_surface=represents,
        has_second_fit=represents and _is_building(problem, prepared[-1].after if prepared else problem.start),
    )


class _Measured(NamedTuple):
    """What the sparse points show of a start.

    Attributes:
        error: distance of the points from its surface, px. Vertices that the points do not determine keep it after a fit.
        sigma: the part of it that is an error of the vertices, px.
        represents_surface: see `RunPlan`.
    """

    error: float
    sigma: float
    represents_surface: bool


def _measure(problem: Problem, preparations: Preparations, start: np.ndarray, is_fitted: bool) -> _Measured | None:
    """What the sparse points show of a start (n, 3), smoothed if the run smooths it; None if too few belong to its faces."""
    if not points_can_judge(problem):
        return None
    error = measured_start_error(problem, start)
    if error == 0:
        return None
    if not is_fitted and error < SEARCHED_ERROR:
        return _Measured(error, error, True)
    left = measured_start_error(problem, preparations.fit(start))
    if is_fitted:
        # Where points lie far from a mesh fitted to them, it is too coarse for the surface, and its creases need not be edges.
        return _Measured(error, error, left < SEARCHED_ERROR)
    # Distances that a fit leaves are not the vertices' own (ledger: start error of coarse meshes).
    return _Measured(error, max(error**2 - left**2, 0.0) ** 0.5, False)


def _is_building(problem: Problem, vertices: np.ndarray) -> bool:
    """Whether a mesh with these vertices (n, 3) has a Manhattan frame; others gain nothing by a second fit (ledger: second fit)."""
    pixel = pixel_size([view.camera for view in problem.scene.views], vertices)
    return len(relations(vertices, problem.scene.mesh.faces, pixel).pairs) > 0


def _level_by_points(measured: _Measured, is_fitted: bool, options: FairingOptions) -> int:
    """The first level of a start that the points measured.

    Where they show the prepared start near the surface, or the photos reject a fit to them, coarse levels only take vertices
    away from their true positions (ledger: level at which a start near its points begins, level of a measured start whose fit
    the photos reject). A fit leaves most vertices within what a fine level reaches (ledger: level after a fit). Vertices that
    are to be searched for need coarser levels.
    """
    searching = first_searching_level(options)
    if options.schedule.start_error > 0 and searching is not None:
        return searching if is_fitted else level_for_error(measured.error, options)
    return first_fine_level(options) if is_fitted and not measured.represents_surface else options.n_levels - 1


def _edge_reach(measured: float) -> float:
    """How far image edges are sought from creases, px: as far as the start's measured error, px, and the alignment reach.

    (ledger: reach of image edges)
    """
    farthest, _ = STAGES[0]
    return min(max(measured, RunPlan.edge_reach), farthest)

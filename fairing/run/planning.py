"""Planning: computes the run plan of a start mesh, see `RunPlan`."""

from fairing.cells.level_choice import first_level, level_for_error
from fairing.creases.alignment import STAGES
from fairing.options import FairingOptions
from fairing.run.phases import first_searching_level
from fairing.run.preparation import Preparations, points_can_judge
from fairing.run.start_error import SEARCHED_ERROR, estimate_start_error, measured_start_error
from fairing.run_plan import RunPlan
from fairing.solve.problem import Problem
from fairing.trace import StepReason

LEAST_ERROR = 1.0  # px: Gauss-Newton reaches that far at every level
FITTED_ERROR = 2.0  # px: a fit to points near the start leaves less of most vertices (ledger: surface sweep)


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
    measured, off, represents = 0.0, 0.0, False
    if points_can_judge(problem):
        # Vertices that the points do not determine keep the error that the start had before the fit.
        start = prepared[0].after if is_smoothed else problem.start
        measured = off = measured_start_error(problem, start)
        left = measured_start_error(problem, preparations.fit(start))
        # Where points lie far from a mesh fitted to them, it is too coarse for the surface, and its creases need not be edges.
        represents = (left if is_fitted else measured) < SEARCHED_ERROR
        if not (is_fitted or represents):
            # Distances that a fit leaves are not the vertices' own (ledger: start error of coarse meshes).
            off = max(measured**2 - left**2, 0.0) ** 0.5
        if schedule.first_level == "auto":
            first = max(first, _level_by_points(measured, is_fitted, represents, problem.options))
    error = schedule.start_error
    if error < 0:
        # If the faces are large enough for levels coarser than the first one with a search, those reduce the error. Smaller
        # faces match wrong places by chance (ledger: start error).
        error = estimate_start_error(problem, first, problem.start) if first == searching and not prepared else 0.0
    is_estimated = schedule.start_error < 0 and searching is not None and first >= searching
    is_near_truth = is_estimated and schedule.first_level == "auto" and not prepared and error == 0
    return RunPlan(
        first_level=first,
        is_smoothed=is_smoothed,
        is_fitted_to_points=is_fitted,
        start_error=float(error),
        is_near_truth=is_near_truth,
        # A start that has to be searched for is nothing to hold vertices to (ledger: prior to the start).
        start_sigma=max(off, LEAST_ERROR) if measured > 0 and error == 0 else 0.0,
        edge_reach=_edge_reach(measured) if is_fitted and represents else RunPlan.edge_reach,
        represents_surface=represents,
    )


def _level_by_points(measured: float, is_fitted: bool, represents: bool, options: FairingOptions) -> int:
    """The first level of a start whose error was measured, px.

    Where the points show the prepared start near the surface, coarse levels only take vertices away from their true positions
    (ledger: level at which a start near its points begins), unless they are to be searched for.
    """
    if represents and options.schedule.start_error < 0:
        return options.n_levels - 1
    return level_for_error(min(measured, FITTED_ERROR) if is_fitted else measured, options)


def _edge_reach(measured: float) -> float:
    """How far image edges are sought from creases, px: as far as the start's measured error, px, and the alignment reach.

    (ledger: reach of image edges)
    """
    farthest, _ = STAGES[0]
    return min(max(measured, RunPlan.edge_reach), farthest)

"""Planning: computes the run plan of a start mesh, see `RunPlan`."""

from fairing.cells.level_choice import first_level
from fairing.run.phases import first_searching_level
from fairing.run.preparation import find_preparations
from fairing.run.start_error import estimate_start_error, measured_start_error
from fairing.run_plan import RunPlan
from fairing.solve.problem import Problem
from fairing.trace import StepReason

MOST_LOSS = 0.02  # per photo px after a fit: where flat faces explain the photos worse, a search gains little (ledger)


def make_plan(problem: Problem) -> RunPlan:
    """The plan of a run: a function of the scene and the options alone. It reads the photos and may take many seconds.

    Raises:
        InputError: no photo sees any face well enough.
        Cancelled: cancellation was requested.
    """
    schedule, searching = problem.options.schedule, first_searching_level(problem.options)
    first = first_level(problem.scene, problem.start, problem.orientation, problem.options)
    prepared = find_preparations(problem)
    reasons = [preparation.reason for preparation in prepared]
    is_smoothed = StepReason.SMOOTHED in reasons
    error = schedule.start_error
    if error < 0:
        error = 0.0
        fitted = next((k for k, reason in enumerate(reasons) if reason == StepReason.FITTED_TO_POINTS), None)
        if searching is not None and fitted is not None and len(problem.observed_points):
            # Vertices that the points do not determine keep the error that the start had before the fit.
            if prepared[fitted].loss < MOST_LOSS:
                error = measured_start_error(problem, prepared[fitted - 1].after if fitted else problem.start)
        # If the faces are large enough for levels coarser than the first one with a search, those reduce the error. Smaller
        # faces match wrong places by chance (ledger: start error).
        elif first == searching and not is_smoothed:
            error = estimate_start_error(problem, first, prepared[-1].after if prepared else problem.start)
    is_estimated = schedule.start_error < 0 and searching is not None and first >= searching
    is_near_truth = is_estimated and schedule.first_level == "auto" and not prepared and error == 0
    return RunPlan(
        first_level=first,
        is_smoothed=is_smoothed,
        is_fitted_to_points=StepReason.FITTED_TO_POINTS in reasons,
        start_error=float(error),
        is_near_truth=is_near_truth,
    )

"""Rehearsal: smoothing and fit of a start, run ahead of the plan, which depends on whether photos accept them and where they lead.

Its steps are those of the run: they are recorded when the run makes them, and not computed twice.
"""

from dataclasses import dataclass, replace

import numpy as np

from fairing.run.phases import Schedule
from fairing.run.stages import Photos
from fairing.run.stepper import Stepper
from fairing.run.sweep_cache import SweepCache
from fairing.run_plan import RunPlan
from fairing.solve.problem import Problem
from fairing.trace import StepReason, StepRecord, Trace


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """Attributes:
    plan: which of both the photos accept; the rest of it is provisional.
    steps: of what they accept.
    begun_fit: (n, 3) float, world units: vertices before the fit: the start, or the smoothed start.
    fitted: (n, 3) float, world units: where the fit led, whether the photos accept it or not; None without a fit.
    sweeps: of these steps: points found on the way are used again.
    """

    plan: RunPlan
    steps: list[StepRecord]
    begun_fit: np.ndarray
    fitted: np.ndarray | None
    sweeps: SweepCache

    def steps_under(self, schedule: Schedule) -> list[StepRecord]:
        """The steps with their positions in the schedule of the final plan, whose first level may be another one."""
        if not self.steps:
            return []
        level = schedule.levels[schedule.first_level]
        steps = [replace(step, position=step.position._replace(level=level.number)) for step in self.steps]
        ends = [*(step.position for step in steps[1:]), level.begin_of(level.photos)]
        return [replace(step, next_position=end) for step, end in zip(steps, ends, strict=True)]


def rehearse(problem: Problem, plan: RunPlan, smooths: bool, fits: bool) -> Rehearsal:
    """Smooth the start, then fit it to the sparse points; each is kept if the photos accept it.

    Args:
        plan: without both.
        smooths, fits: whether to try.

    Raises:
        Cancelled: cancellation was requested.
    """
    trace, begun, fitted = Trace({}, problem.start, problem.scene.mesh.faces), problem.start, None
    sweeps = SweepCache(problem, trace)
    trials = []
    if smooths:
        trials.append(("is_smoothed", "trying a smoothed start"))
    if fits:
        trials.append(("is_fitted_to_points", "trying a start fitted to the sparse points"))
    for field, doing in trials:
        attempt = trace.cut(len(trace))
        attempt.plan = replace(plan, **{field: True})
        tried = SweepCache(problem, attempt)
        tried.fits.share(sweeps.fits, len(trace))
        with problem.work.doing(doing):
            _run_part(problem, attempt, tried)
        if field == "is_fitted_to_points":
            begun, fitted = (attempt.vertices_at(moment) for moment in (len(trace), len(attempt) - 1))
        if not (attempt.steps[-1].reasons == StepReason.REJECTED_FIT).any():
            plan, trace, sweeps = attempt.plan, attempt, tried
    return Rehearsal(plan, trace.steps, begun, fitted, sweeps)


def _run_part(problem: Problem, trace: Trace, sweeps: SweepCache) -> None:
    """Record the smoothing or fit that comes last before the photos of the first level."""
    level, stepper = sweeps.schedule.levels[sweeps.schedule.first_level], Stepper(problem, trace, sweeps)
    verdict = level.stages[level.stages.index(level.photos) - 1]
    if len(trace):
        trace.continue_at(level.begin_of(level.part_of(verdict)[0]))
    while not isinstance(sweeps.history.stage_of(sweeps.position_at(len(trace))), Photos):
        trace.append(stepper.step_after(len(trace)))

"""Planning: computes the run plan of a start mesh, see `RunPlan`."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from fairing.cells.level_choice import first_fine_level, first_level
from fairing.geometry.normal_filter import smoothed
from fairing.io.points_choice import are_enough
from fairing.options import FINE_BLUR, FairingOptions
from fairing.placement.judge import refuse_elsewhere
from fairing.run.fits import FAR_ERROR, measured_start_error
from fairing.run.own_plan import run_plan_of
from fairing.run.phases import schedule_of
from fairing.run.rehearsal import Rehearsal, rehearse
from fairing.run.stages import PASSES
from fairing.run.sweep_cache import SweepCache
from fairing.run_plan import PlanStage, RunPlan
from fairing.solve.point_split import fitting_points
from fairing.solve.problem import Problem
from fairing.terms.image_edges import SEARCHES
from fairing.terms.point_judge import loss_of_points
from fairing.trace import StepRecord, Trace


class Planned(NamedTuple):
    """Attributes:
    plan: of the run.
    steps: its first ones, which were made to find the plan: smoothing and fit.
    sweeps: of these steps.
    """

    plan: RunPlan
    steps: list[StepRecord]
    sweeps: SweepCache


def make_plan(problem: Problem, own: Sequence[PlanStage] = ()) -> Planned:
    """The plan of a run: a function of the scene and the options alone. It reads the photos and may take many seconds.

    A plan of one's own, `own`, is taken as it is.

    Smoothing is tried where vertices may be noisy. Such a run also uses the smoothness prior at its levels, which determines the
    vertices no photo sees. Where points were found in the photos, they must accept the smoothing as well: a start whose corners
    are displaced can look noisy to blurred photos (ledger: smoothing judged by points). A fit needs as many points as unlocked
    vertices if their photos are known, else as coordinates (`_points_suffice`).

    Raises:
        InputError: no photo sees any face well enough, or the photos of the sparse points do not confirm the mesh; or an
            own plan needs points that there are none of.
        Cancelled: cancellation was requested.
    """
    refuse_elsewhere(problem.scene)
    options = problem.options
    if own:
        trace = Trace({}, problem.start, problem.scene.mesh.faces)
        return Planned(run_plan_of(own, problem), [], SweepCache(problem, trace))
    first = first_level(problem.scene, problem.start, problem.orientation, options)
    plan = RunPlan(first, False, False, has_photos_of_points=len(problem.observed_points) > 0, records_fit=True)
    smooths = any(level.smoothing for level in options.levels)
    smooths = smooths and (not points_can_judge(problem) or points_accept_smoothing(problem))
    rehearsal = rehearse(problem, plan, smooths, fits=options.uses_points and _points_suffice(problem))
    plan = rehearsal.plan
    measured = _measure(problem, rehearsal)
    if measured is not None:
        if options.schedule.first_level == "auto":
            first = max(first, _level_by_points(measured, plan.is_fitted_to_points, options))
        represents, sigma = measured.represents_surface, max(measured.sigma, FINE_BLUR)
        plan = replace(plan, start_sigma=sigma, represents_surface=represents)
        if plan.follows_points:
            plan = replace(plan, edge_reach=_edge_reach(measured.error))
    plan = replace(plan, first_level=first)
    return Planned(plan, rehearsal.steps_under(schedule_of(options, plan)), rehearsal.sweeps)


def points_accept_smoothing(problem: Problem) -> bool:
    """Whether the points lie nearer to the smoothed start than to the start."""
    mesh = problem.scene.mesh
    smooth = problem.moved_to(problem.start, smoothed(mesh, problem.start, PASSES))
    plain_loss, smooth_loss = (
        loss_of_points(mesh.moved(vertices), problem.cameras, problem.observed_points)
        for vertices in (problem.start, smooth)
    )
    return smooth_loss < plain_loss


def points_can_judge(problem: Problem) -> bool:
    """Whether there are enough points whose photos are known: they show which faces the points belong to."""
    return problem.options.uses_points and _points_suffice(problem) and len(problem.observed_points) > 0


def _points_suffice(problem: Problem) -> bool:
    """Whether there are points enough for a fit: fewer would be met with all their noise. (ledger: points for a fit)

    The robust fit, to points whose photos are known, has a prior for what they leave undetermined.
    """
    n_free, n_observed = int((~problem.locked).sum()), len(problem.observed_points)
    if n_observed:
        return n_observed >= n_free
    return are_enough(len(fitting_points(problem.scene)), n_free)


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


def _measure(problem: Problem, rehearsal: Rehearsal) -> _Measured | None:
    """What the sparse points show of the start, smoothed if the run smooths it; None if too few belong to its faces."""
    if not points_can_judge(problem) or rehearsal.fitted is None:
        return None
    is_fitted = rehearsal.plan.is_fitted_to_points
    start = rehearsal.begun_fit
    error = measured_start_error(problem, start)
    if error == 0:
        return None
    if not is_fitted and error < FAR_ERROR:
        return _Measured(error, error, True)
    left = measured_start_error(problem, rehearsal.fitted)
    if is_fitted:
        # Where points lie far from a mesh fitted to them, it is too coarse for the surface, and its creases need not be edges.
        return _Measured(error, error, left < FAR_ERROR)
    # Distances that a fit leaves are not the vertices' own (ledger: start error of coarse meshes).
    return _Measured(error, max(error**2 - left**2, 0.0) ** 0.5, False)


def _level_by_points(measured: _Measured, is_fitted: bool, options: FairingOptions) -> int:
    """The first level of a start that the points measured.

    Where they show the prepared start near the surface, or the photos reject a fit to them, coarse levels only take vertices
    away from their true positions (ledger: level at which a start near its points begins, level of a measured start whose fit
    the photos reject). A fit leaves most vertices within what a fine level reaches (ledger: level after a fit).
    """
    return first_fine_level(options) if is_fitted and not measured.represents_surface else options.n_levels - 1


def _edge_reach(measured: float) -> float:
    """How far image edges are sought from creases, px: as far as the start's measured error, px, and the first search reach.

    (ledger: reach of image edges)
    """
    farthest, _ = SEARCHES[0]
    return min(max(measured, RunPlan.edge_reach), farthest)

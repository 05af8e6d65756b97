"""Levels and phases: what a run does at each level, as a function of its options and its plan."""

from dataclasses import dataclass, replace

import numpy as np

from fairing.cells.level_choice import NEAR_TRUTH_BLUR, first_fine_level
from fairing.options import FairingOptions, by_level
from fairing.run_plan import RunPlan

MAX_DISPLACEMENT = 1.5  # in units of the widest search radius of the run
MAX_DISPLACEMENT_MEASURED = 1.3  # in units of the start's measured error (ledger: bounded displacement)
WEAK_PRIOR = (
    0.01  # factor of `StepOptions.prior` at the sharp level, where the start is not to be held to (ledger: weak prior)
)
INERTIA = 0.05  # factor of `StepOptions.prior` near points, where no vertex has far to go (ledger: inertia)
SWEEPS_AFTER_SEARCH = 2  # factor of the sweeps of the sharp level: no prior to the start holds vertices there
SIGMA_WITH_EDGES = 1.8  # factor of the standard deviation of the start where image edges hold its creases


@dataclass(frozen=True)
class LocalSearch:
    """One sweep in which each vertex tries positions around its own.

    Attributes:
        radius: distance of these positions, px.
        max_displacement: largest distance of a vertex from its origin afterwards, px.
    """

    radius: float
    max_displacement: float
    max_sweeps: int = 1
    max_iterations: int = 1


@dataclass(frozen=True)
class GaussNewton:
    """Sweeps of Gauss-Newton iterations.

    Attributes:
        max_sweeps: largest number of sweeps.
        max_iterations: largest number of iterations of a block within a sweep.
        tolerance: the phase ends after a sweep that moves no vertex by as much as this, px.
        max_displacement: largest distance of a vertex from its origin, px; infinite if nothing tells how far off they are.
    """

    max_sweeps: int
    max_iterations: int
    tolerance: float = 0.0
    max_displacement: float = np.inf


@dataclass(frozen=True)
class Restart:
    """One sweep in which vertices that fit poorly are optimized again from their origin, see `fairing.run.restart`.

    Attributes:
        from_level: level at which they begin.
    """

    from_level: int
    max_sweeps: int = 1
    max_iterations: int = 1


@dataclass(frozen=True)
class SecondFit:
    """One sweep with a step that fits the mesh to the sparse points once more, from where the photos have taken it.

    The run ends with it if the photos reject the fit. (ledger: second fit)
    """

    max_sweeps: int = 1
    max_iterations: int = 1


Phase = LocalSearch | GaussNewton | Restart | SecondFit


@dataclass(frozen=True)
class Level:
    """A level of the schedule.

    Attributes:
        number: its index, from 0.
        prior: strength of the prior in undetermined directions, see `StepOptions.prior`.
        smoothing: strength of the smoothness prior, see `StepOptions.smoothing`; 0: none.
        attraction: strength of the prior to the sparse points, see `StepOptions.points`; 0: none.
        inertia: strength of the prior to where vertices are, relative to the largest eigenvalue of a typical one; 0: none.
        start_sigma: standard deviation of the start in the prior to it, px; 0: no such prior.
        creases: strength of the prior to image edges, see `StepOptions.creases`; 0: none.
        edge_reach: see `RunPlan`.
        phases: in their order.
        after_fit: the level of its sweeps after a `SecondFit`, which come last; None without one.
    """

    number: int
    prior: float
    smoothing: float = 0.0
    attraction: float = 0.0
    inertia: float = 0.0
    start_sigma: float = 0.0
    creases: float = 0.0
    edge_reach: float = RunPlan.edge_reach
    phases: tuple[Phase, ...] = ()
    after_fit: "Level | None" = None

    @property
    def n_sweeps(self) -> int:
        """Largest number of sweeps of all phases."""
        return sum(phase.max_sweeps for phase in self.phases)

    def phase_at(self, sweep: int) -> Phase:
        """The phase of a sweep; the last phase for sweeps beyond the end, which branches of longer runs have."""
        end = 0
        for phase in self.phases:
            end += phase.max_sweeps
            if sweep < end:
                return phase
        return self.phases[-1]

    def at(self, sweep: int) -> "Level":
        """The level whose strengths hold in a sweep."""
        if self.after_fit is None or sweep < self.n_sweeps - self.after_fit.n_sweeps:
            return self
        return self.after_fit

    def end_of_phase(self, sweep: int) -> int:
        """The first sweep after the phase of a sweep."""
        end = 0
        for phase in self.phases:
            end += phase.max_sweeps
            if sweep < end:
                return end
        return sweep + 1

    @property
    def search(self) -> LocalSearch | None:
        """The local search of the level, if it has one."""
        return next((phase for phase in self.phases if isinstance(phase, LocalSearch)), None)

    @property
    def gauss_newton(self) -> GaussNewton:
        """The first Gauss-Newton phase."""
        return next(phase for phase in self.phases if isinstance(phase, GaussNewton))


@dataclass(frozen=True)
class Schedule:
    """All levels of a run.

    Attributes:
        levels: one per blur of the options.
        first_level: position of the first step.
        begin_level: coarser levels are skipped after the preparation steps.
    """

    levels: tuple[Level, ...]
    first_level: int
    begin_level: int


def schedule_of(options: FairingOptions, plan: RunPlan) -> Schedule:
    """The schedule of a run. Pure: it uses neither photos nor mesh."""
    # Near the truth, coarser levels increase the error (ledger: begin level).
    begin = max(first_fine_level(options), plan.first_level) if plan.is_near_truth else plan.first_level
    levels = [_level(options, plan, number, begin) for number in range(options.n_levels)]
    if plan.has_second_fit:
        # A fit that the photos accept is followed as one of the start is; vertices are no longer far from their image edges.
        again = replace(plan, is_fitted_to_points=True, is_near_truth=False, edge_reach=RunPlan.edge_reach)
        after_fit = _level(options, again, options.n_levels - 1, begin)
        levels[-1] = replace(
            levels[-1], phases=(*levels[-1].phases, SecondFit(), *after_fit.phases), after_fit=after_fit
        )
    return Schedule(tuple(levels), plan.first_level, begin)


def first_searching_level(options: FairingOptions) -> int | None:
    """The first level with a local search; None if no level has one."""
    return next((k for k in range(options.n_levels) if by_level(options.schedule.search, k) > 0), None)


def is_sharp(options: FairingOptions, level: int) -> bool:
    """Whether the photos of a face are made equally sharp on it at a level."""
    return by_level(options.cells.point_spread, level) == "common"


def _level(options: FairingOptions, plan: RunPlan, number: int, begin: int) -> Level:
    schedule, step, sharp = options.schedule, options.step, is_sharp(options, number)
    max_displacement = _max_displacement(options, plan)
    radius = max(by_level(schedule.search, number), 0.0) * plan.start_error
    sweeps, creases = by_level(schedule.max_sweeps, number), by_level(step.creases, number)
    is_after_search = sharp and _widest_search(options, plan) > 0
    if plan.is_near_truth:
        sweeps = min(sweeps, by_level(schedule.sweeps_near_truth, number))
    elif is_after_search:
        sweeps *= SWEEPS_AFTER_SEARCH
    gauss_newton = GaussNewton(
        sweeps,
        by_level(schedule.max_iterations, number),
        schedule.sweep_tolerance * schedule.blur[number],
        max_displacement,
    )
    phases: tuple[Phase, ...] = (gauss_newton,)
    if radius > 0:
        phases = (LocalSearch(radius, max_displacement), *phases)
    restart_level = _restart_level(options, number, begin) if is_after_search else None
    if restart_level is not None:  # (ledger: searches and restarts)
        phases = (Restart(restart_level), *phases)
    # The tangential positions of a start that had to be searched for are not reliable; a fit to points changed them already.
    is_weak = is_after_search or (sharp and plan.follows_points)
    attraction = by_level(step.points, number) if plan.is_fitted_to_points else 0.0
    return Level(
        number,
        prior=step.prior * (WEAK_PRIOR if is_weak else 1.0),
        smoothing=by_level(step.smoothing, number) if plan.is_smoothed else 0.0,
        attraction=attraction,
        inertia=INERTIA * step.prior if attraction > 0 else 0.0,
        start_sigma=_start_sigma(plan, schedule.blur[number], creases),
        creases=creases,
        edge_reach=plan.edge_reach,
        phases=phases,
    )


def _max_displacement(options: FairingOptions, plan: RunPlan) -> float:
    """Largest distance of a vertex from its origin, px; infinite if nothing tells how far off they are."""
    return MAX_DISPLACEMENT * _widest_search(options, plan) or MAX_DISPLACEMENT_MEASURED * plan.start_sigma or np.inf


def _widest_search(options: FairingOptions, plan: RunPlan) -> float:
    """Largest radius of the run's local searches, px; 0 without a search."""
    return max(options.schedule.search) * plan.start_error


def _start_sigma(plan: RunPlan, blur: float, creases: float) -> float:
    """Standard deviation of the start in the prior to it at a level, px; 0: no such prior. (ledger: prior to the start)"""
    # At coarse levels the loss is that of the displacement, too.
    if blur > NEAR_TRUTH_BLUR or plan.follows_points:
        return 0.0
    holds_less = creases > 0 and plan.represents_surface
    return plan.start_sigma * (SIGMA_WITH_EDGES if holds_less else 1.0)


def _restart_level(options: FairingOptions, number: int, begin: int) -> int | None:
    """The level at which a restart at level `number` begins: the first one of the run with a search; None: no restart."""
    first = first_searching_level(options)
    if first is None or max(first, begin) >= number:
        return None
    return max(first, begin)

"""What is known of the mesh a run begins with, and what follows for the run."""

from functools import cached_property

import numpy as np

from fairing.cells.level_choice import first_level, last_fine_level
from fairing.options import by_level
from fairing.run.preparation import Preparation, preparations
from fairing.run.schedule import TRIES, LevelPlan
from fairing.run.start_error import probed_error
from fairing.solve.problem import Problem
from fairing.trace import StepReason

REACH = 1.5

# A start whose vertices had to be searched for is no authority on where they slide. Facade, one hundredth of the prior at the
# last level: determined median / rms 0.0649 / 0.333 -> 0.0515 / 0.324 %, though 13 instead of 10 vertices end farther off
# than they began by more than 0.1 % (10 after a second try); on coarser cells from another state 0.053 / 0.305
# with all of it, 0.043 / 0.294 with a tenth, 0.037 / 0.274 with a hundredth, 0.033 / 0.270 with a thousandth.
PRIOR_AFTER_SEARCH = 0.01


class Start:
    """Found out by looking at the photos, when it is asked for the first time.

    Every answer is a function of the scene and the options, so that a resumed run finds the same.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._options = problem.options

    @cached_property
    def first_level(self) -> int:
        """Where the schedule begins: no coarser than the faces allow."""
        return first_level(self._problem.scene, self._problem.start, self._problem.orientation, self._options)

    @cached_property
    def preparations(self) -> tuple[Preparation, ...]:
        """What is done to the mesh before the first level."""
        return preparations(self._problem)

    @property
    def is_noisy(self) -> bool:
        """Whether the run begins smoothed."""
        return self._begins_with(StepReason.SMOOTHED)

    @cached_property
    def error(self) -> float:
        """How far its vertices lie from their places, px: as the options say, or found by trying."""
        if self._options.schedule.start_error >= 0:
            return self._options.schedule.start_error
        # Where the faces are large enough for levels coarser than the searching ones, those bring the vertices near;
        # smaller faces fit somewhere by chance (fountain with 2,500 vertices: an estimate of 6.5 px where 0.4 was true).
        if self.is_noisy or self.first_level != self._first_searching_level:
            return 0.0
        begun = self.preparations[-1].after if self.preparations else self._problem.start
        return probed_error(self._problem, self.first_level, begun)

    @cached_property
    def is_near_truth(self) -> bool:
        """Whether it was left as it is, and the search by trial found it near its truth."""
        schedule, searching = self._options.schedule, self._first_searching_level
        is_probed = (
            schedule.start == "auto"
            and schedule.start_error < 0
            and searching is not None
            and self.first_level >= searching
        )
        return is_probed and not self.preparations and self.error == 0

    @property
    def suitable_level(self) -> int:
        """Where to begin: near the truth, coarser levels would only make it worse.

        (castle from structure from motion, without its points: median distance of these to the surface 0.173 % -> 0.210
        from blur 2.0, 0.182 from 1.2. Drawn to its points first: 0.120 from 1.2, 0.115 from 2.0; fountain 0.0564 and 0.0540,
        photos left out 27.94 and 28.21 dB.)
        """
        return last_fine_level(self._options) if self.is_near_truth else self.first_level

    def search_radius(self, level: int) -> float:
        """How far from each vertex to look for a better place at a level, px; 0: not at all."""
        factor = by_level(self._options.schedule.search, level)
        return factor * self.error if factor > 0 else 0.0

    def plan(self, level: int) -> LevelPlan:
        """The sweeps of a level; few where the start was found near its truth."""
        schedule = self._options.schedule
        sweeps = by_level(schedule.max_sweeps, level)
        if self.is_near_truth:
            sweeps = min(sweeps, by_level(schedule.sweeps_near_truth, level))
        is_searched = self.search_radius(level) > 0
        return LevelPlan(is_searched, sweeps, TRIES if is_searched and self.restart_level(level) is not None else 0)

    def restart_level(self, level: int) -> int | None:
        """The level from which a level tries again what fits badly, the first that searched; None: it does not."""
        first = self._first_searching_level
        if first is None or by_level(self._options.cells.point_spread, level) != "common":
            return None
        begin = max(first, self.suitable_level)
        return begin if begin < level else None

    @property
    def reach(self) -> float:
        """How far from its start a vertex may end, px: a little farther than the widest search; infinite without searches."""
        return REACH * max(self._options.schedule.search) * self.error or np.inf

    def smoothing(self, level: int) -> float:
        """Strength of the pull to smoothness at a level, see `StepOptions.smoothing`; 0: none."""
        return by_level(self._options.step.smoothing, level) if self.is_noisy else 0.0

    def attraction(self, level: int) -> float:
        """Strength of the pull to the sparse points at a level, see `StepOptions.points`; 0: none."""
        if not self._begins_with(StepReason.FITTED_TO_POINTS):
            return 0.0
        return by_level(self._options.step.points, level)

    def prior(self, level: int) -> float:
        """Strength of the pull along what the photos do not determine at a level, see `StepOptions.prior`."""
        is_weak = self.error > 0 and by_level(self._options.cells.point_spread, level) == "common"
        return self._options.step.prior * (PRIOR_AFTER_SEARCH if is_weak else 1.0)

    def _begins_with(self, reason: StepReason) -> bool:
        return any(preparation.reason == reason for preparation in self.preparations)

    @property
    def _first_searching_level(self) -> int | None:
        options = self._options
        return next((k for k in range(options.n_levels) if by_level(options.schedule.search, k) > 0), None)

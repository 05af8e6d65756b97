"""Which iteration, unit, sweep or level comes next, and how much of the schedule is done."""

from collections.abc import Callable
from typing import NamedTuple

from fairing.options import FairingOptions, ScheduleOptions, by_level
from fairing.trace import SchedulePosition

TRIES = 2
"""Second tries after the last sweeps of a level that searches sharp cells. Facade, a whole run, determined and (what three photos
see) rms: 0.293 (0.246) % without, 0.276 (0.224) with one, 0.262 (0.206) with two; median 0.046, 0.036, 0.027. As many sweeps
without them: 0.284 (0.237), median 0.028."""
SWEEPS_AFTER_TRY = 2
_ROUND = 1 + SWEEPS_AFTER_TRY


class LevelPlan(NamedTuple):
    """The sweeps of a level: its search if it has one, Gauss-Newton, and rounds of a second try and Gauss-Newton again.

    Attributes:
        is_searched: whether the first sweep searches.
        sweeps: of Gauss-Newton after it, at most.
        tries: rounds that begin with a second try (`fairing.run.restart`).
    """

    is_searched: bool
    sweeps: int
    tries: int

    @property
    def n_sweeps(self) -> int:
        """At most, of all kinds."""
        return self._first_round + self.tries * _ROUND

    def is_second_try(self, sweep: int) -> bool:
        """Whether a sweep is nothing but a second try."""
        after = sweep - self._first_round
        return after >= 0 and after % _ROUND == 0

    def searches(self, sweep: int) -> bool:
        """Whether a sweep looks for other places; else it is one of Gauss-Newton."""
        return (self.is_searched and sweep == 0) or self.is_second_try(sweep)

    def next_round(self, sweep: int) -> int:
        """The sweep that follows where one of Gauss-Newton hardly moves a vertex any more."""
        after = sweep - self._first_round
        return self._first_round + max(0, after // _ROUND + 1) * _ROUND

    @property
    def _first_round(self) -> int:
        return int(self.is_searched) + self.sweeps


def next_position(
    schedule: ScheduleOptions,
    plan: LevelPlan,
    position: SchedulePosition,
    unit_is_done: bool,
    n_blocks: int,
    longest_move: Callable[[], float],
) -> SchedulePosition:
    """Where the run goes on after a step.

    Args:
        plan: of the level.
        position: of that step.
        unit_is_done: no vertex of its unit has farther to go.
        n_blocks: of the sweep.
        longest_move: asked at the end of a sweep: how far it has moved any vertex in a photo, px.
    """
    level = position.level
    if not unit_is_done and position.iteration + 1 < by_level(schedule.max_iterations, level):
        return position._replace(iteration=position.iteration + 1)
    if position.unit + 1 < n_blocks:
        return SchedulePosition(level, position.sweep, position.unit + 1, 0)
    is_moving = plan.searches(position.sweep) or longest_move() >= schedule.sweep_tolerance * schedule.blur[level]
    following = position.sweep + 1 if is_moving else plan.next_round(position.sweep)
    return (
        SchedulePosition(level, following, 0, 0) if following < plan.n_sweeps else SchedulePosition(level + 1, 0, 0, 0)
    )


def fraction_done(
    options: FairingOptions,
    plan_of: Callable[[int], LevelPlan],
    position: SchedulePosition,
    first_level: int,
    n_blocks: int,
) -> float:
    """Fraction of the schedule worked off, by the longest it can last, 0 to 1.

    Args:
        plan_of: the plan of a level; asked only within one, as it takes a while to find out before the first step.
        position: where the run goes on.
        first_level: where it began.
        n_blocks: of a sweep.
    """
    if position.level >= options.n_levels:
        return 1.0
    within = 0.0
    if position[1:] != (0, 0, 0):
        of_unit = position.iteration / by_level(options.schedule.max_iterations, position.level)
        of_sweep = min(1.0, (position.unit + of_unit) / n_blocks)
        within = min(1.0, (position.sweep + of_sweep) / plan_of(position.level).n_sweeps)
    return (position.level - first_level + within) / (options.n_levels - first_level)

"""Which iteration, unit, sweep or level comes next, and how much of the schedule is done."""

from collections.abc import Callable

from fairing.options import FairingOptions, ScheduleOptions, by_level
from fairing.trace import Position


def next_position(
    schedule: ScheduleOptions,
    position: Position,
    unit_is_done: bool,
    n_units: int,
    is_search: bool,
    max_sweeps: int,
    longest_move: Callable[[], float],
) -> Position:
    """Where the run goes on after a step.

    Args:
        position: of that step.
        unit_is_done: no vertex of its unit has farther to go.
        n_units: of the sweep.
        is_search: whether the sweep searched; it is followed by those of Gauss-Newton.
        max_sweeps: see `max_sweeps`.
        longest_move: asked at the end of a sweep: how far it has moved any vertex in a photo, px.
    """
    level = position.level
    if not unit_is_done and position.iteration + 1 < by_level(schedule.max_iterations, level):
        return position._replace(iteration=position.iteration + 1)
    if position.unit + 1 < n_units:
        return Position(level, position.sweep, position.unit + 1, 0)
    if is_search:
        return Position(level, 1, 0, 0)
    is_moving = longest_move() >= schedule.sweep_tolerance * schedule.blur[level]
    if is_moving and position.sweep + 1 < max_sweeps:
        return Position(level, position.sweep + 1, 0, 0)
    return Position(level + 1, 0, 0, 0)


def max_sweeps(schedule: ScheduleOptions, level: int, is_near_truth: bool, is_searched: bool) -> int:
    """How many sweeps a level lasts at most, its search included.

    Args:
        is_near_truth: whether the start was found near its truth.
        is_searched: whether the level's first sweep searches.
    """
    sweeps = by_level(schedule.max_sweeps, level)
    if is_near_truth:
        sweeps = min(sweeps, by_level(schedule.sweeps_near_truth, level))
    return sweeps + int(is_searched)


def fraction_done(options: FairingOptions, position: Position, first_level: int, n_units: int) -> float:
    """Fraction of the schedule worked off, by the longest it can last, 0 to 1.

    Args:
        position: where the run goes on.
        first_level: where it began.
        n_units: of a sweep.
    """
    if position.level >= options.n_levels:
        return 1.0
    sweeps = by_level(options.schedule.max_sweeps, position.level)
    of_unit = position.iteration / by_level(options.schedule.max_iterations, position.level)
    within = (position.sweep + min(1.0, (position.unit + of_unit) / n_units)) / sweeps
    return (position.level - first_level + min(1.0, within)) / (options.n_levels - first_level)

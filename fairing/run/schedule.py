"""Schedule positions: the position after a step, and the fraction of the schedule that is done."""

from collections.abc import Callable

from fairing.run.phases import GaussNewton, Level, LocalSearch, Phase, Schedule
from fairing.trace import SchedulePosition


def next_position(
    level: Level,
    position: SchedulePosition,
    block_is_done: bool,
    n_blocks: int,
    longest_move: Callable[[], float],
) -> SchedulePosition:
    """The position after a step.

    Args:
        level: the level of the step.
        position: of the step.
        block_is_done: whether every vertex of its block has converged or is at rest.
        n_blocks: number of blocks of the sweep.
        longest_move: called at the end of a Gauss-Newton sweep: the longest move of a vertex in it, px.
    """
    phase = level.phase_at(position.sweep)
    if not block_is_done and position.iteration + 1 < phase.max_iterations:
        return position._replace(iteration=position.iteration + 1)
    if position.block + 1 < n_blocks:
        return position._replace(block=position.block + 1, iteration=0)
    has_converged = isinstance(phase, GaussNewton) and longest_move() < phase.tolerance
    following = level.end_of_phase(position.sweep) if has_converged else position.sweep + 1
    if following < level.n_sweeps:
        return SchedulePosition(level.number, following, 0, 0)
    return SchedulePosition(level.number + 1, 0, 0, 0)


def fraction_done(schedule: Schedule, position: SchedulePosition, most_blocks: Callable[[Phase], int]) -> float:
    """Fraction of the schedule before a position, 0 to 1, by the longest it can take.

    Args:
        position: of the next step.
        most_blocks: upper bound of the number of blocks in a sweep of a phase.
    """
    n_levels = len(schedule.levels)
    if position.level >= n_levels:
        return 1.0
    level = schedule.levels[position.level]
    phase = level.phase_at(position.sweep)
    of_block = position.iteration / phase.max_iterations
    of_sweep = min(1.0, (position.block + of_block) / max(1, most_blocks(phase)))
    within = min(1.0, (position.sweep + of_sweep) / level.n_sweeps)
    return max(0.0, (position.level - schedule.first_level + within) / (n_levels - schedule.first_level))


def most_blocks(phase: Phase, order: str, n_free: int, max_degree: int) -> int:
    """Upper bound of the number of blocks in a sweep of a phase.

    Args:
        order: see `ScheduleOptions.order`.
        n_free: number of vertices that are not locked.
        max_degree: largest number of neighbours of a vertex; a greedy coloring needs at most one colour more.
    """
    independent = min(n_free, max_degree + 1)
    if isinstance(phase, LocalSearch):
        return independent
    if not isinstance(phase, GaussNewton) or order == "joint":
        return 1
    return independent if order == "independent" else n_free

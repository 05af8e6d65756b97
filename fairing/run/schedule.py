"""Schedule positions: the position after a step of the photos, and the fraction of the schedule that is done."""

from collections.abc import Callable

from fairing.run.phases import Level, Schedule
from fairing.run.stages import Photos, Stage
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
        longest_move: called at the end of a sweep of photos: the longest move of a vertex in it, px.
    """
    stage = level.stage_at(position.sweep)
    if not block_is_done and position.iteration + 1 < stage.max_iterations:
        return position._replace(iteration=position.iteration + 1)
    if position.block + 1 < n_blocks:
        return position._replace(block=position.block + 1, iteration=0)
    has_converged = isinstance(stage, Photos) and longest_move() < stage.tolerance
    if stage.has(position.sweep + 1) and not has_converged:
        return SchedulePosition(level.number, position.sweep + 1, 0, 0)
    return level.begin_of(level.after(stage))


def fraction_done(schedule: Schedule, position: SchedulePosition, most_blocks: Callable[[Stage], int]) -> float:
    """Fraction of the schedule before a position, 0 to 1, by the longest it can take; fits count for nothing, they are fast.

    Args:
        position: of the next step.
        most_blocks: upper bound of the number of blocks in a sweep of a stage.
    """
    n_levels = len(schedule.levels)
    if position.level >= n_levels:
        return 1.0
    level = schedule.levels[position.level]
    stage = level.stage_at(position.sweep)
    within = 0.0 if level.place_of(stage) < level.place_of(level.photos) else 1.0
    if isinstance(stage, Photos):
        of_block = position.iteration / stage.max_iterations
        of_sweep = min(1.0, (position.block + of_block) / max(1, most_blocks(stage)))
        within = min(1.0, (position.sweep + of_sweep) / stage.max_sweeps)
    return max(0.0, (position.level - schedule.first_level + within) / (n_levels - schedule.first_level))


def most_blocks(order: str, n_free: int, max_degree: int) -> int:
    """Upper bound of the number of blocks in a sweep of photos.

    Args:
        order: see `ScheduleOptions.order`.
        n_free: number of vertices that are not locked.
        max_degree: largest number of neighbours of a vertex; a greedy coloring needs at most one colour more.
    """
    if order == "joint":
        return 1
    return min(n_free, max_degree + 1) if order == "independent" else n_free

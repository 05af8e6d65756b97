"""Levels: what a run does at each of them, as a function of its options and its plan; positions, and the part that is done."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from fairing.options import FINE_BLUR, FairingOptions
from fairing.run.own_plan import by_level, stages_of_level
from fairing.run.stages import Judge, Photos, Smoothing, Stage, fit_stages, numbered
from fairing.run_plan import RunPlan
from fairing.trace import SchedulePosition

MOST_SWEEPS = 50  # of photos at a level, for the numbers of the sweeps after them


@dataclass(frozen=True)
class Level:
    """A level of the schedule.

    Attributes:
        number: its index, from 0.
        smoothing: strength of the smoothness prior, see `LevelOptions.smoothing`; 0: none.
        attraction: strength of the sparse points, see `LevelOptions.points`; 0: none.
        start_sigma: standard deviation of the start in the prior to it, px; 0: no points tell it.
        prior: strength of the prior to the start, see `StepOptions.prior`; 1 where points measured it.
        creases: strength of image edges and axes, see `LevelOptions.creases`; 0: none.
        edge_reach: see `RunPlan`.
        stages: in the order in which they run.
        next_sweep: number of the first sweep of the next level.
    """

    number: int
    smoothing: float = 0.0
    attraction: float = 0.0
    start_sigma: float = 0.0
    prior: float = 0.0
    creases: float = 0.0
    edge_reach: float = RunPlan.edge_reach
    stages: tuple[Stage, ...] = ()
    next_sweep: int = 0

    @property
    def begin(self) -> SchedulePosition:
        """Position of its first step."""
        return self.begin_of(self.stages[0])

    def begin_of(self, stage: Stage | None) -> SchedulePosition:
        """Position of the first step of a stage; of the next level for None."""
        if stage is None:
            return SchedulePosition(self.number + 1, self.next_sweep, 0, 0)
        return SchedulePosition(self.number, stage.first_sweep, 0, 0)

    def stage_at(self, sweep: int) -> Stage:
        """The stage of a sweep; the photos for sweeps that no stage has, as in branches of longer runs."""
        return next((stage for stage in self.stages if stage.has(sweep)), self.photos)

    def after(self, stage: Stage) -> Stage | None:
        """The stage that follows another one; None after the last."""
        following = self.stages[self.place_of(stage) + 1 :]
        return following[0] if following else None

    def position_after(
        self, position: SchedulePosition, block_is_done: bool, n_blocks: int, longest_move: Callable[[], float]
    ) -> SchedulePosition:
        """The position after a step of the photos.

        Args:
            position: of the step.
            block_is_done: whether every vertex of its block has converged or is at rest.
            n_blocks: number of blocks of the sweep.
            longest_move: called at the end of a sweep: the longest move of a vertex in it, px.
        """
        stage = self.stage_at(position.sweep)
        if not block_is_done and position.iteration + 1 < stage.max_iterations:
            return position._replace(iteration=position.iteration + 1)
        if position.block + 1 < n_blocks:
            return position._replace(block=position.block + 1, iteration=0)
        has_converged = isinstance(stage, Photos) and longest_move() < stage.tolerance
        if stage.has(position.sweep + 1) and not has_converged:
            return SchedulePosition(self.number, position.sweep + 1, 0, 0)
        return self.begin_of(self.after(stage))

    def place_of(self, stage: Stage) -> int:
        """The place of a stage among all; after the last for photos of a level that has none."""
        return self.stages.index(stage) if stage in self.stages else len(self.stages)

    def part_of(self, stage: Stage) -> tuple[Stage, ...]:
        """The smoothing or fit that a stage belongs to, with the judge that ends it; empty for photos and the judge of the end.

        The last one of a plan of one's own may have no judge.
        """
        part: list[Stage] = []
        for each in self.stages[: self.place_of(self.photos)]:
            part.append(each)
            if isinstance(each, Judge) and each.by == "photos":
                if stage in part:
                    return tuple(part)
                part = []
        return tuple(part) if stage in part else ()

    @property
    def photos(self) -> Photos:
        """Its stage of photos; a single iteration that is not executed in a level without."""
        return next((stage for stage in self.stages if isinstance(stage, Photos)), Photos())


@dataclass(frozen=True)
class Schedule:
    """All levels of a run.

    Attributes:
        levels: one per blur of the options.
        first_level: level of the first step.
        records_fit: see `RunPlan`.
    """

    levels: tuple[Level, ...]
    first_level: int
    records_fit: bool = True

    def order_of(self, position: SchedulePosition) -> tuple[int, ...]:
        """Sorts positions by when they are executed; numbers of sweeps do not, since smoothing and fits have the last ones."""
        if not 0 <= position.level < len(self.levels):
            return (position.level, 0, *position[1:])
        level = self.levels[position.level]
        return (position.level, level.place_of(level.stage_at(position.sweep)), *position[1:])

    def fraction_done(self, position: SchedulePosition, most_blocks: int) -> float:
        """Fraction of the schedule before a position, 0 to 1, by the longest it can take; fits count for nothing, they are fast.

        Args:
            position: of the next step.
            most_blocks: upper bound of the number of blocks in a sweep of photos.
        """
        n_levels = len(self.levels)
        if position.level >= n_levels:
            return 1.0
        level = self.levels[position.level]
        stage = level.stage_at(position.sweep)
        within = 0.0 if level.place_of(stage) < level.place_of(level.photos) else 1.0
        if isinstance(stage, Photos):
            of_block = position.iteration / stage.max_iterations
            of_sweep = min(1.0, (position.block + of_block) / max(1, most_blocks))
            within = min(1.0, (position.sweep + of_sweep) / stage.max_sweeps)
        return max(0.0, (position.level - self.first_level + within) / (n_levels - self.first_level))


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


def schedule_of(options: FairingOptions, plan: RunPlan) -> Schedule:
    """The schedule of a run. Pure: it uses neither photos nor mesh."""
    levels: list[Level] = []
    for number in reversed(range(options.n_levels)):
        next_sweep = levels[-1].begin.sweep if levels else 0
        levels.append(replace(_level(options, plan, number), next_sweep=next_sweep))
    return Schedule(tuple(reversed(levels)), plan.first_level, plan.records_fit)


def _level(options: FairingOptions, plan: RunPlan, number: int) -> Level:
    at = options.levels[number]
    # What points measured of the start holds neither at coarse levels, whose loss is that of the displacement, too, nor after a fit
    # to points. A start that points measured or that was fitted to them is there as far off as a fine level reaches, within which
    # points bring it. (ledger: prior to the start)
    is_measured = plan.start_sigma > 0 and at.blur <= FINE_BLUR and not plan.follows_points
    has_points = plan.start_sigma > 0 or plan.is_fitted_to_points
    return Level(
        number,
        smoothing=at.smoothing if plan.is_smoothed else 0.0,
        attraction=at.points if plan.is_fitted_to_points else 0.0,
        start_sigma=plan.start_sigma if is_measured else FINE_BLUR if has_points else 0.0,
        prior=1.0 if is_measured else options.step.prior,
        creases=at.creases,
        edge_reach=plan.edge_reach,
        stages=_stages(options, plan, number),
    )


def _stages(options: FairingOptions, plan: RunPlan, number: int) -> tuple[Stage, ...]:
    """The stages of a level. Numbers of sweeps are the same for every plan and level, and for other options unless these allow
    more than `MOST_SWEEPS`, so that branches keep theirs: photos have the first ones, whatever runs before them."""
    schedule, at = options.schedule, options.levels[number]
    photos = Photos(
        max_sweeps=at.max_sweeps,
        max_iterations=at.max_iterations,
        tolerance=schedule.sweep_tolerance * at.blur,
    )
    first_after = max(MOST_SWEEPS, *(each.max_sweeps for each in options.levels))
    if plan.stages:
        parts = by_level(plan.stages)
        own = stages_of_level(parts[number], photos) if number < len(parts) else (photos,)
        numbers = iter(numbered(tuple(stage for stage in own if stage is not photos), first_after))
        return tuple(stage if stage is photos else next(numbers) for stage in own)
    end = Judge(by="end", first_sweep=first_after)
    smoothing = numbered((Smoothing(), Judge()), first_after + 1)
    fit = numbered(fit_stages(plan.has_photos_of_points), smoothing[-1].first_sweep + 1)
    is_first, is_last = plan.records_fit and number == plan.first_level, number == options.n_levels - 1
    return (
        *(smoothing if is_first and plan.is_smoothed else ()),
        *(fit if is_first and plan.is_fitted_to_points else ()),
        photos,
        *((end,) if is_last else ()),
    )

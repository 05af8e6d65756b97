"""What a changed plan of one's own keeps of a run: the steps before the first stage that is another one."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from fairing.cells.level_choice import first_fine_level
from fairing.options import FairingOptions
from fairing.run.own_plan import run_plan_of
from fairing.run.phases import Level, Schedule, schedule_of
from fairing.run.stages import Judge, Photos, Stage
from fairing.run_plan import PlanStage
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepRecord


class Kept(NamedTuple):
    """Attributes:
    moment: up to which the steps are the same under both plans.
    position: at which the run continues there; None: as recorded.
    """

    moment: int
    position: SchedulePosition | None


class _Part(NamedTuple):
    """A stage in its level, with all that its steps depend on beside the vertices."""

    level: Level
    stage: Stage
    depends_on: tuple[Any, ...]


def kept_under(
    plan: Sequence[PlanStage],
    options: FairingOptions,
    former: Sequence[PlanStage],
    steps: Sequence[StepRecord],
    problem: Problem,
) -> Kept:
    """What a run keeps of its steps if its plan becomes another one.

    Args:
        plan: the other one.
        options: with its levels, see `options_of_plan`.
        former: the plan of the run; empty: none of one's own, then nothing is kept.
        steps: of the run, up to the present moment.
        problem: of the run.

    Raises:
        InputError: a stage needs sparse points that the scene does not have.
    """
    wanted = schedule_of(options, run_plan_of(plan, problem))
    if not former:
        return Kept(0, None)
    present = schedule_of(problem.options, run_plan_of(former, problem))
    before, after = _parts(present, problem.options), _parts(wanted, options)
    same = 0
    while same < min(len(before), len(after)) and before[same].depends_on == after[same].depends_on:
        same += 1
    changed = len(present.levels), 0
    if same < len(before):
        changed = present.order_of(before[same].level.begin_of(before[same].stage))[:2]

    def is_changed(position: SchedulePosition) -> bool:
        return present.order_of(position)[:2] >= changed

    kept = next((k for k, step in enumerate(steps) if is_changed(step.position)), len(steps))
    if kept == 0 or not is_changed(steps[kept - 1].next_position):
        return Kept(kept, None)
    if same < len(after):
        return Kept(kept, after[same].level.begin_of(after[same].stage))
    return Kept(kept, wanted.levels[-1].begin_of(None))


def _parts(schedule: Schedule, options: FairingOptions) -> list[_Part]:
    parts = []
    for level in schedule.levels:
        priors = (level.smoothing, level.attraction, level.start_sigma, level.prior, level.creases, level.edge_reach)
        for stage in level.stages:
            depends_on: tuple[Any, ...] = (level.number, stage)
            if isinstance(stage, Photos):
                depends_on += (options.levels[level.number], priors)
            elif isinstance(stage, Judge) and stage.by != "points":
                judging = options.levels[level.number if stage.by == "end" else first_fine_level(options)]
                depends_on += (replace(judging, max_sweeps=1, max_iterations=1),)
            parts.append(_Part(level, stage, depends_on))
    return parts

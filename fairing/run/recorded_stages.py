"""Stages of a recorded run: consecutive steps of one kind, which timelines, reports and commands show as one."""

from collections.abc import Callable
from itertools import groupby
from typing import NamedTuple

from fairing.options import options_from_dict
from fairing.run.own_plan import recorded_plan
from fairing.run.phases import schedule_of
from fairing.run_plan import RunPlan
from fairing.stage_kind import StageKind
from fairing.trace import SchedulePosition, Trace


class RecordedStage(NamedTuple):
    """Attributes:
    kind: of all its steps.
    level: of the schedule; photos have a stage for each level.
    begin, end: moments before its first step and after its last one so far.
    """

    kind: StageKind
    level: int
    begin: int
    end: int


def recorded_stages(trace: Trace) -> list[RecordedStage]:
    """The stages of a trace, in their order; together they hold every step."""
    key_of = stage_keys(trace)
    stages, end = [], 0
    for (kind, level, _), steps in groupby(trace.steps[:], key=lambda step: key_of(step.stage, step.position)):
        begin, end = end, end + sum(1 for _ in steps)
        stages.append(RecordedStage(kind, level, begin, end))
    return stages


def stage_keys(trace: Trace) -> Callable[[StageKind, SchedulePosition], tuple[StageKind, int, int]]:
    """What the steps of one stage have in common, and no others next to them, as a function of a step's kind and position.

    Kind and level, and in a plan of one's own, where stages of one kind may follow each other, the place within the level. Pages
    ask for it at every update: it is found once and stays with the trace.
    """
    if trace.stage_key is None:
        trace.stage_key = _stage_key(trace)
    return trace.stage_key


def _stage_key(trace: Trace) -> Callable[[StageKind, SchedulePosition], tuple[StageKind, int, int]]:
    stages = recorded_plan(trace)
    if not stages:
        return lambda kind, position: (kind, position.level, 0)
    plan = RunPlan(0, is_smoothed=False, is_fitted_to_points=False, stages=stages)
    schedule = schedule_of(options_from_dict(trace.header["options"]), plan)

    def key_of(kind: StageKind, position: SchedulePosition) -> tuple[StageKind, int, int]:
        level, place, *_ = schedule.order_of(position)
        return kind, level, place

    return key_of

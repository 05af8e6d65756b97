"""Stages of a recorded run: consecutive steps of one kind, which timelines, reports and commands show as one."""

from itertools import groupby
from typing import NamedTuple

from fairing.stage_kind import StageKind
from fairing.trace import Trace


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
    stages, end = [], 0
    for (kind, level), steps in groupby(trace.steps[:], key=lambda step: (step.stage, step.position.level)):
        begin, end = end, end + sum(1 for _ in steps)
        stages.append(RecordedStage(kind, level, begin, end))
    return stages

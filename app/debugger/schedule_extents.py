"""Extents of the schedule: the recorded moments at which an iteration, block, sweep, stage or level began."""

from app.debugger.commands import Extent
from fairing.run.session import Session
from fairing.stage_kind import StageKind
from fairing.trace import SchedulePosition, StepRecord

Group = tuple[int | None, ...]


def group_of(stage: StageKind | None, position: SchedulePosition, extent: Extent) -> Group:
    """What the steps of one iteration, block, sweep, stage or level have in common, and no others next to them."""
    return (stage, position.level) if extent is Extent.STAGE else position[:extent]


def group_of_step(step: StepRecord, extent: Extent) -> Group:
    """The group of a recorded step."""
    return group_of(step.stage, step.position, extent)


def group_of_next_step(session: Session, extent: Extent) -> Group:
    """The group of the next step of a session."""
    return group_of(session.next_stage, session.position, extent)


def beginning_of(steps: list[StepRecord], moment: int, group: Group, extent: Extent) -> int:
    """The moment at which the block, sweep, stage or level of the step after `moment`, which is of `group`, began."""
    while moment > 0 and group_of_step(steps[moment - 1], extent) == group:
        moment -= 1
    return moment


def boundary_before(steps: list[StepRecord], moment: int, extent: Extent) -> int:
    """The moment at which the iteration, block, sweep, stage or level of the step before `moment` began."""
    if moment <= 0:
        return 0
    if extent is Extent.ITERATION:
        return moment - 1
    return beginning_of(steps, moment - 1, group_of_step(steps[moment - 1], extent), extent)

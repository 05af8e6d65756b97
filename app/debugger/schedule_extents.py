"""Extents of the schedule: the recorded moments at which an iteration, block, sweep or level began."""

from app.debugger.commands import Extent
from fairing.trace import SchedulePosition, StepRecord


def beginning_of(steps: list[StepRecord], moment: int, position: SchedulePosition, extent: Extent) -> int:
    """The moment at which the block, sweep or level of `position`, where the step after `moment` belongs, began."""
    while moment > 0 and steps[moment - 1].position[:extent] == position[:extent]:
        moment -= 1
    return moment


def boundary_before(steps: list[StepRecord], moment: int, extent: Extent) -> int:
    """The moment at which the iteration, block, sweep or level of the step before `moment` began."""
    if moment <= 0:
        return 0
    group = steps[moment - 1].position[:extent]
    began = moment - 1
    while extent is not Extent.ITERATION and began > 0 and steps[began - 1].position[:extent] == group:
        began -= 1
    return began

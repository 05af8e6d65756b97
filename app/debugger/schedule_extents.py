"""Extents of the schedule: the recorded moments at which an iteration, block, sweep, stage or level began."""

from app.debugger.commands import Extent
from fairing.run.recorded_stages import stage_keys
from fairing.run.session import Session
from fairing.stage_kind import StageKind
from fairing.trace import SchedulePosition, Trace

Group = tuple[int | None, ...]


class Extents:
    """What the steps of one iteration, block, sweep, stage or level of a run have in common, and no others next to them."""

    def __init__(self, trace: Trace, extent: Extent) -> None:
        self._trace, self._extent, self._key_of = trace, extent, stage_keys(trace)

    def group_of_step(self, step: int) -> Group:
        """The group of a recorded step, by its index."""
        record = self._trace.steps[step]
        return self._group(record.stage, record.position)

    def group_of_next_step(self, session: Session) -> Group:
        """The group of the next step of a session."""
        return self._group(session.next_stage, session.position)

    def beginning_of(self, moment: int, group: Group) -> int:
        """The moment at which the block, sweep, stage or level of the step after `moment`, which is of `group`, began."""
        while moment > 0 and self.group_of_step(moment - 1) == group:
            moment -= 1
        return moment

    def boundary_before(self, moment: int) -> int:
        """The moment at which the iteration, block, sweep, stage or level of the step before `moment` began."""
        if moment <= 0:
            return 0
        if self._extent is Extent.ITERATION:
            return moment - 1
        return self.beginning_of(moment - 1, self.group_of_step(moment - 1))

    def _group(self, stage: StageKind | None, position: SchedulePosition) -> Group:
        if self._extent is not Extent.STAGE:
            return position[: self._extent]
        return (None,) if stage is None else self._key_of(stage, position)

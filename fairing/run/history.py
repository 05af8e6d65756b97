"""History: where the parts of a recorded run began, as functions of its trace and its schedule."""

import numpy as np

from fairing.run.phases import Level, Schedule
from fairing.run.stages import Judge, PointGates, Stage
from fairing.stage_kind import StageKind
from fairing.trace import SchedulePosition, StepReason, StepRecord, Trace


class History:
    """Moments of a recorded run.

    Args:
        trace: of the run.
        schedule: of its plan.
    """

    def __init__(self, trace: Trace, schedule: Schedule) -> None:
        self._trace, self._schedule = trace, schedule

    def level_of(self, position: SchedulePosition) -> Level:
        """The level of a position; the last one for positions of finished runs."""
        return self._schedule.levels[min(position.level, len(self._schedule.levels) - 1)]

    def stage_of(self, position: SchedulePosition) -> Stage:
        """The stage of a position."""
        return self.level_of(position).stage_at(position.sweep)

    def stage_begun(self, moment: int, position: SchedulePosition) -> int:
        """The moment at which the stage of the step after a moment began, `position` being that step's."""
        return self._begun(moment, position.level, (self.stage_of(position),))

    def part_begun(self, moment: int, position: SchedulePosition) -> int:
        """The moment at which the smoothing or fit of the step after a moment began, `position` being that step's."""
        level = self.level_of(position)
        return self._begun(moment, position.level, level.part_of(level.stage_at(position.sweep)))

    def surface_begun(self, moment: int, begin: int) -> dict[int, int]:
        """When the searches for points near the mesh began in the fit from moment `begin` to `moment`, by their number."""
        found: dict[int, int] = {}
        for k in range(begin, moment):
            record = self._trace.steps[k]
            if record.stage is StageKind.SURFACE_POINTS:
                stage = self.stage_of(record.position)
                if isinstance(stage, PointGates) and stage.surface is not None:
                    found.setdefault(stage.surface, k)
        return found

    def fit_before(self, moment: int) -> tuple[int, int] | None:
        """The moments before and after the fit that the run keeps before a moment; None without one."""
        for end in range(moment, 0, -1):
            record = self._trace.steps[end - 1]
            if self._is_kept(record):
                begin = self.part_begun(end - 1, record.position)
                if self._trace.steps[begin].stage is not StageKind.SMOOTHNESS:
                    return begin, end
        return None

    def origin_at(self, moment: int) -> np.ndarray:
        """(n, 3) float, world units: where the photos began to move each vertex: at the prepared start, or after its last manual
        edit."""
        trace = self._trace
        origin = trace.vertices_at(self._prepared(moment))
        for made in trace.manual_moments:
            if made <= moment:
                record = trace.steps[made - 1]
                origin[record.vertices] = record.after
        return origin

    def judged_from(self, moment: int) -> int:
        """The moment with which the judge of the end compares: after the last manual edit, or the start."""
        return max((made for made in self._trace.manual_moments if made <= moment), default=0)

    def _prepared(self, moment: int) -> int:
        """The last moment up to `moment` at which smoothing or a fit ended that the run keeps."""
        for end in range(moment, 0, -1):
            record = self._trace.steps[end - 1]
            if record.stage is StageKind.FIT and record.accepted:  # of a former version, in one step
                return end
            if record.stage is StageKind.SMOOTHNESS and not self._schedule.records_fit:
                return end
            if self._is_kept(record):
                return end
        return 0

    def _is_kept(self, record: StepRecord) -> bool:
        """Whether a step ends smoothing or a fit that the run keeps: by the verdict of the photos, or without any judge."""
        if record.stage is StageKind.PHOTOS:
            return False
        level, at, following = self.level_of(record.position), record.position, record.next_position
        part = level.part_of(level.stage_at(at.sweep))
        if part and not (isinstance(part[-1], Judge) and part[-1].by == "photos"):
            return following.level != at.level or not any(stage.has(following.sweep) for stage in part)
        if record.stage is not StageKind.JUDGE or (record.reasons == StepReason.REJECTED_FIT).any():
            return False
        stage = self.stage_of(record.position)
        return isinstance(stage, Judge) and stage.by == "photos"

    def _begun(self, moment: int, level: int, stages: tuple[Stage, ...]) -> int:
        """The moment from which all steps up to `moment` belong to one of some stages of a level."""
        while moment > 0:
            record = self._trace.steps[moment - 1]
            at = record.position
            if record.is_manual or at.level != level or not any(stage.has(at.sweep) for stage in stages):
                break
            moment -= 1
        return moment

"""Sweep cache: the sweep states of a recorded run at its moments."""

from collections.abc import Sequence
from dataclasses import replace

from fairing.cells.scale_space import KEPT_BYTES
from fairing.run.fits import Fits
from fairing.run.history import History
from fairing.run.phases import Schedule, schedule_of
from fairing.run.stages import Photos
from fairing.run.sweep import SweepState, begin_sweep
from fairing.run_plan import RunPlan
from fairing.solve.problem import Problem
from fairing.stage_kind import StageKind
from fairing.terms.own import OwnTerm
from fairing.trace import SchedulePosition, Trace


class SweepCache:
    """Positions in the schedule and sweep states, by moment. States need the plan of the trace; positions do not.

    Up to four states are kept, so that stepping back and forth does not compute visibility again, and fewer where their photos
    take more than an eighth of `KEPT_BYTES`. (ledger: sweeps kept in memory)

    Args:
        own_terms: of the objective in sweeps of photos, beside the built-in ones.
    """

    def __init__(self, problem: Problem, trace: Trace, own_terms: Sequence[OwnTerm] = ()) -> None:
        self._problem, self._trace, self._own_terms = problem, trace, own_terms
        self._sweeps: list[SweepState] = []  # the most recently used is the last
        self._scheduled: tuple[RunPlan, Schedule] | None = None
        self.fits = Fits(problem, trace)

    @property
    def schedule(self) -> Schedule:
        """The schedule of the planned run."""
        plan = self._trace.plan
        assert plan is not None, "plan the run first"
        if self._scheduled is None or self._scheduled[0] is not plan:
            self._scheduled = plan, schedule_of(self._problem.options, plan)
        return self._scheduled[1]

    @property
    def history(self) -> History:
        """Of the planned run."""
        return History(self._trace, self.schedule)

    def position_at(self, moment: int) -> SchedulePosition:
        """Position of the step after a moment; level = number of levels where the run has finished.

        Before the first step and the plan it is the beginning of the first level.
        """
        if moment > 0:
            return self._trace.steps[moment - 1].next_position
        if self._trace.steps:
            return self._trace.steps[0].position
        if self._trace.plan is None:
            return SchedulePosition(0, 0, 0, 0)
        return self.schedule.levels[self._trace.plan.first_level].begin

    def begun_at(self, moment: int) -> int:
        """The moment at which the sweep of the step after a moment began."""
        is_new = moment == 0 or self.position_at(moment)[2:] == (0, 0)
        return moment if is_new else self._trace.steps[moment - 1].sweep_moment

    def photos_at(self, moment: int) -> tuple[SchedulePosition, int]:
        """The position and the beginning of the sweep of photos by which a moment is seen.

        Of the next step; where that is none of photos, of the last photos before it on the same level, or as if photos began where
        smoothing or fit did.
        """
        position, n_levels = self.position_at(moment), self._problem.options.n_levels
        if position.level < n_levels and isinstance(self.history.stage_of(position), Photos):
            return position, self.begun_at(moment)
        # A branch may have fewer levels than the run it comes from.
        level = min(position.level, n_levels - 1)
        for record in reversed(self._trace.steps[:moment]):
            if record.stage is StageKind.PHOTOS or record.is_manual:
                is_same = position.level >= n_levels or record.position.level == level
                if is_same:
                    level = min(record.position.level, n_levels - 1)
                    return record.position._replace(level=level), record.sweep_moment
                break
        return SchedulePosition(level, 0, 0, 0), self.history.part_begun(moment, position)

    def at(self, moment: int) -> SweepState:
        """The sweep of the step after a moment; the last sweep of a finished run.

        Raises:
            InputError: no photo sees any face well enough.
            Cancelled: cancellation was requested.
        """
        position, begun = self.photos_at(moment)
        found = [sweep for sweep in self._sweeps if (sweep.moment, sweep.context.level) == (begun, position.level)]
        if found:
            sweep = found[0]
        else:
            # Memory is freed before the next sweep needs it.
            while self._sweeps and self._photo_bytes() > KEPT_BYTES // 8:
                self._sweeps.pop(0)
            sweep = self._begin(position, begun)
        others = [other for other in self._sweeps if other is not sweep]
        # The normal equations of older sweeps are not needed again, and are large.
        self._sweeps = [*(_without_system(other) for other in others[-3:]), sweep]
        return sweep

    @property
    def latest(self) -> SweepState | None:
        """The most recently used sweep; None if the cache is empty."""
        return self._sweeps[-1] if self._sweeps else None

    def share(self, other: "SweepCache", moment: int, with_sweeps: bool = True) -> None:
        """Take the fits of a run with the same past up to a moment, and its sweeps, if their terms are the same."""
        self._sweeps = [sweep for sweep in other._sweeps if with_sweeps and sweep.moment <= moment]
        self.fits.share(other.fits, moment)

    def clear(self) -> None:
        """Remove all sweeps; they are computed again when needed."""
        self._sweeps = []
        self.fits.clear()

    def _begin(self, position: SchedulePosition, moment: int) -> SweepState:
        level, history = self.schedule.levels[position.level], self.history
        trace, near = self._trace, None
        if level.attraction > 0 and (part := history.fit_before(moment)) is not None:
            near = self.fits.surface_points(history, *part)
        stage = level.stage_at(position.sweep)
        assert isinstance(stage, Photos)
        return begin_sweep(
            self._problem,
            level,
            stage,
            moment,
            trace.vertices_at(moment),
            history.origin_at(moment),
            near_points=near,
            number=position.sweep - stage.first_sweep,
            own_terms=self._own_terms,
        )

    def _photo_bytes(self) -> int:
        planes = {id(pixels): pixels.nbytes for pixels in (sweep.context.kernel.pixels for sweep in self._sweeps)}
        return sum(planes.values())


def _without_system(sweep: SweepState) -> SweepState:
    return sweep if sweep.system is None else replace(sweep, system=None)

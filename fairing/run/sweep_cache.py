"""Sweep cache: the sweep states of a recorded run at its moments."""

from dataclasses import replace

from fairing.run.phases import Schedule, schedule_of
from fairing.run.preparation import near_points
from fairing.run.sweep import SweepState, begin_sweep
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, Trace

MAX_SWEEPS = 4  # so that stepping back and forth does not compute visibility again
MAX_BYTES = 1 << 26  # of blurred photos that cached sweeps refer to


class SweepCache:
    """Positions in the schedule and sweep states, by moment. States need the plan of the trace; positions do not."""

    def __init__(self, problem: Problem, trace: Trace) -> None:
        self._problem, self._trace = problem, trace
        self._sweeps: list[SweepState] = []  # the most recently used is the last

    @property
    def schedule(self) -> Schedule:
        """The schedule of the planned run."""
        assert self._trace.plan is not None, "plan the run first"
        return schedule_of(self._problem.options, self._trace.plan)

    def position_at(self, moment: int) -> SchedulePosition:
        """Position of the step after a moment; level = number of levels where the run has finished.

        Before the first step and the plan it is the beginning of the first level.
        """
        if moment > 0:
            return self._trace.steps[moment - 1].next_position
        if self._trace.steps:
            return self._trace.steps[0].position
        first_level = self._trace.plan.first_level if self._trace.plan is not None else 0
        return SchedulePosition(first_level, 0, 0, 0)

    def begun_at(self, moment: int) -> int:
        """The moment at which the sweep of the step after a moment began."""
        is_new = moment == 0 or self.position_at(moment)[2:] == (0, 0)
        return moment if is_new else self._trace.steps[moment - 1].sweep_moment

    def at(self, moment: int) -> SweepState:
        """The sweep of the step after a moment; the last sweep of a finished run.

        Raises:
            InputError: no photo sees any face well enough.
            Cancelled: cancellation was requested.
        """
        position, begun = self.position_at(moment), self.begun_at(moment)
        n_levels = self._problem.options.n_levels
        if position.level >= n_levels:
            last = self._trace.steps[moment - 1]
            # A branch may have fewer levels than the run it comes from.
            position = last.position._replace(level=min(last.position.level, n_levels - 1))
            begun = last.sweep_moment
        found = [sweep for sweep in self._sweeps if (sweep.moment, sweep.context.level) == (begun, position.level)]
        if found:
            sweep = found[0]
        else:
            # Memory is freed before the next sweep needs it.
            while self._sweeps and self._photo_bytes() > MAX_BYTES:
                self._sweeps.pop(0)
            sweep = self._begin(position, begun)
        others = [other for other in self._sweeps if other is not sweep]
        # The normal equations of older sweeps are not needed again, and are large.
        self._sweeps = [*(_without_system(other) for other in others[1 - MAX_SWEEPS :]), sweep]
        return sweep

    @property
    def latest(self) -> SweepState | None:
        """The most recently used sweep; None if the cache is empty."""
        return self._sweeps[-1] if self._sweeps else None

    def share(self, other: "SweepCache", moment: int) -> None:
        """Take the sweeps of a run with the same past up to a moment."""
        self._sweeps = [sweep for sweep in other._sweeps if sweep.moment <= moment]

    def clear(self) -> None:
        """Remove all sweeps; they are computed again when needed."""
        self._sweeps = []

    def _begin(self, position: SchedulePosition, moment: int) -> SweepState:
        level = self.schedule.levels[position.level]
        trace, strengths, near = self._trace, level.at(position.sweep), None
        if strengths.attraction > 0 and trace.plan is not None:
            fit = trace.second_fit_before(moment)
            near = near_points(self._problem, trace.plan, trace.vertices_at(fit - 1) if fit else None)
        return begin_sweep(
            self._problem,
            strengths,
            level.phase_at(position.sweep),
            moment,
            trace.vertices_at(moment),
            trace.origin_at(moment),
            near_points=near,
        )

    def _photo_bytes(self) -> int:
        planes = {id(pixels): pixels.nbytes for pixels in (sweep.context.kernel.pixels for sweep in self._sweeps)}
        return sum(planes.values())


def _without_system(sweep: SweepState) -> SweepState:
    return sweep if sweep.system is None else replace(sweep, system=None)

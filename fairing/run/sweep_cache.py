"""The sweep that any moment of a run belongs to; a few are kept."""

from fairing.run.start_estimate import Start
from fairing.run.sweep import SweepState, begin_sweep
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, Trace

KEPT_SWEEPS = 4  # so that stepping back and forth does not judge visibility anew
KEPT_BYTES = 1 << 30  # of blurred photos that kept sweeps hold on to


class SweepCache:
    """Where a recorded run is at its moments, and what holds there."""

    def __init__(self, problem: Problem, start: Start, trace: Trace) -> None:
        self._problem, self._start, self._trace = problem, start, trace
        self._kept: list[SweepState] = []  # the last used comes last

    def position_at(self, moment: int) -> SchedulePosition:
        """Where the step after a moment belongs; level = number of levels where the run has finished."""
        if moment == 0:
            return SchedulePosition(self._start.first_level, 0, 0, 0)
        return self._trace.steps[moment - 1].next_position

    def begun_at(self, moment: int) -> int:
        """The moment at which the sweep began that the step after a moment belongs to."""
        is_new = self.position_at(moment)[2:] == (0, 0)
        return moment if is_new else self._trace.steps[moment - 1].sweep_moment

    def at(self, moment: int) -> SweepState:
        """The sweep that the step after a moment belongs to; of a finished run the last one.

        Raises:
            InputError: no photo sees any face well enough.
            Cancelled: nobody wants it any more.
        """
        position, begun = self.position_at(moment), self.begun_at(moment)
        n_levels = self._problem.options.n_levels
        if position.level >= n_levels:
            last = self._trace.steps[moment - 1]
            # A branch may have fewer levels than the run it comes from.
            position = last.position._replace(level=min(last.position.level, n_levels - 1))
            begun = last.sweep_moment
        kept = [sweep for sweep in self._kept if (sweep.moment, sweep.context.level) == (begun, position.level)]
        if kept:
            sweep = kept[0]
        else:
            # Before room is taken for the next one.
            while self._kept and self._held_bytes() > KEPT_BYTES:
                self._kept.pop(0)
            sweep = self._begin(position, begun)
        others = [other for other in self._kept if other is not sweep]
        self._kept = [*others[1 - KEPT_SWEEPS :], sweep]
        return sweep

    @property
    def n_blocks(self) -> int:
        """Of the sweep last asked for; 1 where there is none."""
        return len(self._kept[-1].units) if self._kept else 1

    @property
    def latest(self) -> SweepState | None:
        """The sweep last asked for; None where there is none."""
        return self._kept[-1] if self._kept else None

    def share(self, other: "SweepCache", moment: int) -> None:
        """Keep those of another run, whose past this one shares up to a moment."""
        self._kept = [sweep for sweep in other._kept if sweep.moment <= moment]

    def forget(self) -> None:
        """Keep none; they are made again when they are wanted."""
        self._kept = []

    def _begin(self, position: SchedulePosition, moment: int) -> SweepState:
        level, start, trace = position.level, self._start, self._trace
        is_second_try = position.sweep > 0 and start.plan(level).is_second_try(position.sweep)
        radius = start.search_radius(level) if position.sweep == 0 or is_second_try else 0.0
        vertices, origin = trace.vertices_at(moment), trace.origin_at(moment)
        return begin_sweep(
            self._problem, level, moment, vertices, origin, start.prior(level), radius, start.smoothing(level),
            start.attraction(level), start.restart_level(level), is_second_try,
        )  # fmt: skip

    def _held_bytes(self) -> int:
        planes = {id(pixels): pixels.nbytes for pixels in (sweep.context.kernel.pixels for sweep in self._kept)}
        return sum(planes.values())

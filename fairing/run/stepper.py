"""The step that follows a moment of a run: of which kind it is, and where the run goes on after it."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fairing.errors import InputError
from fairing.run.gauss_newton_step import gauss_newton_step
from fairing.run.preparation import preparing_step
from fairing.run.records import empty_record, returned_if_worse
from fairing.run.restart import restart
from fairing.run.schedule import next_position
from fairing.run.search_step import search_step
from fairing.run.start_estimate import Start
from fairing.run.sweep import SweepState
from fairing.run.sweep_cache import SweepCache
from fairing.solve.blocks import Block
from fairing.solve.energy import FaceSystem
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepRecord, Trace


class _Known(NamedTuple):
    """Normal equations of a unit that a step left behind for the next one."""

    moment: int
    unit: Block
    system: FaceSystem | None


class Stepper:
    """Computes steps from the vertices and the position in the schedule alone."""

    def __init__(self, problem: Problem, start: Start, trace: Trace, sweeps: SweepCache) -> None:
        self._problem, self._start, self._trace, self._sweeps = problem, start, trace, sweeps
        self._known: _Known | None = None

    def step_after(self, moment: int) -> StepRecord:
        """The step that follows a moment at which the run has not finished.

        Raises:
            InputError: no photo sees any face well enough.
            Cancelled: nobody wants it any more.
        """
        problem, start, position = self._problem, self._start, self._sweeps.position_at(moment)
        made_by_hand = sum(made <= moment for made in self._trace.manual_moments)
        if made_by_hand == 0 and moment < len(start.preparations):
            return preparing_step(problem, start.preparations[moment], position)
        if made_by_hand == moment and position.level < start.suitable_level:
            suitable = SchedulePosition(start.suitable_level, 0, 0, 0)
            return empty_record(problem, position, self._sweeps.begun_at(moment), suitable)
        sweep, vertices = self._sweeps.at(moment), self._trace.vertices_at(moment)
        if not sweep.units:
            following = SchedulePosition(position.level + 1, 0, 0, 0)
            if sweep.search_radius > 0:
                following = position._replace(sweep=position.sweep + 1)
            return self._never_worse(empty_record(problem, position, sweep.moment, following), sweep, moment)
        if position.unit >= len(sweep.units):
            raise InputError(
                f"trace: goes on at block {position.unit + 1} of a sweep with {len(sweep.units)} blocks; it was recorded "
                "on other photos or changed since, run it again"
            )
        unit = sweep.units[position.unit]
        previous = self._trace.steps[moment - 1] if position.iteration else None
        if previous is not None and not np.array_equal(previous.vertices, unit.vertices):
            raise InputError(
                f"trace: step {moment} moved other vertices than the block it goes on with; it was recorded on other "
                "photos or changed since, run it again"
            )
        if sweep.search_radius > 0:
            if unit.restart_level is not None:
                record = restart(problem, start, sweep, unit.vertices, unit.restart_level, position, vertices)
            else:
                record = search_step(problem, sweep, unit, position, vertices, start.reach)
            return self._planned(record, sweep, vertices, unit_is_done=True)
        iteration = gauss_newton_step(
            problem, sweep, unit, position, vertices, start.reach,
            previous=previous, system=self._system(moment, unit),
        )  # fmt: skip
        self._known = _Known(moment + 1, unit, iteration.system)
        return self._never_worse(self._planned(iteration.record, sweep, vertices, iteration.is_done), sweep, moment)

    def forget(self) -> None:
        """Drop the normal equations kept for the next step; they are computed again."""
        self._known = None

    def _system(self, moment: int, unit: Block) -> FaceSystem | None:
        known = self._known
        return known.system if known is not None and known.moment == moment and known.unit is unit else None

    def _never_worse(self, record: StepRecord, sweep: SweepState, moment: int) -> StepRecord:
        """The step after a moment, or instead of a run's last one the return to where it began, if that is better."""
        if record.next_position.level < self._problem.options.n_levels:
            return record
        by_hand = (made for made in self._trace.manual_moments if made <= moment)
        begun, vertices = self._trace.vertices_at(max(by_hand, default=0)), self._trace.vertices_at(moment)
        return returned_if_worse(self._problem, sweep, record, vertices, record.applied_to(vertices), begun)

    def _planned(self, record: StepRecord, sweep: SweepState, vertices: np.ndarray, unit_is_done: bool) -> StepRecord:
        """The record with where the run goes on; vertices (n, 3) are those before it."""
        going_on = next_position(
            self._problem.options.schedule, self._start.plan(record.position.level), record.position, unit_is_done,
            len(sweep.units), lambda: sweep.longest_move(self._problem.scene, record.applied_to(vertices)),
        )  # fmt: skip
        return replace(record, next_position=going_on)

"""Stepper: computes the step after a moment of a run, and the position after it."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fairing.errors import InputError
from fairing.run.gauss_newton_step import gauss_newton_step
from fairing.run.phases import GaussNewton, Restart, SecondFit
from fairing.run.preparation import Preparations, preparation_reasons
from fairing.run.records import empty_record, returned_if_worse
from fairing.run.restart import restart
from fairing.run.schedule import next_position
from fairing.run.search_step import search_step
from fairing.run.sweep import SweepState
from fairing.run.sweep_cache import SweepCache
from fairing.solve.blocks import Block
from fairing.solve.energy import FaceSystem
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepRecord, Trace


class _CarriedSystem(NamedTuple):
    """Normal equations at the end of a step, which the next step of the same block uses."""

    moment: int
    block: Block
    system: FaceSystem | None


class Stepper:
    """Computes steps as a function of the vertices and the position in the schedule alone."""

    def __init__(self, problem: Problem, trace: Trace, sweeps: SweepCache, preparations: Preparations) -> None:
        self._problem, self._trace, self._sweeps, self._preparations = problem, trace, sweeps, preparations
        self._carried: _CarriedSystem | None = None

    def step_after(self, moment: int) -> StepRecord:
        """The step after a moment of a planned run that has not finished.

        Raises:
            InputError: no photo sees any face well enough.
            Cancelled: cancellation was requested.
        """
        problem, trace, position = self._problem, self._trace, self._sweeps.position_at(moment)
        assert trace.plan is not None, "plan the run first"
        n_manual = sum(made <= moment for made in trace.manual_moments)
        planned, schedule = preparation_reasons(trace.plan), self._sweeps.schedule
        if n_manual == 0 and moment < len(planned):
            return self._preparations.step(planned[moment], position, trace.vertices_at(moment))
        self._preparations.clear()  # photos of every face; no later step needs them
        if n_manual == moment and position.level < schedule.begin_level:
            begin = SchedulePosition(schedule.begin_level, 0, 0, 0)
            return empty_record(problem, position, self._sweeps.begun_at(moment), begin)
        vertices = trace.vertices_at(moment)
        if self._is_second_fit(position):
            return self._second_fit(position, moment, vertices)
        sweep = self._sweeps.at(moment)
        if not sweep.blocks:
            following = SchedulePosition(position.level + 1, 0, 0, 0)
            if not isinstance(sweep.phase, GaussNewton):
                following = position._replace(sweep=position.sweep + 1)
            return self._returned_if_worse(empty_record(problem, position, sweep.moment, following), sweep, moment)
        if position.block >= len(sweep.blocks):
            raise InputError(
                f"trace: continues at block {position.block + 1} of a sweep with {len(sweep.blocks)} blocks; it was recorded "
                "on other photos or changed since, run it again"
            )
        block = sweep.blocks[position.block]
        previous = trace.steps[moment - 1] if position.iteration else None
        if previous is not None and not np.array_equal(previous.vertices, block.vertices):
            raise InputError(
                f"trace: step {moment} moved other vertices than the block it continues with; it was recorded on other "
                "photos or changed since, run it again"
            )
        if isinstance(sweep.phase, GaussNewton):
            system = self._carried_system(moment, block)
            iteration = gauss_newton_step(problem, sweep, block, position, vertices, previous, system)
            self._carried = _CarriedSystem(moment + 1, block, iteration.system)
            record = self._continued(iteration.record, sweep, vertices, iteration.is_done)
            return self._returned_if_worse(record, sweep, moment)
        if isinstance(sweep.phase, Restart):
            record = restart(problem, schedule, sweep, block, position, vertices)
        else:
            record = search_step(problem, sweep, block, position, vertices)
        return self._continued(record, sweep, vertices, block_is_done=True)

    def clear(self) -> None:
        """Remove the normal equations kept for the next step; they are computed again when needed."""
        self._carried = None

    def _is_second_fit(self, position: SchedulePosition) -> bool:
        return isinstance(self._sweeps.schedule.levels[position.level].phase_at(position.sweep), SecondFit)

    def _second_fit(self, position: SchedulePosition, moment: int, vertices: np.ndarray) -> StepRecord:
        """The step of a `SecondFit`; vertices (n, 3) are the positions at the moment. Manual edits would be lost by it."""
        end = SchedulePosition(position.level + 1, 0, 0, 0)
        if self._trace.manual_moments:
            return empty_record(self._problem, position, moment, end)
        fit = self._preparations.second_fit(position, moment, vertices)
        return replace(fit, next_position=position._replace(sweep=position.sweep + 1) if fit.accepted else end)

    def _carried_system(self, moment: int, block: Block) -> FaceSystem | None:
        carried = self._carried
        if carried is None or carried.moment != moment or carried.block is not block:
            return None
        return carried.system

    def _returned_if_worse(self, record: StepRecord, sweep: SweepState, moment: int) -> StepRecord:
        """The step after a moment; for the last step before a second fit and after it, or of a run, see
        `fairing.run.records.returned_if_worse`."""
        following = record.next_position
        if following.level < self._problem.options.n_levels and not self._is_second_fit(following):
            return record
        trace = self._trace
        edits = (made for made in trace.manual_moments if made <= moment)
        begun = trace.vertices_at(max(trace.second_fit_before(moment) - 1, *edits, 0))
        vertices = trace.vertices_at(moment)
        return returned_if_worse(self._problem, sweep, record, vertices, record.applied_to(vertices), begun)

    def _continued(
        self, record: StepRecord, sweep: SweepState, vertices: np.ndarray, block_is_done: bool
    ) -> StepRecord:
        """The record with its next position; vertices (n, 3) are the positions before the step."""
        following = next_position(
            self._sweeps.schedule.levels[record.position.level],
            record.position,
            block_is_done,
            len(sweep.blocks),
            lambda: sweep.longest_move(self._problem.scene, record.applied_to(vertices)),
        )
        return replace(record, next_position=following)

"""Stepper: computes the step after a moment of a run, and the position after it."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fairing.errors import InputError
from fairing.optimize.rows import Term
from fairing.run.fit_step import fit_iteration, iteration_record, photo_verdict, point_verdict, smoothing_iteration
from fairing.run.gauss_newton_step import Proposal, judge, propose
from fairing.run.phases import Level
from fairing.run.pulls import Pull, pulls_at, pulls_of_fit
from fairing.run.records import empty_record, end_verdict, held_out_points_prefer
from fairing.run.stages import ClosestPoints, Judge, Photos, PointGates, Smoothing, Stage
from fairing.run.sweep import SweepState
from fairing.run.sweep_cache import SweepCache
from fairing.solve.blocks import Block
from fairing.solve.energy import FaceSystem
from fairing.solve.problem import Problem
from fairing.stage_kind import StageKind
from fairing.trace import SchedulePosition, StepRecord, Trace

GAIN = 0.05  # smallest relative decrease of the mean loss (ledger: smoothing the start, fit to sparse points)


class Trial(NamedTuple):
    """A Gauss-Newton step of a vertex at a moment, which is tried but not recorded.

    Attributes:
        is_next: whether it is the step after the moment; else the step is as if the vertex's turn came at this moment.
        block: the vertices that take the step.
        proposal: what is tried.
        record: its outcome.
        sweep: of the step.
    """

    is_next: bool
    block: Block
    proposal: Proposal
    record: StepRecord
    sweep: SweepState


class Stepper:
    """Computes steps as a function of the vertices and the position in the schedule alone.

    Attributes:
        rehearsed: the first steps of the run, if they are known; they need not be computed again.
    """

    def __init__(self, problem: Problem, trace: Trace, sweeps: SweepCache) -> None:
        self._problem, self._trace, self._sweeps = problem, trace, sweeps
        self.rehearsed: list[StepRecord] = []
        # A moment, a block, and its normal equations then, which the step before has computed.
        self._carried: tuple[int, Block, FaceSystem | None] | None = None
        self._terms: tuple[int, tuple[Term, ...]] | None = None

    def step_after(self, moment: int) -> StepRecord:
        """The step after a moment of a planned run that has not finished.

        Raises:
            InputError: no photo sees any face well enough.
            Cancelled: cancellation was requested.
        """
        position = self._sweeps.position_at(moment)
        if moment < len(self.rehearsed) and not any(made <= moment for made in self._trace.manual_moments):
            return self.rehearsed[moment]
        stage = self._sweeps.history.stage_of(position)
        if isinstance(stage, Photos):
            return self._photos_step(position, moment)
        if isinstance(stage, Judge):
            return self._verdict(stage, position, moment)
        return self._fit_step(stage, position, moment)

    def stage_after(self, moment: int) -> StageKind:
        """The kind of stage of the step after a moment of a planned run that has not finished, before it is computed."""
        return self._sweeps.history.stage_of(self._sweeps.position_at(moment)).kind

    def pulls_at(self, moment: int) -> list[Pull]:
        """The parts of the terms in the step after a moment of a planned run, see `Session.pulls`.

        Raises: as `step_after`.
        """
        position, vertices = self._sweeps.position_at(moment), self._trace.vertices_at(moment)
        is_over, stage = position.level >= self._problem.options.n_levels, self._sweeps.history.stage_of(position)
        if not is_over and not isinstance(stage, Photos | Judge | Smoothing):
            return pulls_of_fit(self._problem, self._terms_of(position, moment), vertices)
        sweep = self._sweeps.at(moment)
        block, previous = self._block_and_previous(sweep, position, moment)
        system = self._system_at(moment, sweep, block) if block is None or block.coupled else None
        return pulls_at(self._problem, sweep, block, vertices, previous, system)

    def trial_at(self, moment: int, vertex: int) -> Trial | None:
        """The Gauss-Newton step of a vertex after a moment of a planned run, see `Session.trial`.

        Raises: as `step_after`.
        """
        problem, trace, sweep = self._problem, self._trace, self._sweeps.at(moment)
        position, vertices = self._sweeps.position_at(moment), trace.vertices_at(moment)
        block, previous = self._block_and_previous(sweep, position, moment)
        is_next = block is not None and vertex in block.vertices
        if block is None or not is_next:
            found = [k for k, other in enumerate(sweep.blocks) if vertex in other.vertices]
            if not found:
                return None
            block, previous = sweep.blocks[found[0]], None
            position = position._replace(block=found[0], iteration=0)
        proposal = propose(problem, sweep, block, vertices, previous, self._system_at(moment, sweep, block))
        if is_next and moment < len(trace):
            record = trace.steps[moment]
        else:
            record = judge(problem, sweep, block, position, vertices, proposal).record
        return Trial(is_next, block, proposal, record, sweep)

    def clear(self) -> None:
        """Remove the normal equations kept for the next step; they are computed again when needed."""
        self._carried, self._terms, self.rehearsed = None, None, []

    def _photos_step(self, position: SchedulePosition, moment: int) -> StepRecord:
        """An iteration of photos."""
        problem, vertices = self._problem, self._trace.vertices_at(moment)
        sweep = self._sweeps.at(moment)
        level = self._sweeps.history.level_of(position)
        block, previous = self._block_and_previous(sweep, position, moment)
        if block is None:
            following = level.begin_of(level.after(level.stage_at(position.sweep)))
            return empty_record(problem, position, sweep.moment, following)
        proposal = propose(problem, sweep, block, vertices, previous, self._system_at(moment, sweep, block))
        iteration = judge(problem, sweep, block, position, vertices, proposal)
        self._carried = moment + 1, block, iteration.system
        after = iteration.record.applied_to(vertices)
        following = level.position_after(
            position, iteration.is_done, len(sweep.blocks), lambda: sweep.longest_move(problem, after)
        )
        return replace(iteration.record, next_position=following)

    def _fit_step(self, stage: Stage, position: SchedulePosition, moment: int) -> StepRecord:
        """An iteration of smoothing or of a fit."""
        problem, trace, history = self._problem, self._trace, self._sweeps.history
        vertices, begun = trace.vertices_at(moment), self._sweeps.begun_at(moment)
        problem.raise_if_cancelled()
        if isinstance(stage, Smoothing):
            ids, iteration = smoothing_iteration(problem, trace.vertices_at(begun), vertices)
        else:
            ids, iteration = fit_iteration(problem, self._terms_of(position, moment), vertices)
        record, is_done = iteration_record(problem, stage.kind, position, begun, vertices, ids, iteration)
        level, following = history.level_of(position), position._replace(iteration=position.iteration + 1)
        if is_done or following.iteration >= stage.max_iterations:
            following = position._replace(sweep=position.sweep + 1, iteration=0)
        if stage.has(following.sweep):
            return replace(record, next_position=following)
        next_stage = self._after(level, stage, position, moment, record.applied_to(vertices))
        return replace(record, next_position=level.begin_of(next_stage))

    def _verdict(self, stage: Judge, position: SchedulePosition, moment: int) -> StepRecord:
        """A step of a judge."""
        problem, trace, history = self._problem, self._trace, self._sweeps.history
        level, vertices = history.level_of(position), trace.vertices_at(moment)
        if stage.by == "end":
            begun = trace.vertices_at(history.judged_from(moment))
            if np.array_equal(vertices, begun):  # nothing to judge
                record = replace(empty_record(problem, position, moment, position), stage=StageKind.JUDGE)
            else:
                record = end_verdict(problem, self._sweeps.at(moment), position, moment, vertices, begun)
            return replace(record, next_position=level.begin_of(None))
        begin, self._terms = history.part_begun(moment, position), None
        begun = trace.vertices_at(begin)
        if stage.by == "points":
            kept = vertices if held_out_points_prefer(problem, begun, vertices, without=True) else begun
            record = point_verdict(problem, position, moment, vertices, kept)
            return replace(record, next_position=level.begin_of(self._after(level, stage, position, moment, kept)))
        record = photo_verdict(problem, position, moment, begun, vertices, self._least_gain(begin, moment))
        return replace(record, next_position=level.begin_of(level.after(stage)))

    def _least_gain(self, begin: int, moment: int) -> float:
        """The part by which a fit from a moment to another must lower the loss of the photos.

        A fit to points near the surface need only lower it at all: coarse photos of a start some pixels off discriminate little
        (ledger: fit that the points call for).
        """
        kinds = {step.stage for step in self._trace.steps[begin:moment]}
        return 0.0 if StageKind.SURFACE_POINTS in kinds else GAIN

    def _terms_of(self, position: SchedulePosition, moment: int) -> tuple[Term, ...]:
        """The terms of the sweep of a fit's step after a moment."""
        begun, history = self._sweeps.begun_at(moment), self._sweeps.history
        if self._terms is None or self._terms[0] != begun:
            self._terms = begun, self._sweeps.fits.terms(history, position, begun)
        return self._terms[1]

    def _after(
        self, level: Level, stage: Stage, position: SchedulePosition, moment: int, vertices: np.ndarray
    ) -> Stage | None:
        """The next stage after one whose last step follows a moment and leads to vertices (n, 3), world units."""
        begin = self._sweeps.history.part_begun(moment, position)
        fit, following = self._sweeps.fits.begun_at(begin), level.after(stage)
        while following is not None and not fit.applies(following, vertices):
            # What belongs to searches for points is left out with them.
            skipped = ClosestPoints if isinstance(following, PointGates) else Stage
            following = level.after(following)
            while following is not None and not isinstance(following, skipped):
                following = level.after(following)
        return following

    def _block_and_previous(
        self, sweep: SweepState, position: SchedulePosition, moment: int
    ) -> tuple[Block | None, StepRecord | None]:
        """The block of the step after a moment, and its previous iteration in the sweep, None for its first.

        No block where that is no step of photos, or where no vertex can move.

        Raises:
            InputError: the trace does not fit the blocks of the sweep.
        """
        is_over = position.level >= self._problem.options.n_levels
        if is_over or not sweep.blocks or not isinstance(self._sweeps.history.stage_of(position), Photos):
            return None, None
        if position.block >= len(sweep.blocks):
            raise InputError(
                f"trace: continues at block {position.block + 1} of a sweep with {len(sweep.blocks)} blocks; it was recorded "
                "on other photos or changed since, run it again"
            )
        block = sweep.blocks[position.block]
        previous = self._trace.steps[moment - 1] if position.iteration else None
        if previous is not None and not np.array_equal(previous.vertices, block.vertices):
            raise InputError(
                f"trace: step {moment} moved other vertices than the block it continues with; it was recorded on other "
                "photos or changed since, run it again"
            )
        return block, previous

    def _system_at(self, moment: int, sweep: SweepState, block: Block | None) -> FaceSystem | None:
        """Normal equations at a moment that are known: of the beginning of its sweep, or what the block's last step left."""
        if moment == sweep.moment and sweep.system is not None:
            return sweep.system
        carried = self._carried
        return carried[2] if carried is not None and carried[0] == moment and carried[1] is block else None

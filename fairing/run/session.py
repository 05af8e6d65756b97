"""A fairing run that can be stepped, stopped, moved back and continued.

A run is a function of the scene and the options. Every step is computed from the vertices and the recorded position in
the schedule alone, so that a run resumed from its trace writes the same bytes as one never stopped.
"""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fairing.option_check import check_options
from fairing.options import FairingOptions, options_from_dict, options_to_dict
from fairing.run.manual_edits import manual_step
from fairing.run.schedule import fraction_done
from fairing.run.start_estimate import Start
from fairing.run.stepper import Stepper
from fairing.run.sweep import SweepState
from fairing.run.sweep_cache import SweepCache
from fairing.scene import Scene
from fairing.solve.energy import FaceSystem
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepReason, StepRecord, Trace
from fairing.trace_header import check_same_scene, header_of


class Session:
    """The engine on one scene.

    Args:
        scene: what to fair.
        options: how.
        trace: continue this run (its options win); default a new one.

    Attributes:
        moment: the present one; the next step continues from there.
        start: what is known of the mesh the run begins with.
        cancel_requested: asked within long steps; where it holds, the step in hand is dropped and `step` raises `Cancelled`.
        on_photo: told within long steps of the photos being read or judged: how many are done, and of how many.

    Raises:
        InputError: an option contradicts the scene, or the trace is not of this scene.
    """

    def __init__(self, scene: Scene, options: FairingOptions | None = None, trace: Trace | None = None) -> None:
        self.scene = scene
        if trace is not None:
            check_same_scene(scene, trace)
            options = options_from_dict(trace.header["options"])
        self.options = options or FairingOptions()
        check_options(self.options)
        if trace is None:
            trace = Trace(header_of(scene, self.options), scene.mesh.vertices, scene.mesh.faces)
        self.trace = trace
        self.moment = len(self.trace)
        self.cancel_requested: Callable[[], bool] = lambda: False
        self.on_photo: Callable[[int, int], None] = lambda done, count: None
        self._problem = Problem(
            scene, self.options, self.trace.start, lambda: self.cancel_requested(), lambda *read: self.on_photo(*read)
        )
        self.start = Start(self._problem)
        self._sweeps = SweepCache(self._problem, self.start, self.trace)
        self._stepper = Stepper(self._problem, self.start, self.trace, self._sweeps)
        self._seconds = 0.0

    # ------------------------------------------------------------------ where the run is

    @property
    def vertices(self) -> np.ndarray:
        """(n, 3) float: positions now, world units."""
        return self.trace.vertices_at(self.moment)

    @property
    def position(self) -> SchedulePosition:
        """Where the next step belongs."""
        return self._sweeps.position_at(self.moment)

    @property
    def finished(self) -> bool:
        """Whether the schedule has been worked off at the present moment."""
        return self.position.level >= self.options.n_levels

    @property
    def stop_reason(self) -> str:
        """Why the run stopped, as one sentence."""
        if not self.finished:
            return "not finished"
        if self.moment == 0:
            return "finished: there was nothing to do"
        last = self.trace.steps[self.moment - 1]
        if (last.reasons == StepReason.RETURNED).all():
            when = "after the last move by hand" if self.trace.manual_moments else "at the start"
            return f"finished: the energy at the finest level was lower {when}, so every vertex was returned"
        moved = np.linalg.norm(self.vertices - self.trace.start, axis=1) > 0
        return f"finished: all {self.options.n_levels} levels done, {int(moved.sum())} of {len(moved)} vertices moved"

    @property
    def progress(self) -> float:
        """Fraction of the schedule worked off, by the longest it can last, 0 to 1."""
        if self.finished:
            return 1.0
        return fraction_done(
            self.options, self.start.plan, self.position, self.start.first_level, self._sweeps.n_blocks
        )

    @property
    def locked(self) -> np.ndarray:
        """(n,) bool: vertices that never move, by option or because a degenerate face holds them."""
        return self._problem.locked.copy()

    @property
    def warnings(self) -> list[str]:
        """What a user should know of the scene and of the run, a line each."""
        return self._problem.warnings

    @property
    def seconds(self) -> dict[str, float]:
        """Time spent: on "photos", on "visibility", and on "steps", which includes what these took of both."""
        return self._problem.seconds | {"steps": self._seconds}

    @property
    def samples(self) -> int:
        """Cell samples read so far."""
        return self._problem.evaluator.samples

    # ------------------------------------------------------------------ moving back, and aside

    def go_to(self, moment: int) -> None:
        """Move to a recorded moment; the next step continues from there.

        Raises:
            IndexError: there is no such moment.
        """
        if not 0 <= moment <= len(self.trace):
            raise IndexError(f"moment {moment}: this run has moments 0 to {len(self.trace)}")
        self.moment = moment

    def branch(self, options: FairingOptions | None = None) -> "Session":
        """A new session that shares this run's past up to the present moment and goes on with other options."""
        trace = self.trace.cut(self.moment)
        trace.header["options"] = options_to_dict(options or self.options)
        branch = Session(self.scene, trace=trace)
        branch._problem.share_photos(self._problem)
        if branch.options == self.options:
            branch._sweeps.share(self._sweeps, self.moment)
        elif options is not None and not branch._continues(self):
            trace.continue_at(self.position._replace(unit=0, iteration=0))
        return branch

    def _continues(self, other: "Session") -> bool:
        """Whether this run, which shares the past of another, has the other's units up to the one at hand."""
        position = self.position
        if self.finished or other.finished or position[2:] == (0, 0):
            return True
        units, others = self.sweep_state().units, other.sweep_state().units
        return len(units) > position.unit and all(
            np.array_equal(unit.vertices, before.vertices)
            for unit, before in zip(units[: position.unit + 1], others, strict=False)
        )

    def forget_computed(self) -> None:
        """Free what can be computed again: blurred photos, visibility, equations. For a run that is put aside."""
        for holder in (self._sweeps, self._stepper, self._problem):
            holder.forget()

    # ------------------------------------------------------------------ moving forward

    def step(self) -> StepRecord | None:
        """One iteration: of a vertex, a set of vertices or all vertices, as the order has it. None when finished.

        At a past moment the recorded step is repeated (a run is deterministic), later ones are computed.

        Raises:
            InputError: no photo sees any face well enough.
            Cancelled: `cancel_requested` held while it computed; nothing has changed.
        """
        if self.finished:
            return None
        if self.moment < len(self.trace):
            self.moment += 1
            return self.trace.steps[self.moment - 1]
        began = time.perf_counter()
        record = self._stepper.step_after(self.moment)
        self.trace.append(record)
        self.moment += 1
        self._seconds += time.perf_counter() - began
        if record.next_position[:2] != record.position[:2]:
            self.trace.flush()
        return record

    def step_block(self) -> StepRecord | None:
        """All iterations of the present vertex (or set of vertices). Returns the last step."""
        return self._step_while(lambda now, then: now[:3] == then[:3])

    def step_sweep(self) -> StepRecord | None:
        """To the end of the sweep. Returns the last step."""
        return self._step_while(lambda now, then: now[:2] == then[:2])

    def step_level(self) -> StepRecord | None:
        """To the end of the level. Returns the last step."""
        return self._step_while(lambda now, then: now[0] == then[0])

    def _step_while(self, same: Callable[[SchedulePosition, SchedulePosition], bool]) -> StepRecord | None:
        began = self.position
        record = self.step()
        last = record
        while record is not None and same(began, self.position) and not self.finished:
            record = self.step()
            last = record or last
        return last

    def run(
        self, should_stop: Callable[[], bool] = lambda: False, on_step: Callable[[StepRecord], None] = lambda _: None
    ) -> str:
        """Work off the schedule.

        Args:
            should_stop: asked before every step.
            on_step: told of every step.

        Returns:
            Why it stopped.
        """
        while not self.finished:
            if should_stop():
                return "stopped on request"
            record = self.step()
            if record is not None:
                on_step(record)
        return self.stop_reason

    # ------------------------------------------------------------------ by hand

    def place(
        self, vertices: np.ndarray, positions: np.ndarray, reason: StepReason = StepReason.MOVED_MANUALLY
    ) -> StepRecord:
        """Put vertices elsewhere by hand, as a step of its own after the last one; the present sweep begins anew.

        From then on a placed vertex counts as having started there; a finished run goes on at its last level.

        Args:
            vertices: (u,) int, ids.
            positions: (u, 3) float, world units.
            reason: one of `MANUAL_REASONS`.

        Raises:
            InputError: a vertex is locked or would come behind a camera that sees it, or a face would be flipped or
                collapsed; nothing is moved.
        """
        assert self.moment == len(self.trace), "a record only grows at its end; branch first"
        position = self.position
        goes_on = position._replace(unit=0, iteration=0)
        if self.finished and self.moment:
            position, goes_on = self.trace.steps[-1].position, SchedulePosition(self.options.n_levels - 1, 0, 0, 0)
        record = manual_step(self._problem, self.sweep_state(), position, self.vertices, vertices, positions, reason)
        record = replace(record, next_position=goes_on)
        self.trace.append(record)
        self.moment += 1
        self.trace.flush()
        return record

    def reset(self, vertices: np.ndarray) -> StepRecord:
        """Put vertices (u,) back to their start by hand; see `place`."""
        return self.place(vertices, self.trace.start[vertices], StepReason.RESET_MANUALLY)

    # ------------------------------------------------------------------ what the engine sees

    def sweep_state(self, moment: int | None = None) -> SweepState:
        """Visibility, sigma, priors and order of the sweep that a moment belongs to (default: now)."""
        return self._sweeps.at(self.moment if moment is None else moment)

    @property
    def latest_sweep(self) -> SweepState | None:
        """The sweep last asked for, whichever moment it belongs to; None before the first."""
        return self._sweeps.latest

    def linearise_by_photos(self, faces: np.ndarray, moment: int) -> FaceSystem:
        """Energy and normal equations of faces (F,) at a moment by all their corners, with the eigenspace eliminated."""
        sweep, corners = self.sweep_state(moment), np.full(len(faces), -1)
        vertices = self.trace.vertices_at(moment)
        return self._problem.evaluator.linearise(
            sweep.context, vertices, faces, corners, sweep.scale, "variable_projection"
        )

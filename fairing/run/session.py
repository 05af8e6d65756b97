"""Session: a fairing run that can be stepped, stopped, moved back, branched and resumed.

A run is a function of the scene and the options. Its cameras and sparse points are chosen first (`Session.choose_inputs`),
then it is planned (`Session.make_plan`), each once; after that every step is computed from the vertices, the recorded
position in the schedule and the plan alone. A run resumed from its trace therefore writes the same bytes as one that was
never stopped. Properties never compute: they are functions of trace, options and plan.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fairing.cells.context import CellContext
from fairing.cells.point_spread import PATCH_MARGIN
from fairing.errors import InputError
from fairing.io.chosen_inputs import with_chosen_inputs
from fairing.io.scene_points import Progress
from fairing.norms.built_in import OWN
from fairing.norms.norm import Norm, Tabulated, tabulated
from fairing.option_check import check_options
from fairing.options import FairingOptions, options_from_dict, options_to_dict
from fairing.run.changed_plan import Kept, kept_under
from fairing.run.manual_edits import manual_step
from fairing.run.own_plan import (
    OPTIONS_BEFORE,
    OWN_PLAN,
    header_of_plan,
    options_before_plan,
    options_of_plan,
    recorded_plan,
    run_plan_of,
)
from fairing.run.phases import most_blocks
from fairing.run.planning import make_plan
from fairing.run.pulls import Pull
from fairing.run.recorded_norm import header_of_norm, options_with_norm, recorded_norm
from fairing.run.recorded_stages import stage_keys
from fairing.run.recorded_terms import check_terms_of_trace, header_of_terms
from fairing.run.stages import Photos
from fairing.run.stepper import Stepper, Trial
from fairing.run.sweep import SweepState
from fairing.run.sweep_cache import SweepCache
from fairing.run.trace_header import check_same_scene, header_of, inputs_of, scene_of_trace
from fairing.run_plan import PlanStage, RunPlan
from fairing.scene import Scene
from fairing.solve.energy import FaceSystem
from fairing.solve.problem import Problem
from fairing.stage_kind import StageKind
from fairing.terms.own import OwnTerm, check_terms
from fairing.trace import SchedulePosition, StepReason, StepRecord, Trace
from fairing.trace_check import check_own_terms
from fairing.util.plugins import offered
from fairing.work import WorkLog


class Session:
    """The engine on one scene.

    Args:
        scene: the mesh to fair, and its photos.
        options: default: the preset `accurate`.
        trace: continue this run, under its own options; default: a new run.
        like: a session on the same scene and start, whose photos in memory this one uses.
        terms: terms of one's own, see `OwnTerm`. A run that was recorded with some can be shown without them, but not continued.
        norm: a norm of one's own instead of that of the options, see `Norm`. A trace holds the values of its norm, so that its code
            is not needed again.
        plan: of one's own instead of what the start calls for, see `PlanStage`. The levels of the options are then those of its
            photos.
        plan_file: the file that defines `plan`; empty without one.

    Attributes:
        scene: with the chosen cameras and sparse points from `choose_inputs` on.
        moment: the present moment; the next step continues from there.
        cancel_requested: called within long computations, from any thread; where it returns True, the method that computes
            raises `Cancelled` and changes nothing.
        on_photo: called within long computations when photos are read or evaluated, with their number so far and in all.
        work: what the computation in progress does; read from any thread.
        own_plan: the stages of its own plan; empty: the run does what the start calls for.

    Raises:
        InputError: an option contradicts the scene, or the trace is not of this scene.
    """

    def __init__(
        self,
        scene: Scene,
        options: FairingOptions | None = None,
        trace: Trace | None = None,
        like: "Session | None" = None,
        terms: Sequence[OwnTerm] = (),
        norm: Norm | None = None,
        plan: Sequence[PlanStage] | None = None,
        plan_file: str = "",
    ) -> None:
        check_terms(terms)
        own_norm = None if norm is None else tabulated(norm)
        if trace is not None:
            scene = scene_of_trace(scene, trace)
            check_same_scene(scene, trace)
            check_own_terms(trace.header)
            options = options_from_dict(trace.header["options"])
            own_norm = recorded_norm(trace, own_norm)
            plan = recorded_plan(trace, plan)
        else:
            options = options or FairingOptions()
            if own_norm is not None:
                options = options_with_norm(options)
            given = options
            if plan is not None:
                options = options_of_plan(plan, given)
            facts = header_of(scene, options, terms) | header_of_norm(own_norm) | header_of_plan(plan or (), given)
            trace = Trace(facts, scene.mesh.vertices, scene.mesh.faces)
        self.options = options
        check_options(self.options)
        self.scene, self.trace, self.terms = scene, trace, tuple(terms)
        self._own_norm, self.own_plan, self._plan_file = own_norm, tuple(plan or ()), plan_file
        self.moment = len(self.trace)
        self.cancel_requested: Callable[[], bool] = lambda: False
        self.on_photo: Callable[[int, int], None] = lambda done, count: None
        self.work = WorkLog()
        self._set_problem(None if like is None else like._problem)
        self._max_degree = int(np.bincount(scene.mesh.edges.ravel()).max(initial=0))
        self._seconds = 0.0

    def _set_problem(self, like: Problem | None) -> None:
        """The problem of the scene and the options, and what computes with it."""
        self._problem = Problem(
            self.scene,
            self.options,
            self.trace.start,
            lambda: self.cancel_requested(),
            lambda *read: self.on_photo(*read),
            like,
            self.work,
            self._own_norm,
        )
        self._sweeps = SweepCache(self._problem, self.trace, self.terms)
        self._stepper = Stepper(self._problem, self.trace, self._sweeps)

    # ------------------------------------------------------------------ state

    @property
    def vertices(self) -> np.ndarray:
        """(n, 3) float: positions now, world units."""
        return self.trace.vertices_at(self.moment)

    @property
    def plan(self) -> RunPlan | None:
        """The plan of the run; None before `make_plan` or the first step."""
        return self.trace.plan

    @property
    def position(self) -> SchedulePosition:
        """Position of the next step; the beginning of the schedule in a run without steps or plan."""
        return self._sweeps.position_at(self.moment)

    @property
    def next_stage(self) -> StageKind | None:
        """Kind of stage of the next step; None for a run that has finished or is not planned yet."""
        if self.moment < len(self.trace):
            return self.trace.steps[self.moment].stage
        return None if self.finished or self.plan is None else self._stepper.stage_after(self.moment)

    @property
    def finished(self) -> bool:
        """Whether the schedule is done at the present moment."""
        return self.position.level >= self.options.n_levels

    @property
    def stop_reason(self) -> str:
        """The reason for the end of the run, as one sentence."""
        if not self.finished:
            return "not finished"
        moving, n_vertices = self._steps_of_vertices(), len(self.trace.start)
        if not moving:
            n_locked = int(self.locked.sum())
            unseen = "fewer than three photos see the faces of the others" if n_locked < n_vertices else "unlock some"
            return f"finished: no vertex could move: {n_locked} of {n_vertices} vertices are locked; {unseen}"
        if (moving[-1].reasons == StepReason.RETURNED).all():
            when = "at the start"
            if self.trace.manual_moments:
                when = "after the last manual edit"
            elif (self.vertices != self.trace.start).any():
                when = "before its second fit to the sparse points"  # of a former version
            return (
                f"finished: the mesh was better {when}, by its energy or by held-out points; every vertex was returned"
            )
        moved = (self.vertices != self.trace.start).any(axis=1)
        return f"finished: all {self.options.n_levels} levels done, {int(moved.sum())} of {n_vertices} vertices moved"

    @property
    def could_move_nothing(self) -> bool:
        """Whether the run is finished without a step of any vertex: all are locked, or too few photos see their faces."""
        return self.finished and not self._steps_of_vertices()

    def _steps_of_vertices(self) -> list[StepRecord]:
        """The steps so far by which photos moved vertices, or tried to, or the judge of the end returned them.

        In a plan of one's own also those of smoothing and fits, which may be all there is.
        """
        steps, counts_fits = self.trace.steps[: self.moment], bool(self.own_plan)
        return [
            record
            for record in steps
            if len(record.vertices)
            and (
                record.stage is StageKind.PHOTOS
                or record.is_manual
                or (counts_fits and record.stage.is_fit)
                or (record.reasons == StepReason.RETURNED).all()
            )
            and not (record.stage is StageKind.JUDGE and len(record.faces) == 0)
        ]

    @property
    def progress(self) -> float:
        """Fraction of the schedule that is done, by the longest it can take, 0 to 1; without a plan, by whole levels."""
        if self.finished:
            return 1.0
        position, n_levels = self.position, self.options.n_levels
        if self.trace.plan is None:
            first = self.trace.steps[0].position.level if self.moment else 0
            return max(0.0, (position.level - first) / max(1, n_levels - first)) if self.moment else 0.0
        n_free = int((~self._problem.locked).sum())
        n_blocks = most_blocks(self.options.schedule.order, n_free, self._max_degree)
        return self._sweeps.schedule.fraction_done(position, n_blocks)

    @property
    def locked(self) -> np.ndarray:
        """(n,) bool: vertices that never move, by option."""
        return self._problem.locked.copy()

    @property
    def orientation(self) -> int:
        """1 if the photos show the counter-clockwise side of the faces, -1 otherwise."""
        return self._problem.orientation

    @property
    def norm(self) -> Tabulated:
        """The norm of the residuals of photos: that of the options, or one's own."""
        return self._problem.norm

    @property
    def own_files(self) -> tuple[str, ...]:
        """The files with the code of its own terms and norm, and with its plan."""
        norm = () if self._own_norm is None else (self._own_norm.file,)
        files = (*(term.file for term in self.terms), *norm, self._plan_file)
        return tuple(dict.fromkeys(file for file in files if file))

    @property
    def warnings(self) -> list[str]:
        """Warnings about the scene and the run, a line each."""
        return self._problem.warnings

    @property
    def seconds(self) -> dict[str, float]:
        """Time spent on "photos", "visibility" and "steps", s; "steps" includes the other two as far as steps used them."""
        return self._problem.seconds | {"steps": self._seconds}

    @property
    def samples(self) -> int:
        """Number of cell samples read so far."""
        return self._problem.evaluator.samples

    # ------------------------------------------------------------------ moments and branches

    def go_to(self, moment: int) -> None:
        """Move to a recorded moment; the next step continues from there.

        Raises:
            IndexError: there is no such moment.
        """
        self.moment = self._recorded(moment)

    def _recorded(self, moment: int | None) -> int:
        """A moment of the run; None: the present one."""
        moment = self.moment if moment is None else moment
        if not 0 <= moment <= len(self.trace):
            raise IndexError(f"moment {moment}: this run has moments 0 to {len(self.trace)}")
        return moment

    def branch(
        self,
        options: FairingOptions | None = None,
        terms: Sequence[OwnTerm] | None = None,
        norm: Norm | None = None,
        plan: Sequence[PlanStage] | None = None,
    ) -> "Session":
        """A new session with the steps of this one up to the present moment, under the same or other options, own terms and norm.

        Under others the sweep of the next step begins anew; under other options or another norm the branch has no plan yet. Both
        remain if only the number of threads differs. A plan of one's own stays, unless the number of levels differs.

        Under another plan of one's own the branch has the steps before the first stage that is another one, and continues there.
        Its levels are those that a new run with the plan and the same options would have.

        Raises:
            InputError: the norm or the plan makes no sense, or needs what the scene does not have.
        """
        options, terms = options or self.options, self.terms if terms is None else tuple(terms)
        own_norm = self._own_norm
        if norm is not None:
            options, own_norm = options_with_norm(options), tabulated(norm)
        kept, of_plan = Kept(self.moment, None), {}
        if plan is not None:
            before = options_before_plan(self.trace, options)
            options = options_of_plan(plan, before)
            check_options(options)
            of_plan = header_of_plan(plan, before)
            self.choose_inputs()
            kept = kept_under(plan, options, self.own_plan, self.trace.steps[: self.moment], self._problem)
        trace = self.trace.cut(kept.moment)
        trace.header |= {"options": options_to_dict(options), **header_of_terms(terms), **header_of_norm(own_norm)}
        if plan is None and options.n_levels != self.options.n_levels:  # its stages belong to other levels
            for name in (OWN_PLAN, OPTIONS_BEFORE):
                trace.header.pop(name, None)
        trace.header |= of_plan
        levels = options.levels if plan is None else self.options.levels
        is_same = replace(options, threads=self.options.threads, levels=levels) == self.options
        is_same = is_same and (own_norm is None or own_norm.digest == self.norm.digest or options.robust.norm != OWN)
        if plan is not None:
            trace.plan = run_plan_of(plan, self._problem)
        elif not is_same:
            trace.plan = None
        if kept.position is not None:
            trace.continue_at(kept.position)
        elif (not is_same or terms != self.terms) and kept.moment and not self.finished:
            trace.continue_at(self._sweeps.position_at(kept.moment)._replace(block=0, iteration=0))
        branch = Session(self.scene, trace=trace, like=self, terms=terms, plan_file=self._plan_file)
        if plan is None and branch.options == self.options and branch.norm.digest == self.norm.digest:
            branch._sweeps.share(self._sweeps, self.moment, with_sweeps=terms == self.terms)
            branch._stepper.rehearsed = self._stepper.rehearsed
        return branch

    def forget_computed(self) -> None:
        """Free what can be computed again (blurred photos, visibility, normal equations), and end the threads."""
        for holder in (self._sweeps, self._stepper, self._problem):
            holder.clear()

    # ------------------------------------------------------------------ steps

    def choose_inputs(
        self,
        on_progress: Progress = lambda fraction, line: None,
        skip_requested: Callable[[], bool] = lambda: False,
    ) -> None:
        """Choose cameras and sparse points by `Scene.cameras_choice` and `Scene.points_choice`.

        Cameras are refined and points found in the photos where the choices require it. The first call does so and records
        it; `make_plan` calls it. It may take minutes.

        Args:
            on_progress: called with the finished part, 0 to 1, and a line.
            skip_requested: polled several times a second; where it returns True, the given cameras and points are used.

        Raises:
            InputError: a photo or mask cannot be decoded, or the trace was recorded with other points.
            Cancelled: `cancel_requested` returned True; nothing has changed.
        """
        if self.scene.points_choice == "given" and self.scene.cameras_choice == "given":
            return
        with self.work.doing("choosing cameras and sparse points") as work:

            def show(fraction: float, line: str) -> None:
                work.text, work.done = line, fraction
                on_progress(fraction, line)

            scene = with_chosen_inputs(self.scene, self.options.threads, show, self.cancel_requested, skip_requested)
        check_same_scene(scene, self.trace)
        self.scene = scene
        self._set_problem(self._problem)
        self.trace.record_inputs(inputs_of(scene))

    def make_plan(self) -> RunPlan:
        """The plan of the run, computed and recorded on the first call. It reads the photos and may take many seconds.

        Raises:
            InputError: no photo sees any face well enough; or the trace's disk is full.
            Cancelled: `cancel_requested` returned True; nothing has changed.
        """
        self.choose_inputs()
        if self.trace.plan is None:
            began = time.perf_counter()
            planned = make_plan(self._problem, self.own_plan)
            self._seconds += time.perf_counter() - began
            self.trace.record_plan(planned.plan)
            self._stepper.rehearsed = planned.steps
            self._sweeps.fits.share(planned.sweeps.fits, len(planned.steps))
            return planned.plan
        return self.trace.plan

    def step(self) -> StepRecord | None:
        """One iteration of a block: a vertex, a set of vertices or all, by the order of the options. None when finished.

        At a past moment the recorded step is repeated. A run without a plan is planned first.

        Raises:
            InputError: no photo sees any face well enough.
            Cancelled: `cancel_requested` returned True; no step was made.
        """
        if self.finished:
            return None
        if self.moment < len(self.trace):
            self.moment += 1
            return self.trace.steps[self.moment - 1]
        self.make_plan()
        check_terms_of_trace(self.trace, self.terms)
        began = time.perf_counter()
        record = self._stepper.step_after(self.moment)
        self.trace.append(record)
        self.moment += 1
        self._seconds += time.perf_counter() - began
        if record.next_position[:2] != record.position[:2]:
            self.trace.flush()
        return record

    def step_block(self) -> StepRecord | None:
        """All iterations of the present block. Returns the last step."""
        return self._step_while(lambda now, then: now[:3] == then[:3])

    def step_sweep(self) -> StepRecord | None:
        """To the end of the sweep. Returns the last step."""
        return self._step_while(lambda now, then: now[:2] == then[:2])

    def step_level(self) -> StepRecord | None:
        """To the end of the level. Returns the last step."""
        return self._step_while(lambda now, then: now[0] == then[0])

    def step_stage(self) -> StepRecord | None:
        """To the end of the stage, see `recorded_stages`. Returns the last step."""
        last, key_of = self.step(), stage_keys(self.trace)
        while last is not None and (kind := self.next_stage) is not None:
            if key_of(kind, self.position) != key_of(last.stage, last.position):
                break
            last = self.step()
        return last

    def _step_while(self, same: Callable[[SchedulePosition, SchedulePosition], bool]) -> StepRecord | None:
        if self.moment == len(self.trace):
            self.make_plan()
        began, last = self.position, self.step()
        while not self.finished and same(began, self.position):
            last = self.step()
        return last

    def run(
        self, should_stop: Callable[[], bool] = lambda: False, on_step: Callable[[StepRecord], None] = lambda _: None
    ) -> str:
        """All remaining steps.

        Args:
            should_stop: called before every step; True ends the run.
            on_step: called with the record of every step.

        Returns:
            The reason for the end.
        """
        while not self.finished:
            if should_stop():
                return "stopped on request"
            record = self.step()
            if record is not None:
                on_step(record)
        return self.stop_reason

    def __iter__(self) -> Iterator[StepRecord]:
        """All remaining steps, each as it is made."""
        while (record := self.step()) is not None:
            yield record

    def show(self) -> Any:
        """Open the debugger of an installed package on this session, at its present moment.

        Packages offer it by an entry point of the group `fairing.viewers`: a function of the session. That of EigenFairing
        returns an `app.notebook.live.LiveDebugger`, to which the session belongs until its `stop`; a loop over it makes the
        steps that the page shows.

        Raises:
            InputError: no installed package offers a debugger.
        """
        viewers = offered("fairing.viewers")
        if not viewers:
            raise InputError("show: expected an installed package with a debugger, found none; install EigenFairing")
        return next(iter(viewers.values()))(self)

    # ------------------------------------------------------------------ manual edits

    def place(
        self, vertices: np.ndarray, positions: np.ndarray, reason: StepReason = StepReason.MOVED_MANUALLY
    ) -> StepRecord:
        """Move vertices manually, as a step after the last one; the present sweep begins anew.

        The new positions become the origin of these vertices. A finished run continues at its last level.

        Args:
            vertices: (u,) int, ids.
            positions: (u, 3) float, world units.
            reason: one of `MANUAL_REASONS`.

        Raises:
            InputError: a vertex is locked or would be behind a camera that sees it, or a face would be flipped or
                collapsed; nothing is moved.
            Cancelled: `cancel_requested` returned True; nothing is moved.
        """
        assert self.moment == len(self.trace), "a record only grows at its end; branch first"
        sweep, position = self.sweep_state(), self.position
        following = position._replace(block=0, iteration=0)
        is_over = self.finished and self.moment > 0
        if is_over:
            position = self.trace.steps[-1].position
        if is_over or not isinstance(self._sweeps.history.stage_of(position), Photos):
            following = SchedulePosition(min(position.level, self.options.n_levels - 1), 0, 0, 0)
        record = manual_step(self._problem, sweep, position, self.vertices, vertices, positions, reason)
        record = replace(record, next_position=following)
        self.trace.append(record)
        self.moment += 1
        self.trace.flush()
        return record

    def reset(self, vertices: np.ndarray) -> StepRecord:
        """Move vertices (u,) back to their start manually; see `place`."""
        return self.place(vertices, self.trace.start[vertices], StepReason.RESET_MANUALLY)

    # ------------------------------------------------------------------ sweeps

    def sweep_state(self, moment: int | None = None) -> SweepState:
        """The sweep of the step after a moment (default: now). A run without a plan is planned first.

        Raises:
            InputError: no photo sees any face well enough.
            Cancelled: `cancel_requested` returned True.
        """
        self.make_plan()
        return self._sweeps.at(self.moment if moment is None else moment)

    @property
    def latest_sweep(self) -> SweepState | None:
        """The most recently used sweep, of any moment; None before the first."""
        return self._sweeps.latest

    def pulls(self, moment: int | None = None) -> list[Pull]:
        """How each term pulls at the vertices: the parts of the step that would be proposed after a moment (default: now).

        They are those of the Gauss-Newton step after the moment in `sweep_state`. A moment that has no such step uses the same
        sweep, as everything else that is computed at a moment: one before the preparations or a skipped level the first sweep
        of its level, a finished run one more step of its last sweep.

        Raises:
            IndexError: no such moment.
            InputError: no photo sees any face well enough.
            Cancelled: `cancel_requested` returned True.
        """
        moment = self._recorded(moment)
        self.make_plan()
        check_terms_of_trace(self.trace, self.terms)
        return self._stepper.pulls_at(moment)

    def trial(self, vertex: int, moment: int | None = None) -> Trial | None:
        """The Gauss-Newton step of a vertex after a moment (default: now), with what it is computed from; not recorded.

        It is the step after the moment if that includes the vertex, with its recorded outcome where there is one. Else it is
        the step as if the vertex's turn came at this moment. None where the sweep of the moment makes no such step of the vertex.

        Raises:
            IndexError: no such moment or vertex.
            InputError: no photo sees any face well enough.
            Cancelled: `cancel_requested` returned True.
        """
        moment = self._recorded(moment)
        if not 0 <= vertex < len(self.scene.mesh.vertices):
            raise IndexError(f"vertex {vertex}: this mesh has vertices 0 to {len(self.scene.mesh.vertices) - 1}")
        self.make_plan()
        return self._stepper.trial_at(moment, vertex)

    def pixels_moved(self, steps: np.ndarray, moment: int | None = None) -> np.ndarray:
        """(n,) float: displacement by steps (n, 3) from a moment (default: now), in the photo where it is longest, px.

        0 where no photo sees a vertex in the sweep of the moment.

        Raises: as `sweep_state`.
        """
        moment = self.moment if moment is None else moment
        context, vertices = self.sweep_state(moment).context, self.trace.vertices_at(moment)
        return self._problem.pixels_moved(context, vertices, np.arange(len(vertices)), steps)

    def context_for_moves(self, vertex: int, moment: int, positions: np.ndarray) -> CellContext:
        """The cells of the faces around a vertex at a moment, for their energies with the vertex at other positions.

        These are the cells of `sweep_state`, with larger patches of the photos: the patches of a sweep end `PATCH_MARGIN` px
        around each face, beyond which its steps do not go either, and a sample outside takes the patch's last pixel. Other
        faces take no part.

        Args:
            positions: (q, 3) float: of the vertex, world units.

        Raises:
            Cancelled: `cancel_requested` returned True.
        """
        context = self.sweep_state(moment).context
        cameras = [self.scene.views[view].camera for view in np.flatnonzero(context.vertex_views[vertex])]
        begun = context.vertices[vertex]
        moved = [np.abs(camera.project(positions)[0] - camera.project(begun[None])[0]).max() for camera in cameras]
        faces = np.zeros(len(context.takes_part), dtype=bool)
        faces[self.scene.mesh.one_rings[vertex]] = True
        margin = PATCH_MARGIN + max(moved, default=0.0)
        return self._problem.context_of(faces & (context.n_views > 0), context.level, context.vertices, margin)

    def problem_under(self, options: FairingOptions, cancel_requested: Callable[[], bool] = lambda: False) -> Problem:
        """The energy of the same scene and start under other options; it shares the photos in memory, and its own
        cancellation is requested by `cancel_requested`. Another thread may use it beside the session.

        Raises:
            InputError: an option contradicts the scene.
        """
        return Problem(self.scene, options, self.trace.start, cancel_requested, like=self._problem)

    def linearise_by_photos(self, faces: np.ndarray, moment: int) -> FaceSystem:
        """Energy and normal equations of faces (F,) int at a moment, by all corners, with the eigenspace eliminated.

        Raises:
            Cancelled: `cancel_requested` returned True.
        """
        sweep, corners = self.sweep_state(moment), np.full(len(faces), -1)
        vertices = self.trace.vertices_at(moment)
        return self._problem.evaluator.linearise(
            sweep.context, vertices, faces, corners, sweep.scale, "variable_projection"
        )

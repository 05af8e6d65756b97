"""A fairing run that can be stepped, stopped, moved back and continued.

A run is a function of the scene and the options. Every step is computed from the vertices and the recorded position in
the schedule alone, so that a run resumed from its trace writes the same bytes as one never stopped.
"""

import importlib.metadata
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fairing.cells import CellContext, build_context, facing
from fairing.energy import Evaluator, FaceSystem, robust_scale, robust_sigma
from fairing.errors import InputError, Interrupted
from fairing.first_level import first_fine_level, first_level, last_fine_level
from fairing.gauss_newton import (
    Prior,
    solve_jointly,
    solve_vertices,
    undetermined_directions,
    vertex_systems,
)
from fairing.hand import check_places
from fairing.locks import locked_by_options
from fairing.mesh import Mesh
from fairing.mesh_check import inspect_mesh
from fairing.option_check import check_options
from fairing.options import FairingOptions, by_level, options_from_dict, options_to_dict
from fairing.scale_space import ScaleSpace
from fairing.scene import Scene
from fairing.schedule import Unit, independent_sets, independent_unit, plan_units
from fairing.search import Found, loss_of_faces, search_unit
from fairing.smoothing import smoothed
from fairing.trace import Position, StepReason, StepRecord, Trace
from fairing.travel import pixels_moved, pixels_per_unit, shortened, unfolded
from fairing.visibility import Visibility

SEARCH_COARSENESS = 1.5
SEARCH_CELL = 48
REACH = 1.5
WELL_SEEN = 0.6  # part of the faces around a vertex
SMOOTHING_GAIN = 0.05
START_PASSES = 5
SWEEP_PASSES = 3
PROBES = 48
PROBE_RADII = (3.0, 6.0, 12.0)  # px
PROBE_GAIN = 0.1
PROBE_QUANTILE = 0.5
PROBE_MAJORITY = 0.5
OBJECTIVE_TOLERANCE = 1e-9  # relative: below this two energies are equal
TOO_MANY_PARTS = (
    "the mesh has too many faces to make the photos equally sharp on each: the last level takes them as they are"
)
KEPT_SWEEPS = 4  # so that stepping back and forth does not judge visibility anew
KEPT_BYTES = 1 << 30  # of blurred photos that kept sweeps hold on to


@dataclass(frozen=True, eq=False)
class SweepState:
    """What holds for a whole sweep, a function of the vertices at its beginning.

    Attributes:
        moment: when the sweep began.
        context: cells and visibility.
        sigma: (m,) float, grey levels, scale of the robust norm by face.
        scale: (m,) float, what the kernel wants of it.
        prior: the pull along undetermined directions.
        free: (n,) bool: vertices that may move and that enough photos see.
        units: what moves together, in order.
        search_radius: px; 0 for a sweep of Gauss-Newton.
        pixels_per_unit: (n,) float: how far a vertex moves at most in a photo, px per world unit; 0 where unseen.
        mean_loss: of the mesh, per photo px.
    """

    moment: int
    context: CellContext
    sigma: np.ndarray
    scale: np.ndarray
    prior: Prior
    free: np.ndarray
    units: list[Unit]
    search_radius: float
    pixels_per_unit: np.ndarray
    mean_loss: float


class Session:
    """The engine on one scene.

    Args:
        scene: what to fair.
        options: how.
        trace: continue this run (its options win); default a new one.

    Raises:
        InputError: no photo sees any face well enough, or an option contradicts the scene.
    """

    def __init__(self, scene: Scene, options: FairingOptions | None = None, trace: Trace | None = None) -> None:
        self.scene = scene
        if trace is not None:
            _check_same_scene(scene, trace)
            options = options_from_dict(trace.header["options"])
        self.options = options or FairingOptions()
        check_options(self.options)
        self.trace = trace or Trace(_header(scene, self.options), scene.mesh.vertices, scene.mesh.faces)
        self.moment = len(self.trace)
        self.warnings: list[str] = list(scene.warnings)
        self.seconds: dict[str, float] = {"photos": 0.0, "visibility": 0.0, "steps": 0.0}
        # Told within long steps of the photos being read: how many are done, and of how many.
        self.on_photo: Callable[[int, int], None] = lambda done, count: None
        self._photos = self._fresh_photos()
        self._evaluator = Evaluator(self.options.threads)
        self._excluded = np.zeros(len(scene.mesh.faces), dtype=bool)
        self._excluded[inspect_mesh(scene.mesh).degenerate_faces] = True
        self._locked = self._find_locked()
        self._orientation = facing(scene, self.trace.start)
        if self._orientation < 0:
            self.warnings.append("mesh: its faces point away from the photos; they are taken as turned around")
        # Asked within long steps; where it holds, the step in hand is dropped and `step` raises `Interrupted`.
        self.is_unwanted: Callable[[], bool] = lambda: False
        self._sweeps: list[SweepState] = []  # the last used comes last
        self._system: tuple[int, Unit, FaceSystem] | None = None

    # ------------------------------------------------------------------ where the run is

    @property
    def vertices(self) -> np.ndarray:
        """(n, 3) float: positions now, world units."""
        return self.trace.vertices_at(self.moment)

    @property
    def position(self) -> Position:
        """Where the next step belongs."""
        return self.trace.steps[self.moment - 1].next_position if self.moment else Position(self._first_level, 0, 0, 0)

    @property
    def finished(self) -> bool:
        """Whether the schedule has been worked off at the present moment."""
        return self.position.level >= self.options.n_levels

    @property
    def samples(self) -> int:
        """Cell samples read so far."""
        return self._evaluator.samples

    @property
    def locked(self) -> np.ndarray:
        """(n,) bool: vertices that never move, by option or because a degenerate face holds them."""
        return self._locked.copy()

    def go_to(self, moment: int) -> None:
        """Move to a recorded moment; the next step continues from there.

        Raises:
            IndexError: there is no such moment.
        """
        if not 0 <= moment <= len(self.trace):
            raise IndexError(f"moment {moment}: this run has moments 0 to {len(self.trace)}")
        self.moment = moment

    def forget_computed(self) -> None:
        """Free what can be computed again: blurred photos, visibility, equations. For a run that is put aside."""
        self._sweeps, self._system = [], None
        self._photos = self._fresh_photos()

    def _fresh_photos(self) -> ScaleSpace:
        return ScaleSpace(self.scene, self.options.cells.color, lambda done, count: self.on_photo(done, count))

    def branch(self, options: FairingOptions | None = None) -> "Session":
        """A new session that shares this run's past up to the present moment and goes on with other options."""
        trace = self.trace.cut(self.moment)
        trace.header["options"] = options_to_dict(options or self.options)
        branch = Session(self.scene, trace=trace)
        if branch.options.cells.color == self.options.cells.color:
            branch._photos = self._photos
        if branch.options == self.options:
            branch._sweeps = [sweep for sweep in self._sweeps if sweep.moment <= self.moment]
        if options is not None and options != self.options and not branch._goes_on_as(self):
            trace.go_on_at(self.position._replace(unit=0, iteration=0))
        return branch

    def _goes_on_as(self, other: "Session") -> bool:
        """Whether this run, which shares the past of another, has the other's units up to the one at hand."""
        position = self.position
        if self.finished or other.finished or position[2:] == (0, 0):
            return True
        units, others = self.sweep_state().units, other.sweep_state().units
        return len(units) > position.unit and all(
            np.array_equal(unit.vertices, before.vertices)
            for unit, before in zip(units[: position.unit + 1], others, strict=False)
        )

    # ------------------------------------------------------------------ moving forward

    def step(self) -> StepRecord | None:
        """One iteration: of a vertex, a set of vertices or all vertices, as the order has it. None when finished.

        At a past moment the recorded step is repeated (a run is deterministic), later ones are computed.

        Raises:
            Interrupted: `is_unwanted` held while it computed; nothing has changed.
        """
        if self.finished:
            return None
        if self.moment < len(self.trace):
            self.moment += 1
            return self.trace.steps[self.moment - 1]
        began = time.perf_counter()
        record = self._compute_step()
        self.trace.append(record)
        self.moment += 1
        self.seconds["steps"] += time.perf_counter() - began
        if record.next_position[:2] != record.position[:2]:
            self.trace.flush()
        return record

    def step_unit(self) -> StepRecord | None:
        """All iterations of the present vertex (or set of vertices). Returns the last step."""
        return self._step_while(lambda now, then: now[:3] == then[:3])

    def step_sweep(self) -> StepRecord | None:
        """To the end of the sweep. Returns the last step."""
        return self._step_while(lambda now, then: now[:2] == then[:2])

    def step_level(self) -> StepRecord | None:
        """To the end of the level. Returns the last step."""
        return self._step_while(lambda now, then: now[0] == then[0])

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

    def place(
        self, vertices: np.ndarray, positions: np.ndarray, reason: StepReason = StepReason.MOVED_BY_HAND
    ) -> StepRecord:
        """Put vertices elsewhere by hand, as a step of its own after the last one; the present sweep begins anew.

        From then on a placed vertex counts as having started there; a finished run goes on at its last level.

        Args:
            vertices: (u,) int, ids.
            positions: (u, 3) float, world units.
            reason: one of `BY_HAND`.

        Raises:
            InputError: a vertex is locked or would come behind a camera that sees it, or a face would be flipped or
                collapsed; nothing is moved.
        """
        assert self.moment == len(self.trace), "a record only grows at its end; branch first"
        before = self.vertices
        after = before.copy()
        after[vertices] = positions
        check_places(self.scene, before, after, self.trace.start, self._locked, vertices, self.options.step)
        sweep = self.sweep_state()
        faces = np.flatnonzero(np.isin(self.scene.mesh.faces, vertices).any(axis=1))
        here, there = (
            self._linearise(sweep.context, places, faces, np.full(len(faces), -1), sweep.scale)
            for places in (before, after)
        )
        if not np.isfinite(there.energy).all():
            raise InputError(f"vertex {int(vertices[0])}: there it would be behind a camera; nothing was moved")
        position, last_level = self.position, self.options.n_levels - 1
        goes_on = position._replace(unit=0, iteration=0)
        if self.finished and self.moment:
            position = self.trace.steps[self.moment - 1].position
            goes_on = Position(last_level, 0, 0, 0)
        H, _ = vertex_systems(self.scene.mesh, there)
        moved = self._moved(vertices, before, after, reason, (sweep.context, here), (sweep.context, there))
        record = replace(
            moved,
            position=position,
            next_position=goes_on,
            sweep_moment=sweep.moment,
            eigenvalues=np.linalg.eigvalsh(H[vertices]),
        )
        self.trace.append(record)
        self.moment += 1
        self.trace.flush()
        return record

    def reset(self, vertices: np.ndarray) -> StepRecord:
        """Put vertices (u,) back to their start by hand; see `place`."""
        return self.place(vertices, self.trace.start[vertices], StepReason.RESET_BY_HAND)

    @property
    def stop_reason(self) -> str:
        """Why the run stopped, as one sentence."""
        if not self.finished:
            return "not finished"
        if self.moment == 0:
            return "finished: there was nothing to do"
        last = self.trace.steps[self.moment - 1]
        if (last.reasons == StepReason.RETURNED).all():
            when = "after the last move by hand" if self.trace.hand_moments else "at the start"
            return f"finished: the energy at the finest level was lower {when}, so every vertex was returned"
        moved = np.linalg.norm(self.vertices - self.trace.start, axis=1) > 0
        return f"finished: all {self.options.n_levels} levels done, {int(moved.sum())} of {len(moved)} vertices moved"

    @property
    def progress(self) -> float:
        """Fraction of the schedule worked off, by the longest it can last, 0 to 1."""
        position = self.position
        if self.finished:
            return 1.0
        first, count = self._first_level, self.options.n_levels
        sweeps = by_level(self.options.schedule.max_sweeps, position.level)
        units = len(self._sweeps[-1].units) if self._sweeps else 1
        within = (position.sweep + min(1.0, position.unit / units)) / sweeps
        return (position.level - first + min(1.0, within)) / (count - first)

    # ------------------------------------------------------------------ what a sweep needs

    def sweep_state(self, moment: int | None = None) -> SweepState:
        """Visibility, sigma, priors and order of the sweep that a moment belongs to (default: now)."""
        moment = self.moment if moment is None else moment
        position, began = self._position_at(moment), self._sweep_moment_at(moment)
        if position.level >= self.options.n_levels:
            position = self.trace.steps[moment - 1].position
            began = self.trace.steps[moment - 1].sweep_moment
            # A branch may have fewer levels than the run it comes from.
            position = position._replace(level=min(position.level, self.options.n_levels - 1))
        kept = [sweep for sweep in self._sweeps if (sweep.moment, sweep.context.level) == (began, position.level)]
        if kept:
            sweep = kept[0]
        else:
            # Before room is taken for the next one.
            while self._sweeps and self._held_bytes() > KEPT_BYTES:
                self._sweeps.pop(0)
            sweep = self._begin_sweep(position, began)
        self._sweeps = [other for other in self._sweeps if other is not sweep][1 - KEPT_SWEEPS :]
        self._sweeps.append(sweep)
        return sweep

    def _held_bytes(self) -> int:
        planes = {id(pixels): pixels.nbytes for pixels in (sweep.context.kernel.pixels for sweep in self._sweeps)}
        return sum(planes.values())

    def _begin_sweep(self, position: Position, moment: int) -> SweepState:
        level, mesh = position.level, self.scene.mesh
        vertices = self.trace.vertices_at(moment)
        context = self._context(level, vertices)
        everything = np.arange(len(mesh.faces))
        measured = self._evaluator.measure(context, vertices, everything, np.ones(len(mesh.faces)))
        least = by_level(self.options.eigenspace.significance, level)
        if (shorter := context.without_noise(measured.standing_out, least)) is not context:
            context = shorter
            measured = self._evaluator.measure(context, vertices, everything, np.ones(len(mesh.faces)))
        sigma = robust_sigma(self.options.robust, level, measured)
        scale = robust_scale(self.options.robust, sigma)
        system = self._linearise(context, vertices, everything, np.full(len(everything), -1), scale)
        H, _ = vertex_systems(mesh, system)
        strength = np.linalg.eigvalsh(H)[:, 2]
        informed = strength > 0
        sliding, weak = undetermined_directions(vertices, mesh, H, context.takes_part, self.options.step)
        free = informed & ~self._locked
        radius = self._search_radius(level) if position.sweep == 0 else 0.0
        order = "independent" if radius > 0 else self.options.schedule.order
        pixels = pixels_per_unit(self.scene.views, context.vertex_views, vertices)
        movable = free & (pixels > 0)
        prior = Prior(sliding, weak, self.trace.origin_at(moment), vertices)
        smoothing = by_level(self.options.step.smoothing, level)
        if self.start_is_noisy and smoothing > 0 and informed.any():
            smooth_places = smoothed(mesh, vertices, SWEEP_PASSES)
            prior = prior.pulled(smooth_places, smoothing * float(np.median(strength[informed])))
            movable = free = ~self._locked
        if radius > 0:
            movable &= _well_seen(mesh, context.takes_part)
        units = plan_units(mesh, movable, order, system.energy)
        area = float((context.footprint_area * context.n_views)[context.takes_part].sum())
        mean_loss = float(system.energy.sum()) / area if area > 0 else 0.0
        return SweepState(moment, context, sigma, scale, prior, free, units, radius, pixels, mean_loss)

    def _search_radius(self, level: int) -> float:
        """How far from each vertex to look for a better place at this level, px; 0: not at all."""
        factor = by_level(self.options.schedule.search, level)
        return factor * self.start_error if factor > 0 else 0.0

    @property
    def _reach(self) -> float:
        """How far from its start a searched vertex may end, px: a little farther than the widest search."""
        return REACH * max(self.options.schedule.search) * self.start_error

    def _context(self, level: int, vertices: np.ndarray) -> CellContext:
        began, photos_before = time.perf_counter(), self._photos.seconds
        self._photos.forget_all_but(self.options.schedule.blur[level])
        context = self._build_context(level, vertices, ~self._excluded)
        on_photos = self._photos.seconds - photos_before
        self.seconds["photos"] += on_photos
        self.seconds["visibility"] += time.perf_counter() - began - on_photos
        if context.too_many_parts and TOO_MANY_PARTS not in self.warnings:
            self.warnings.append(TOO_MANY_PARTS)
        if not context.takes_part.any() and level == self.options.n_levels - 1:
            counts = {reason.name.lower(): int((context.reasons == reason).sum()) for reason in _reasons(context)}
            found = ", ".join(f"{name} {count}" for name, count in counts.items())
            raise InputError(
                f"scene {self.scene.name}: expected faces seen by at least 3 photos, found none ({found}); "
                "run `eigenfairing check` to see the mesh over the photos"
            )
        return context

    def _build_context(
        self, level: int, vertices: np.ndarray, judged_faces: np.ndarray, options: FairingOptions | None = None
    ) -> CellContext:
        self._stop_if_unwanted()
        return build_context(
            self.scene, self._photos, options or self.options, level, vertices, self._orientation, judged_faces,
            self._evaluator.pool,
        )  # fmt: skip

    def _stop_if_unwanted(self) -> None:
        if self.is_unwanted():
            raise Interrupted

    def _linearise(self, context, vertices, faces, corners, scale) -> FaceSystem:
        self._stop_if_unwanted()
        return self._evaluator.linearise(context, vertices, faces, corners, scale, self.options.step.solver)

    def linearise_by_photos(self, faces: np.ndarray, moment: int) -> FaceSystem:
        """Energy and normal equations of faces (F,) at a moment by all their corners, with the eigenspace eliminated."""
        sweep, corners = self.sweep_state(moment), np.full(len(faces), -1)
        vertices = self.trace.vertices_at(moment)
        return self._evaluator.linearise(sweep.context, vertices, faces, corners, sweep.scale, "variable_projection")

    # ------------------------------------------------------------------ one step

    def _compute_step(self) -> StepRecord:
        position = self.position
        untouched = sum(made <= self.moment for made in self.trace.hand_moments) == self.moment
        if self.moment == 0 and self.start_is_noisy:
            return self._smoothing_step()
        if untouched and position.level < self._level_near_truth:
            return self._empty_step(position, self._level_near_truth)
        sweep = self.sweep_state()
        if not sweep.units:
            return self._empty_step(position, position.level + 1)
        unit = sweep.units[position.unit]
        if sweep.search_radius > 0:
            return self._search_step(position, sweep, unit)
        ids, vertices = unit.vertices, self.vertices
        before = self.trace.steps[self.moment - 1] if position.iteration else None
        damping = before.damping_next if before else np.full(len(ids), self._initial_damping(position.level))
        rejections = before.rejections if before else np.zeros(len(ids), dtype=np.int64)

        system = self._system_at(sweep, unit, vertices)
        H, g = vertex_systems(self.scene.mesh, system)
        eigenvalues = np.linalg.eigvalsh(H[ids])
        g = g + self._spread(sweep.prior.gradient(vertices, ids), ids)
        if unit.coupled:
            free = np.zeros(len(vertices), dtype=bool)
            free[ids] = True
            proposed = solve_jointly(
                self.scene.mesh, system, sweep.prior.blocks, g, free, float(damping.max(initial=0))
            )[ids]
        else:
            resting = rejections > self.options.step.max_rejections
            proposed = solve_vertices(H[ids] + sweep.prior.blocks[ids], g[ids], damping)
            proposed[resting] = 0
        tried, folds = self._limit(sweep, vertices, ids, proposed)
        step_px = self._pixels(sweep.context, vertices, ids, tried)
        after = vertices.copy()
        after[ids] += tried
        new_system = self._linearise(sweep.context, after, unit.faces, unit.corners, sweep.scale)

        old_objective = self._objective(sweep, unit, system, vertices)
        new_objective = self._objective(sweep, unit, new_system, after)
        if unit.coupled:
            better = np.full(len(ids), new_objective.sum() <= old_objective.sum() * (1 + OBJECTIVE_TOLERANCE))
        else:
            better = new_objective <= old_objective * (1 + OBJECTIVE_TOLERANCE)
        reasons = np.where(better, StepReason.ACCEPTED, StepReason.REJECTED_ENERGY).astype(np.int8)
        still = better & (step_px < self.options.step.tolerance)
        reasons[still] = StepReason.CONVERGED
        reasons[folds & (step_px == 0)] = StepReason.REJECTED_FOLD
        if not unit.coupled:
            reasons[rejections > self.options.step.max_rejections] = StepReason.RESTING
        kept = np.where(better[:, None], after[ids], vertices[ids])
        after[ids] = kept
        face_better = better[unit.owner]
        face_after = np.where(face_better, new_system.energy, system.energy)
        pair_after = np.where(self._pairs_of(sweep, unit, face_better), new_system.pair_energy, system.pair_energy)
        # What holds at the next moment is known where all or none was accepted.
        known = new_system if better.all() else (None if better.any() else system)
        self._system = None if known is None else (self.moment + 1, unit, known)

        floor = self.options.step.initial_damping
        raised = np.maximum(damping * 10, floor)
        lowered = np.where(damping > floor, damping / 10, self._initial_damping(position.level))
        damping_next = np.where(better, lowered, raised)
        rejections = np.where(better, 0, rejections + 1)
        done = still | (rejections > self.options.step.max_rejections) | (reasons == StepReason.REJECTED_FOLD)
        next_position = self._next_position(position, sweep, bool(done.all()), after)
        record = StepRecord(
            position=position,
            next_position=next_position,
            sweep_moment=sweep.moment,
            vertices=ids,
            before=vertices[ids],
            proposed=proposed,
            after=kept,
            step_px=step_px,
            damping=damping,
            eigenvalues=eigenvalues,
            reasons=reasons,
            objective_before=float(old_objective.sum()),
            objective_after=float(new_objective.sum()),
            faces=unit.faces,
            face_energy_before=system.energy,
            face_energy_after=face_after,
            view_energy_before=self._by_view(sweep, system.pair_energy),
            view_energy_after=self._by_view(sweep, pair_after),
            damping_next=damping_next,
            rejections=rejections,
        )
        if next_position.level >= self.options.n_levels and position.level < self.options.n_levels:
            return self._never_worse(record, sweep, after)
        return record

    def _search_step(self, position: Position, sweep: SweepState, unit: Unit) -> StepRecord:
        """Look for better places of all vertices of an independent unit."""
        ids, vertices = unit.vertices, self.vertices
        found = self._search(sweep, unit, vertices, sweep.prior.run_start, sweep.search_radius, self._reach)
        moved = (found.after != vertices[ids]).any(axis=1)
        reasons = np.where(moved, StepReason.FOUND_PLACE, StepReason.NO_BETTER_PLACE).astype(np.int8)
        reasons[found.folds] = StepReason.REJECTED_FOLD
        after = vertices.copy()
        after[ids] = found.after
        n_views, blank = len(self.scene.views), np.zeros(len(ids))
        moved_faces = np.zeros(len(self.scene.mesh.faces), dtype=bool)
        moved_faces[unit.faces[moved[unit.owner]]] = True
        # Faces of a vertex that stays keep their energy, even where a moved neighbour uncovers or hides a part of them.
        view_energy_after = _sum_by_view(
            found.context_before, found.system_before.pair_energy, n_views, ~moved_faces
        ) + _sum_by_view(found.context_after, found.system_after.pair_energy, n_views, moved_faces)
        return StepRecord(
            position=position,
            next_position=self._next_position(position, sweep, True, after),
            sweep_moment=sweep.moment,
            vertices=ids,
            before=vertices[ids],
            proposed=found.proposed,
            after=found.after,
            step_px=self._pixels(sweep.context, vertices, ids, found.proposed),
            damping=blank,
            eigenvalues=np.zeros((len(ids), 3)),
            reasons=reasons,
            objective_before=float(found.score_before.sum()),
            objective_after=float(found.score_after.sum()),
            faces=unit.faces,
            face_energy_before=found.system_before.energy,
            face_energy_after=found.system_after.energy,
            view_energy_before=_sum_by_view(found.context_before, found.system_before.pair_energy, n_views),
            view_energy_after=view_energy_after,
            damping_next=blank,
            rejections=np.zeros(len(ids), dtype=np.int64),
        )

    def _search(
        self, sweep: SweepState, unit: Unit, vertices: np.ndarray, origin: np.ndarray, radius: float, reach: float
    ) -> Found:
        pixels, level = sweep.pixels_per_unit[unit.vertices], sweep.context.level
        # A search compares places pixels apart: coarser cells and depth maps do, at a third of the time.
        cells = self.options.cells
        coarse = replace(
            self.options,
            cells=replace(
                cells,
                spacing=tuple(x * SEARCH_COARSENESS for x in cells.spacing),
                size=tuple(min(size, SEARCH_CELL) for size in cells.size),
                interpolation=("bilinear",),
                point_spread=("as_seen",),
            ),
            visibility=replace(self.options.visibility, reduction=self.options.visibility.reduction * 2),
        )
        return search_unit(
            unit, vertices, origin, radius / pixels, reach / pixels, sweep.mean_loss, sweep.scale,
            self.scene.mesh, self.options, self._evaluator,
            lambda places, judged: self._build_context(level, places, judged, coarse), self._shorten,
        )  # fmt: skip

    def _initial_damping(self, level: int) -> float:
        always = self.options.step.damping_always
        return self.options.step.initial_damping if always else 0.0

    def _system_at(self, sweep: SweepState, unit: Unit, vertices: np.ndarray) -> FaceSystem:
        """Normal equations at the present moment: those of the last accepted trial, where there was one."""
        if self._system is not None and self._system[0] == self.moment and self._system[1] is unit:
            return self._system[2]
        return self._linearise(sweep.context, vertices, unit.faces, unit.corners, sweep.scale)

    def _spread(self, values: np.ndarray, ids: np.ndarray) -> np.ndarray:
        full = np.zeros((len(self.scene.mesh.vertices), 3))
        full[ids] = values
        return full

    # ------------------------------------------------------------------ a start full of noise

    @cached_property
    def start_is_noisy(self) -> bool:
        """Whether the photos agree clearly better with the start mesh smoothed: then its vertices lie off at random.

        (Captures and demos with noise gained 8 to 31 %; starts from structure from motion, decimated meshes and the
        facade lost 2 to 15.) Such a run begins smoothed and is pulled to where its faces would be smooth, which also
        settles the vertices no photo determines. Mean surface distance on a fountain and a castle from 0.306 and
        0.323 % of the diagonal: neither 0.182 and 0.246, start smoothed 0.170 and 0.208, both 0.139 and 0.202.
        Tried besides: smoothing unseen vertices alone between levels (0.002 better), all vertices (worse).
        """
        if not any(self.options.step.smoothing):
            return False
        here, there = (self._judged_finely(vertices)[2] for vertices in (self.trace.start, self._smoothed_start))
        return there < (1 - SMOOTHING_GAIN) * here

    @cached_property
    def _smoothed_start(self) -> np.ndarray:
        """(n, 3) float: the start with its noise filtered out, wherever that folds no face."""
        start, mesh = self.trace.start, self.scene.mesh
        ids = np.flatnonzero(~self._locked)
        moves, _ = self._unfolded(start, ids, (smoothed(mesh, start, START_PASSES) - start)[ids])
        return start + self._spread(moves, ids)

    def _judged_finely(self, vertices: np.ndarray) -> tuple[CellContext, FaceSystem, float]:
        """Energies at the first fine level, by the photos that see the faces there, and the mean loss per photo px.

        Coarser levels tell less (facade smoothed: 2 % lower at blur 2.0, 3 % higher at 1.2).
        """
        everything, level = np.arange(len(self.scene.mesh.faces)), first_fine_level(self.options)
        context = self._context(level, vertices)
        measured = self._evaluator.measure(context, vertices, everything, np.ones(len(everything)))
        scale = robust_scale(self.options.robust, robust_sigma(self.options.robust, level, measured))
        system = self._evaluator.measure(context, vertices, everything, scale)
        loss, pixels = loss_of_faces(context, system.energy, everything)
        return context, system, float((loss * pixels).sum() / max(pixels.sum(), 1e-300))

    def _smoothing_step(self) -> StepRecord:
        """Begin where the smoothed start is."""
        start, after = self.trace.start, self._smoothed_start
        ids = np.flatnonzero((after != start).any(axis=1))
        (context, here, loss_before), (context_after, there, loss_after) = map(self._judged_finely, (start, after))
        record = self._moved(ids, start, after, StepReason.SMOOTHED, (context, here), (context_after, there))
        return replace(record, objective_before=loss_before, objective_after=loss_after)

    def _moved(
        self,
        ids: np.ndarray,
        before: np.ndarray,
        after: np.ndarray,
        reason: StepReason,
        judged_before: tuple[CellContext, FaceSystem],
        judged_after: tuple[CellContext, FaceSystem],
    ) -> StepRecord:
        """The record of vertices (u,) put from their places in `before` (n, 3) to those in `after`, without a system solved."""
        (context, here), (context_after, there) = judged_before, judged_after
        n_views, blank = len(self.scene.views), np.zeros(len(ids))
        steps = after[ids] - before[ids]
        return StepRecord(
            position=self.position,
            next_position=self.position,
            sweep_moment=self._sweep_moment_at(self.moment),
            vertices=ids,
            before=before[ids],
            proposed=steps,
            after=after[ids],
            step_px=self._pixels(context, before, ids, steps),
            damping=blank,
            eigenvalues=np.zeros((len(ids), 3)),
            reasons=np.full(len(ids), reason, dtype=np.int8),
            objective_before=float(here.energy.sum()),
            objective_after=float(there.energy.sum()),
            faces=here.faces,
            face_energy_before=here.energy,
            face_energy_after=there.energy,
            view_energy_before=_sum_by_view(context, here.pair_energy, n_views),
            view_energy_after=_sum_by_view(context_after, there.pair_energy, n_views),
            damping_next=blank,
            rejections=np.zeros(len(ids), dtype=np.int64),
        )

    def _limit(self, sweep, vertices, ids, proposed) -> tuple[np.ndarray, np.ndarray]:
        """Shorten steps to the capture range and until no face folds; tells which vertices a fold held back."""
        tried = self._shorten(sweep.context, vertices, ids, proposed)
        if self.start_error > 0:
            # What lies so far off is not refined but lost: a vertex stays within the reach of the searches.
            start = sweep.prior.run_start[ids]
            offset = vertices[ids] + tried - start
            reach = self._reach / np.maximum(sweep.pixels_per_unit[ids], 1e-300)
            far = np.maximum(reach, np.linalg.norm(vertices[ids] - start, axis=1))
            length = np.linalg.norm(offset, axis=1)
            tried = np.where(
                (length > far)[:, None],
                start + offset * (far / np.maximum(length, 1e-300))[:, None] - vertices[ids],
                tried,
            )
        return self._unfolded(vertices, ids, tried)

    def _unfolded(self, vertices: np.ndarray, ids: np.ndarray, steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return unfolded(vertices, ids, steps, self.trace.start, self.scene.mesh.faces, self.options.step)

    def _shorten(self, context: CellContext, vertices: np.ndarray, ids: np.ndarray, steps: np.ndarray) -> np.ndarray:
        longest = self.options.step.max_step * max(1.0, self.options.schedule.blur[context.level])
        return shortened(self.scene.views, context.vertex_views, vertices, ids, steps, longest)

    def _pixels(self, context: CellContext, vertices: np.ndarray, ids: np.ndarray, steps: np.ndarray) -> np.ndarray:
        return pixels_moved(self.scene.views, context.vertex_views, vertices, ids, steps)

    def _objective(self, sweep: SweepState, unit: Unit, system: FaceSystem, vertices: np.ndarray) -> np.ndarray:
        """(u,) float: energy plus prior of each vertex of the unit; where it is coupled, the vertices' shares."""
        energy = np.bincount(unit.owner, weights=system.energy, minlength=len(unit.vertices))
        return energy + sweep.prior.energy(vertices, unit.vertices)

    def _pairs_of(self, sweep: SweepState, unit: Unit, face_mask: np.ndarray) -> np.ndarray:
        chosen = np.zeros(len(self.scene.mesh.faces), dtype=bool)
        chosen[unit.faces[face_mask]] = True
        return np.repeat(chosen, np.diff(sweep.context.kernel.pair_start))

    def _by_view(self, sweep: SweepState, pair_energy: np.ndarray) -> np.ndarray:
        return _sum_by_view(sweep.context, pair_energy, len(self.scene.views))

    # ------------------------------------------------------------------ the schedule

    def _next_position(self, position: Position, sweep: SweepState, unit_done: bool, after: np.ndarray) -> Position:
        schedule = self.options.schedule
        level = position.level
        searched = int(self._search_radius(level) > 0)
        if not unit_done and position.iteration + 1 < by_level(schedule.max_iterations, level):
            return position._replace(iteration=position.iteration + 1)
        if position.unit + 1 < len(sweep.units):
            return Position(level, position.sweep, position.unit + 1, 0)
        if sweep.search_radius > 0:
            return Position(level, 1, 0, 0)
        ids = np.flatnonzero(sweep.free)
        start = self.trace.vertices_at(sweep.moment)
        moved = self._pixels(sweep.context, start, ids, after[ids] - start[ids])
        sweeps = by_level(schedule.max_sweeps, level)
        if self._starts_near_truth:
            sweeps = min(sweeps, by_level(schedule.sweeps_near_truth, level))
        sweeps += searched
        if moved.max(initial=0) >= schedule.sweep_tolerance * schedule.blur[level] and position.sweep + 1 < sweeps:
            return Position(level, position.sweep + 1, 0, 0)
        return Position(level + 1, 0, 0, 0)

    @cached_property
    def _first_level(self) -> int:
        return first_level(self.scene, self.trace.start, self._orientation, self.options)

    @cached_property
    def _starts_near_truth(self) -> bool:
        """Whether the search by trial found the start near its truth."""
        schedule = self.options.schedule
        searching = [k for k in range(self.options.n_levels) if by_level(schedule.search, k) > 0]
        probed = (
            schedule.start == "auto" and schedule.start_error < 0 and searching and self._first_level >= searching[0]
        )
        return bool(probed) and not self.start_is_noisy and self.start_error == 0

    @property
    def _level_near_truth(self) -> int:
        """Where to begin when the start is near its truth: coarser levels would only make it worse.

        (castle from structure from motion, median of sparse points to surface: 0.173 % -> 0.210 from blur 2.0, 0.182 from 1.2.)
        """
        return last_fine_level(self.options) if self._starts_near_truth else self._first_level

    @cached_property
    def start_error(self) -> float:
        """How far the start's vertices lie from their places, px: as the options say, or found by trying.

        A spread of vertices is searched at several radii; the estimate is the distance that most of those stay within
        which find a clearly better place. Where most find none, the start needs no search.
        """
        schedule = self.options.schedule
        if schedule.start_error >= 0:
            return schedule.start_error
        if self.start_is_noisy:
            return 0.0
        levels = [k for k in range(self.options.n_levels) if by_level(schedule.search, k) > 0]
        # Where the faces are large enough for levels coarser than the searching ones, those bring the vertices near;
        # smaller faces fit somewhere by chance (fountain with 2,500 vertices: an estimate of 6.5 px where 0.4 was true).
        if not levels or self._first_level != levels[0]:
            return 0.0
        sweep = self._begin_sweep(Position(levels[0], 1, 0, 0), 0)
        ids = np.flatnonzero(sweep.free & (sweep.pixels_per_unit > 0))
        if len(ids) == 0:
            return 0.0
        groups = independent_sets(self.scene.mesh, ids)
        group = max(groups, key=len)
        unit = independent_unit(self.scene.mesh, group[:: -(-len(group) // PROBES)])
        distance, best = np.zeros(len(unit.vertices)), np.full(len(unit.vertices), 1 - PROBE_GAIN)
        for radius in PROBE_RADII:
            found = self._search(sweep, unit, self.trace.start, self.trace.start, radius, 2 * radius)
            gain = found.score_after / np.maximum(found.score_before, 1e-300)
            moved = np.linalg.norm(found.after - self.trace.start[unit.vertices], axis=1)
            improved = gain < best
            distance[improved] = (moved * sweep.pixels_per_unit[unit.vertices])[improved]
            best = np.minimum(best, gain)
        estimate = float(np.quantile(distance, PROBE_QUANTILE))
        return estimate if (distance > 1.0).mean() > PROBE_MAJORITY else 0.0

    def _position_at(self, moment: int) -> Position:
        return self.trace.steps[moment - 1].next_position if moment else Position(self._first_level, 0, 0, 0)

    def _sweep_moment_at(self, moment: int) -> int:
        position = self._position_at(moment)
        return moment if position.unit == 0 and position.iteration == 0 else self.trace.steps[moment - 1].sweep_moment

    def _empty_step(self, position: Position, next_level: int) -> StepRecord:
        """Go on at a finer level: no vertex can move here (every footprint is too small), or none needs so coarse a level."""
        nothing, views = np.zeros(0), np.zeros(len(self.scene.views))
        ids, points = nothing.astype(int), np.zeros((0, 3))
        return StepRecord(
            position, Position(next_level, 0, 0, 0), self._sweep_moment_at(self.moment), ids, points, points, points, nothing,
            nothing, points, nothing.astype(np.int8), 0.0, 0.0, ids, nothing, nothing, views, views, nothing, ids,
        )  # fmt: skip

    def _never_worse(self, record: StepRecord, sweep: SweepState, final: np.ndarray) -> StepRecord:
        """Return every vertex to the start, or to the last move by hand, if the finest level's energy was lower there."""
        everything = np.arange(len(self.scene.mesh.faces))
        begun = self.trace.vertices_at(max((m for m in self.trace.hand_moments if m <= self.moment), default=0))
        here = self._evaluator.measure(sweep.context, final, everything, sweep.scale)
        there = self._evaluator.measure(sweep.context, begun, everything, sweep.scale)
        if here.energy.sum() <= there.energy.sum():
            return record
        moved = self._moved(
            np.arange(len(final)),
            self.vertices,
            begun,
            StepReason.RETURNED,
            (sweep.context, here),
            (sweep.context, there),
        )
        return replace(
            moved, position=record.position, next_position=record.next_position, sweep_moment=record.sweep_moment
        )

    # ------------------------------------------------------------------ helpers

    def _step_while(self, same: Callable[[Position, Position], bool]) -> StepRecord | None:
        began = self.position
        record = self.step()
        last = record
        while record is not None and same(began, self.position) and not self.finished:
            record = self.step()
            last = record or last
        return last

    def _find_locked(self) -> np.ndarray:
        locked = locked_by_options(self.scene, self.options)
        locked[self.scene.mesh.faces[self._excluded]] = True
        return locked


def _well_seen(mesh: Mesh, takes_part: np.ndarray) -> np.ndarray:
    """(n,) bool: vertices of whose faces enough take part for a search to be trusted.

    Where most of the faces around a vertex are unseen, a far place that suits the few seen ones is seldom the right
    one (facade: such vertices went from 0.70 to 1.06 % rms).
    """
    count, seen = (
        np.bincount(mesh.faces.ravel(), weights=np.repeat(part, 3), minlength=len(mesh.vertices))
        for part in (np.ones(len(mesh.faces)), takes_part.astype(float))
    )
    return seen >= WELL_SEEN * np.maximum(count, 1)


def _sum_by_view(
    context: CellContext, pair_energy: np.ndarray, n_views: int, faces: np.ndarray | None = None
) -> np.ndarray:
    """(V,) float: energy by view, of the faces of a mask (m,) or of all."""
    data = context.kernel
    if faces is not None:
        pair_energy = pair_energy * np.repeat(faces, np.diff(data.pair_start))
    return np.bincount(data.pair_view, weights=pair_energy, minlength=n_views)


def _reasons(context: CellContext) -> list[Visibility]:
    return [reason for reason in Visibility if (context.reasons == reason).any()]


def _header(scene: Scene, options: FairingOptions) -> dict[str, Any]:
    return {
        "scene": scene.name,
        "views": [view.name for view in scene.views],
        "options": options_to_dict(options),
        "versions": {name: importlib.metadata.version(name) for name in ("numpy", "scipy", "numba")},
    }


def _check_same_scene(scene: Scene, trace: Trace) -> None:
    names = [view.name for view in scene.views]
    same_mesh = np.array_equal(trace.faces, scene.mesh.faces) and len(trace.start) == len(scene.mesh.vertices)
    if trace.header.get("views") != names or not same_mesh:
        raise InputError(
            f"trace of scene {trace.header.get('scene')}: expected the photos and the mesh it was recorded on, "
            f"found those of {scene.name}; open it with its own scene"
        )


def load_run(path: Path, scene: Scene) -> Session:
    """Continue a recorded run on its scene, at its last moment."""
    return Session(scene, trace=Trace.load(path))

"""Traces: the record of a run, one step after another, appended to a file and readable after a crash.

A *moment* is a number between two steps: moment 0 is the start, moment m the state after m steps. A trace stores
positions exactly, so that every moment is restored bit by bit; cells, residuals and flows are recomputed on demand.

On disk it is a `fairing.util.block_file`: a truncated step is dropped on reading, all steps before it are kept.
"""

import itertools
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fairing.errors import InputError
from fairing.mesh import Mesh
from fairing.run_plan import RunPlan
from fairing.stage_kind import StageKind
from fairing.trace_check import (
    Field,
    check_counts,
    check_fields,
    check_ids,
    check_positions,
    check_run_header,
    naming_block,
    read_header,
)
from fairing.util.block_file import BlockFile, blocks_budget, pack, read_blocks, unpack

MAGIC = b"EIGENFAIRING TRACE 1\n"
KEYFRAME_EVERY = 64


class StepReason(IntEnum):
    """The outcome of a step for a vertex."""

    ACCEPTED = 0
    CONVERGED = 1
    REJECTED_ENERGY = 2
    REJECTED_FOLD = 3
    UNSEEN = 4
    LOCKED = 5
    RESTING = 6
    RETURNED = 7
    FOUND_PLACE = 8
    NO_BETTER_PLACE = 9
    MOVED_MANUALLY = 10
    RESET_MANUALLY = 11
    SMOOTHED = 12
    FITTED_TO_POINTS = 13
    FOUND_TOGETHER = 14
    FITTED_AGAIN = 15
    REJECTED_FIT = 16
    READ_FROM_FILE = 17

    @property
    def text(self) -> str:
        return _REASON_TEXTS[self]


_REASON_TEXTS = {
    StepReason.ACCEPTED: "accepted: the energy fell",
    StepReason.CONVERGED: "converged: the step was below the tolerance",
    StepReason.REJECTED_ENERGY: "rejected: the step would have raised the energy",
    StepReason.REJECTED_FOLD: "rejected: the step would have folded or collapsed a face",
    StepReason.UNSEEN: "not moved: fewer than three photos see its faces",
    StepReason.LOCKED: "not moved: locked",
    StepReason.RESTING: "rests: its steps were rejected too often in this sweep",
    StepReason.RETURNED: "returned: its earlier position agrees better with points or photos",
    StepReason.FOUND_PLACE: "searched: a better place was found nearby",
    StepReason.FOUND_TOGETHER: "restarted from the start with its neighbours: a better place was found",
    StepReason.NO_BETTER_PLACE: "searched: no place nearby is better",
    StepReason.MOVED_MANUALLY: "moved by hand",
    StepReason.RESET_MANUALLY: "put back to its start by hand",
    StepReason.SMOOTHED: "smoothed: the photos agree better with the start's noise filtered out",
    StepReason.FITTED_TO_POINTS: "fitted to the sparse points: half of them are used, and the photos agree",
    StepReason.FITTED_AGAIN: "fitted again: to the sparse points, from where the photos had taken the mesh, and the photos agree",
    StepReason.REJECTED_FIT: "returned: the photos do not agree with the smoothing or the fit",
    StepReason.READ_FROM_FILE: "read from a file: the position that another program gave it",
}
MANUAL_REASONS = (StepReason.MOVED_MANUALLY, StepReason.RESET_MANUALLY, StepReason.READ_FROM_FILE)


class SchedulePosition(NamedTuple):
    """The place of a step in the schedule."""

    level: int
    sweep: int
    block: int
    iteration: int

    def __str__(self) -> str:
        return f"{self.level}:{self.sweep}:{self.block}:{self.iteration}"


@dataclass(frozen=True, eq=False)
class StepRecord:
    """One iteration of one block: a vertex, a set of independent vertices, or all vertices at once.

    u vertices of the block, F faces around them, V views.

    Attributes:
        position: level, sweep, block and iteration of this step.
        next_position: position of the next step; its level is the number of levels when the run has finished.
        sweep_moment: the moment at which the sweep began; visibility, sigma and priors are those of that moment.
        vertices: (u,) int, ids.
        before, after: (u, 3) float, positions, world units.
        proposed: (u, 3) float, the Gauss-Newton step before any limit.
        step_px: (u,) float: longest displacement in a photo of the step that was tried, pixels.
        damping: (u,) float, Levenberg-Marquardt damping used.
        eigenvalues: (u, 3) float, of the normal matrix without priors, ascending, energy / world unit^2.
        reasons: (u,) int8 `StepReason`.
        objective_before, objective_after: energy plus priors of the block, before and after the step that was tried.
        faces: (F,) int ids of the faces around the block.
        face_energy_before, face_energy_after: (F,) float; after equals before where the step was rejected.
        view_energy_before, view_energy_after: (V,) float.
        damping_next, rejections: (u,): solver state for the next iteration.
        stage: kind of the stage the step belongs to.
    """

    position: SchedulePosition
    next_position: SchedulePosition
    sweep_moment: int
    vertices: np.ndarray
    before: np.ndarray
    proposed: np.ndarray
    after: np.ndarray
    step_px: np.ndarray
    damping: np.ndarray
    eigenvalues: np.ndarray
    reasons: np.ndarray
    objective_before: float
    objective_after: float
    faces: np.ndarray
    face_energy_before: np.ndarray
    face_energy_after: np.ndarray
    view_energy_before: np.ndarray
    view_energy_after: np.ndarray
    damping_next: np.ndarray
    rejections: np.ndarray
    stage: StageKind = StageKind.PHOTOS

    @property
    def accepted(self) -> bool:
        """Whether any vertex moved."""
        return bool((self.before != self.after).any())

    @property
    def is_manual(self) -> bool:
        """Whether a user made this step, by hand or with another program."""
        return len(self.reasons) > 0 and int(self.reasons[0]) in MANUAL_REASONS

    def applied_to(self, vertices: np.ndarray) -> np.ndarray:
        """(n, 3) float: vertices (n, 3) after this step."""
        after = vertices.copy()
        after[self.vertices] = self.after
        return after

    @property
    def energy_before(self) -> float:
        return float(self.face_energy_before.sum())

    @property
    def energy_after(self) -> float:
        return float(self.face_energy_after.sum())


class Trace:
    """Header, start and steps of a run; optionally attached to a file.

    Attributes:
        header: facts of the run that JSON can hold: options, scene, versions.
        start: (n, 3) float, world units: vertices at moment 0.
        faces: (m, 3) int, indices into `start`.
        steps: the records.
        plan: see `RunPlan`; None before it is computed, and in traces of versions that did not record it.
        manual_moments: the moments after steps that a user made.
        stage_key: see `fairing.run.recorded_stages.stage_keys`; None until it is asked for.
    """

    def __init__(self, header: dict[str, Any], start: np.ndarray, faces: np.ndarray) -> None:
        self.header = header
        self.start = np.array(start, dtype=np.float64)
        self.faces = np.array(faces, dtype=np.int64)
        self.steps: list[StepRecord] = []
        self.plan: RunPlan | None = None
        self.manual_moments: list[int] = []
        self.stage_key: Callable[[StageKind, SchedulePosition], tuple[StageKind, int, int]] | None = None
        self._keyframes: dict[int, np.ndarray] = {0: self.start}
        self._newest: tuple[int, np.ndarray] = (0, self.start.copy())
        self._file: BlockFile | None = None
        self._unwritten: Path | None = None  # the file that could not be written

    def __len__(self) -> int:
        return len(self.steps)

    def record_inputs(self, inputs: dict[str, Any]) -> None:
        """Set the header's entries about cameras and sparse points; an attached file is written anew.

        Raises:
            InputError: the disk is full.
        """
        self.header |= inputs
        if self._file is not None:
            self.attach(self._file.path)

    def record_plan(self, plan: RunPlan) -> None:
        """Set the plan, and write it to the file if one is attached.

        Raises:
            InputError: the disk is full. The plan is kept in memory; the next call of `append` tries to write it.
        """
        self.plan = plan
        self._write(lambda: _pack_plan(plan))

    def append(self, record: StepRecord) -> None:
        """Add a step and write it to the attached file, if any.

        Raises:
            InputError: the disk is full. The step is kept in memory; the next call writes all steps again.
        """
        self._index(record)
        self._write(lambda: _pack_record(record))

    def vertices_at(self, moment: int) -> np.ndarray:
        """(n, 3) float, world units: positions at a moment, a copy.

        Raises:
            IndexError: there is no such moment.
        """
        if not 0 <= moment <= len(self.steps):
            raise IndexError(f"moment {moment}: this trace has moments 0 to {len(self.steps)}")
        newest_moment, newest = self._newest  # read once: another thread may append meanwhile
        if moment == newest_moment:
            return newest.copy()
        key = moment - moment % KEYFRAME_EVERY
        vertices = self._keyframes[key].copy()
        for record in self.steps[key:moment]:
            vertices[record.vertices] = record.after
        return vertices

    def attach(self, path: Path) -> None:
        """Write the trace to `path`, replacing an existing file, and append further steps to it.

        Raises:
            InputError: the disk is full, or the folder is missing.
        """
        if self._file is not None:
            self.detach()
        header = pack({"header": json.dumps(self.header)}, start=self.start, faces=self.faces)
        plan = [] if self.plan is None else [_pack_plan(self.plan)]
        self._file = BlockFile(path, MAGIC, itertools.chain([header], plan, map(_pack_record, self.steps)))
        self._unwritten = None

    def flush(self) -> None:
        """Write all steps to the disk, so that they survive a crash of the machine.

        Raises:
            InputError: the disk is full.
        """
        if self._unwritten is not None:
            self.attach(self._unwritten)
        if self._file is not None:
            with self._giving_up_file():
                self._file.flush()

    def detach(self) -> None:
        """Flush and close the attached file.

        Raises:
            InputError: the disk is full.
        """
        self.flush()
        if self._file is not None:
            self._file.close()
            self._file = None

    def _write(self, packed: Callable[[], bytes]) -> None:
        """Append a block to the file if one is attached; after a failure write the whole trace again."""
        if self._unwritten is not None:
            self.attach(self._unwritten)
        elif self._file is not None:
            with self._giving_up_file():
                self._file.append(packed())

    @contextmanager
    def _giving_up_file(self) -> Iterator[None]:
        """Detaches the file if writing to it fails; the next append or flush writes it again."""
        try:
            yield
        except InputError:
            assert self._file is not None
            self._unwritten, self._file = self._file.path, None
            raise

    def cut(self, moment: int) -> "Trace":
        """A new trace in memory with the plan and the steps up to a moment."""
        branch = Trace(dict(self.header), self.start, self.faces)
        branch.plan = self.plan
        for record in self.steps[:moment]:
            branch._index(record)
        return branch

    def continue_at(self, position: SchedulePosition) -> None:
        """Replace the position at which the run continues after its last step."""
        assert self._file is None, "a trace on disk only grows"
        self.steps[-1] = replace(self.steps[-1], next_position=position)

    @classmethod
    def load(cls, path: str | Path) -> "Trace":
        """Read a trace file; a truncated step at its end is dropped.

        Raises:
            InputError: the file is missing, no trace, or holds a header or a step that no run can have written.
        """
        blocks = read_blocks(Path(path), MAGIC, "trace")
        budget = blocks_budget(blocks)
        with naming_block(f"trace {path}"):
            texts, arrays = unpack(blocks[0], budget)
            header = read_header(texts)
            check_run_header(header)
            check_fields(arrays, _MESH_FIELDS, {})
            mesh = Mesh(arrays["start"], arrays["faces"])
        trace = cls(header, mesh.vertices, mesh.faces)
        for block in blocks[1:]:
            with naming_block(f"trace {path}: step {len(trace) + 1}"):
                texts, values = unpack(block, budget)
                if "plan" in texts:
                    trace.plan = RunPlan.from_json(texts["plan"])
                else:
                    trace._index(trace._checked_record(values))
        return trace

    def _checked_record(self, values: dict[str, np.ndarray]) -> StepRecord:
        """The record of the arrays of a block, which continues this trace.

        Raises:
            InputError: a field is missing, unknown, of another shape or type, or out of range.
        """
        if "stage" not in values:  # a former version recorded the step
            values = values | {
                "stage": np.asarray(int(stage_of_reasons(values.get("reasons", np.zeros(0, dtype=int)))))
            }
        check_fields(values, _STEP_FIELDS, {"V": len(self.header["views"])})
        for name in ("position", "next_position", "rejections"):
            check_counts(values[name], name)
        check_ids(values["sweep_moment"], len(self.steps) + 1, "sweep_moment")
        check_ids(values["vertices"], len(self.start), "vertices")
        check_ids(values["faces"], len(self.faces), "faces")
        check_ids(values["reasons"], len(StepReason), "reasons")
        check_ids(values["stage"], len(StageKind), "stage")
        for name in ("before", "after"):
            check_positions(values[name], name)
        return StepRecord(
            **{
                **values,
                "position": SchedulePosition(*values["position"].tolist()),
                "next_position": SchedulePosition(*values["next_position"].tolist()),
                "sweep_moment": int(values["sweep_moment"]),
                "objective_before": float(values["objective_before"]),
                "objective_after": float(values["objective_after"]),
                "stage": StageKind(int(values["stage"])),
            }
        )

    def _index(self, record: StepRecord) -> None:
        self.steps.append(record)
        vertices = record.applied_to(self._newest[1])  # a copy, because another thread may read the current array
        self._newest = (len(self.steps), vertices)
        if record.is_manual:
            self.manual_moments.append(len(self.steps))
        if len(self.steps) % KEYFRAME_EVERY == 0:
            self._keyframes[len(self.steps)] = vertices.copy()


def _pack_record(record: StepRecord) -> bytes:
    return pack({}, **{field.name: np.asarray(getattr(record, field.name)) for field in fields(StepRecord)})


def _pack_plan(plan: RunPlan) -> bytes:
    return pack({"plan": plan.to_json()})


_MESH_FIELDS = {"start": Field("f", ("n", 3)), "faces": Field("iu", ("m", 3))}
# What the solver left behind may be infinite where it failed; everything a reader computes with is finite.
_STEP_FIELDS = {
    "position": Field("iu", (4,)),
    "next_position": Field("iu", (4,)),
    "sweep_moment": Field("iu"),
    "vertices": Field("iu", ("u",)),
    "before": Field("f", ("u", 3), is_finite=True),
    "proposed": Field("f", ("u", 3)),
    "after": Field("f", ("u", 3), is_finite=True),
    "step_px": Field("f", ("u",)),
    "damping": Field("f", ("u",)),
    "eigenvalues": Field("f", ("u", 3)),
    "reasons": Field("iu", ("u",)),
    "objective_before": Field("f", is_finite=True),
    "objective_after": Field("f", is_finite=True),
    "faces": Field("iu", ("F",)),
    "face_energy_before": Field("f", ("F",), is_finite=True),
    "face_energy_after": Field("f", ("F",), is_finite=True),
    "view_energy_before": Field("f", ("V",), is_finite=True),
    "view_energy_after": Field("f", ("V",), is_finite=True),
    "damping_next": Field("f", ("u",)),
    "rejections": Field("iu", ("u",)),
    "stage": Field("iu"),
}
_STAGES = {
    StepReason.SMOOTHED: StageKind.SMOOTHNESS,
    StepReason.FITTED_TO_POINTS: StageKind.FIT,
    StepReason.FITTED_AGAIN: StageKind.FIT,
    StepReason.REJECTED_FIT: StageKind.FIT,
    StepReason.RETURNED: StageKind.JUDGE,
    StepReason.MOVED_MANUALLY: StageKind.MANUAL,
    StepReason.RESET_MANUALLY: StageKind.MANUAL,
    StepReason.READ_FROM_FILE: StageKind.SNAPSHOT,
}


def stage_of_reasons(reasons: np.ndarray) -> StageKind:
    """The kind of stage of a step that was recorded without one, by the reasons (u,) of its vertices."""
    known = {int(reason): kind for reason, kind in _STAGES.items()}
    return known.get(int(reasons.flat[0]), StageKind.PHOTOS) if reasons.size else StageKind.PHOTOS

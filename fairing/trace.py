"""The record of a run: every step, small enough to keep, appended to a file as it happens and readable after a crash.

A *moment* is a number between two steps: moment 0 is the start, moment m the state after m steps. A trace holds
positions exactly, so any moment comes back to the bit; cells, residuals and flows are recomputed from it on demand.

On disk it is a `block_file`: steps cut short by a crash are dropped on reading, everything before them is kept.
"""

import itertools
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fairing.errors import InputError
from fairing.util.block_file import BlockFile, pack, read_blocks, unpack

MAGIC = b"EIGENFAIRING TRACE 1\n"
KEYFRAME_EVERY = 64


class StepReason(IntEnum):
    """What became of a vertex in a step."""

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
    StepReason.RETURNED: "returned: the fine-level energy had been lower",
    StepReason.FOUND_PLACE: "searched: a better place was found near by",
    StepReason.FOUND_TOGETHER: "tried again from the start, with its neighbours: a better place was found",
    StepReason.NO_BETTER_PLACE: "searched: no place near by is better",
    StepReason.MOVED_MANUALLY: "moved by hand",
    StepReason.RESET_MANUALLY: "put back to its start by hand",
    StepReason.SMOOTHED: "smoothed: the photos agree better with the start's noise filtered out",
    StepReason.FITTED_TO_POINTS: "drawn to the sparse points: half of them are used, and the photos agree",
}
PREPARING = (StepReason.SMOOTHED, StepReason.FITTED_TO_POINTS)
MANUAL_REASONS = (StepReason.MOVED_MANUALLY, StepReason.RESET_MANUALLY)


class SchedulePosition(NamedTuple):
    """Where in the schedule a step belongs."""

    level: int
    sweep: int
    unit: int
    iteration: int

    def __str__(self) -> str:
        return f"{self.level}:{self.sweep}:{self.unit}:{self.iteration}"


@dataclass(frozen=True, eq=False)
class StepRecord:
    """One iteration of one unit: a vertex, a set of independent vertices, or all vertices at once.

    u vertices of the unit, F faces around them, V views.

    Attributes:
        position: level, sweep, unit and iteration of this step.
        next_position: where the run goes on; level = number of levels when it has finished.
        sweep_moment: the moment at which the sweep began (visibility, sigma and priors belong to it).
        vertices: (u,) int, ids.
        before, after: (u, 3) float, positions, world units.
        proposed: (u, 3) float, the Gauss-Newton step before any limit.
        step_px: (u,) float: longest displacement in a photo of the step tried, px.
        damping: (u,) float, Levenberg-Marquardt damping used.
        eigenvalues: (u, 3) float, of the normal matrix without priors, ascending, energy / world unit^2.
        reasons: (u,) int8 `StepReason`.
        objective_before, objective_after: energy plus priors of the unit, before and after what was tried.
        faces: (F,) int ids of the faces around the unit.
        face_energy_before, face_energy_after: (F,) float; after equals before where the step was rejected.
        view_energy_before, view_energy_after: (V,) float.
        damping_next, rejections: (u,): solver state for the next iteration.
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

    @property
    def accepted(self) -> bool:
        """Whether any vertex moved."""
        return bool((self.before != self.after).any())

    @property
    def is_manual(self) -> bool:
        """Whether a user made this step."""
        return len(self.reasons) > 0 and int(self.reasons[0]) in MANUAL_REASONS

    @property
    def is_preparing(self) -> bool:
        """Whether this step was done to the start, before the first level."""
        return len(self.reasons) > 0 and int(self.reasons[0]) in PREPARING

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
    """Header, start and steps of a run; optionally mirrored to a file.

    Attributes:
        header: JSON-able facts: options, scene, versions.
        start: (n, 3) float, vertices at moment 0.
        faces: (m, 3) int.
        steps: the records.
        manual_moments: the moments after steps that a user made.
    """

    def __init__(self, header: dict[str, Any], start: np.ndarray, faces: np.ndarray) -> None:
        self.header = header
        self.start = np.array(start, dtype=np.float64)
        self.faces = np.array(faces, dtype=np.int64)
        self.steps: list[StepRecord] = []
        self.manual_moments: list[int] = []
        self._keyframes: dict[int, np.ndarray] = {0: self.start}
        self._newest: tuple[int, np.ndarray] = (0, self.start.copy())
        self._file: BlockFile | None = None
        self._unwritten: Path | None = None  # the file that writing failed on

    def __len__(self) -> int:
        return len(self.steps)

    def append(self, record: StepRecord) -> None:
        """Add a step, and write it to the file if one is attached.

        Raises:
            InputError: the disk is full. The step is kept in memory; the next call tries to write all of them.
        """
        self._index(record)
        if self._unwritten is not None:
            self.attach(self._unwritten)
        elif self._file is not None:
            with self._giving_up_file():
                self._file.append(_pack_record(record))

    def vertices_at(self, moment: int) -> np.ndarray:
        """(n, 3) float: positions at a moment, a copy.

        Raises:
            IndexError: there is no such moment.
        """
        if not 0 <= moment <= len(self.steps):
            raise IndexError(f"moment {moment}: this trace has moments 0 to {len(self.steps)}")
        if moment == self._newest[0]:
            return self._newest[1].copy()
        key = moment - moment % KEYFRAME_EVERY
        vertices = self._keyframes[key].copy()
        for record in self.steps[key:moment]:
            vertices[record.vertices] = record.after
        return vertices

    @property
    def preparations(self) -> list[StepReason]:
        """What was done to the start before the first level, a step each."""
        return [StepReason(step.reasons[0]) for step in itertools.takewhile(lambda step: step.is_preparing, self.steps)]

    def origin_at(self, moment: int) -> np.ndarray:
        """(n, 3) float: from where the engine moved each vertex: its (prepared) start, or where a hand had last put it."""
        origin = self.vertices_at(min(moment, len(self.preparations)))
        for made in self.manual_moments:
            if made <= moment:
                record = self.steps[made - 1]
                origin[record.vertices] = record.after
        return origin

    def attach(self, path: Path) -> None:
        """Write the trace to `path` (replacing what is there by renaming) and keep it up to date from now on."""
        if self._file is not None:
            self.detach()
        header = pack({"header": json.dumps(self.header)}, start=self.start, faces=self.faces)
        self._file = BlockFile(path, MAGIC, itertools.chain([header], map(_pack_record, self.steps)))
        self._unwritten = None

    def flush(self) -> None:
        """Make sure that what was appended survives a crash of the machine."""
        if self._unwritten is not None:
            self.attach(self._unwritten)
        if self._file is not None:
            with self._giving_up_file():
                self._file.flush()

    def detach(self) -> None:
        """Stop writing to the file."""
        self.flush()
        if self._file is not None:
            self._file.close()
            self._file = None

    @contextmanager
    def _giving_up_file(self) -> Iterator[None]:
        """A file that could not be written to is let go, to be written anew."""
        try:
            yield
        except InputError:
            assert self._file is not None
            self._unwritten, self._file = self._file.path, None
            raise

    def cut(self, moment: int) -> "Trace":
        """A new trace in memory with the steps before a moment."""
        branch = Trace(dict(self.header), self.start, self.faces)
        for record in self.steps[:moment]:
            branch._index(record)
        return branch

    def continue_at(self, position: SchedulePosition) -> None:
        """Let the run continue elsewhere after its last step than that step had planned."""
        assert self._file is None, "a trace on disk only grows"
        self.steps[-1] = replace(self.steps[-1], next_position=position)

    @classmethod
    def load(cls, path: Path) -> "Trace":
        """Read a trace file; steps cut short at its end are dropped.

        Raises:
            InputError: the file is missing or no trace.
        """
        blocks = read_blocks(path, MAGIC, "trace")
        texts, arrays = unpack(blocks[0])
        trace = cls(json.loads(texts["header"]), arrays["start"], arrays["faces"])
        for block in blocks[1:]:
            trace._index(_unpack_record(block))
        return trace

    def _index(self, record: StepRecord) -> None:
        self.steps.append(record)
        vertices = record.applied_to(self._newest[1])  # a copy: another thread may be reading the present ones
        self._newest = (len(self.steps), vertices)
        if record.is_manual:
            self.manual_moments.append(len(self.steps))
        if len(self.steps) % KEYFRAME_EVERY == 0:
            self._keyframes[len(self.steps)] = vertices.copy()


def _pack_record(record: StepRecord) -> bytes:
    return pack({}, **{field.name: np.asarray(getattr(record, field.name)) for field in fields(StepRecord)})


def _unpack_record(block: bytes) -> StepRecord:
    _, values = unpack(block)
    return StepRecord(
        **{
            **values,
            "position": SchedulePosition(*values["position"].tolist()),
            "next_position": SchedulePosition(*values["next_position"].tolist()),
            "sweep_moment": int(values["sweep_moment"]),
            "objective_before": float(values["objective_before"]),
            "objective_after": float(values["objective_after"]),
        }
    )

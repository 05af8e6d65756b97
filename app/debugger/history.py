"""History: energies and vertex paths over the record, collected once for all pages. Each reads new steps only."""

from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from app.debugger.run_state import RunState
from app.debugger.step_text import slot_of
from app.plot_line import Line, intervals
from fairing.run.recorded_stages import RecordedStage, stage_keys
from fairing.stage_kind import StageKind
from fairing.trace import StepReason, StepRecord, Trace


class Recorded(Protocol):
    """A record that may grow: of a state, or of one run of a state."""

    @property
    def run_id(self) -> int: ...
    @property
    def trace(self) -> Trace: ...
    @property
    def length(self) -> int: ...


REJECTIONS = [StepReason.REJECTED_ENERGY, StepReason.REJECTED_FOLD]
# Line segments that a page draws smoothly without a graphics card (ledger: path segments).
PATH_SEGMENTS = 6000


class EnergyCurves(NamedTuple):
    """Of all steps read so far: energies, levels, moments at which their sweeps began and numbers of the sweeps, kinds and
    numbers of their stages, and whether their energies stand for themselves, see `EnergyHistory`."""

    before: np.ndarray
    after: np.ndarray
    levels: np.ndarray
    sweeps: np.ndarray
    sweep_numbers: np.ndarray
    kinds: np.ndarray
    stages: np.ndarray
    stands_alone: np.ndarray


def _no_curves() -> EnergyCurves:
    none = np.zeros(0, dtype=int)
    return EnergyCurves(np.zeros(0), np.zeros(0), none, none, none, none, none, none.astype(bool))


class StageProgress(NamedTuple):
    """Where a step is in its stage.

    Attributes:
        stage: up to the end of the record.
        sweep: number of the step's sweep within the stage, from 1.
        n_sweeps: of the whole stage; None while it may get more.
    """

    stage: RecordedStage
    sweep: int
    n_sweeps: int | None


class EnergyHistory:
    """The energy of the whole mesh after every step.

    A step records the energy of the faces around its unit; all other faces keep their last recorded energy. Before its
    first recorded energy, a face is counted with that energy. Energies of different sweeps are not comparable, because
    each sweep has its own cells. Fits use no photos; if photos judge them, by other cells than those of the sweeps: such
    energies stand for themselves. They are NaN where a fit or a judge read no photo.
    """

    def __init__(self, n_faces: int) -> None:
        self._n_faces = n_faces
        self.curves = _no_curves()
        """What has been read, replaced as a whole."""
        self._clear()

    def _clear(self) -> None:
        self._run_id = -1
        self._faces = np.full(self._n_faces, np.nan)
        self.curves = _no_curves()

    def update(self, state: Recorded) -> None:
        """Read the new steps."""
        if state.run_id != self._run_id:
            self._clear()
            self._run_id = state.run_id
        known = len(self.curves.after)
        new = state.length - known
        if new <= 0:
            return
        curves = EnergyCurves(*(np.concatenate([old, np.zeros(new, old.dtype)]) for old in self.curves))
        key_of = stage_keys(state.trace)
        last = state.trace.steps[known - 1] if known else None
        for k, record in enumerate(state.trace.steps[known : state.length], start=known):
            if last is not None:
                is_next = key_of(last.stage, last.position) != key_of(record.stage, record.position)
                curves.stages[k] = curves.stages[k - 1] + is_next
            last = record
            curves.levels[k], curves.sweeps[k] = record.position.level, record.sweep_moment
            curves.sweep_numbers[k], curves.kinds[k] = record.position.sweep, record.stage
            is_in_sweep = k > 0 and record.sweep_moment == curves.sweeps[k - 1] and not curves.stands_alone[k - 1]
            is_judge = record.stage is StageKind.JUDGE
            curves.stands_alone[k] = _is_any_fit(record) or (is_judge and not is_in_sweep)
            if curves.stands_alone[k]:
                measured = len(record.faces) > 0
                curves.before[k] = record.energy_before if measured else np.nan
                curves.after[k] = record.energy_after if measured else np.nan
                continue
            unknown = np.isnan(self._faces[record.faces])
            if unknown.any():
                earlier = np.flatnonzero(~curves.stands_alone[:k])
                late = float(record.face_energy_before[unknown].sum())
                curves.before[earlier] += late
                curves.after[earlier] += late
            self._faces[record.faces] = record.face_energy_before
            curves.before[k] = np.nansum(self._faces)
            self._faces[record.faces] = record.face_energy_after
            curves.after[k] = np.nansum(self._faces)
        self.curves = curves

    def lines(self, length: int) -> list[Line]:
        """The energies of each sweep within the first `length` steps; none where no step measured any.

        Energies that stand for themselves can be several times as high as a sweep's: they have lines only until there is a
        sweep.
        """
        if not self.is_measured:
            return []
        curves = EnergyCurves(*(curve[:length] for curve in self.curves))
        sweeps, others = [], []
        for first, end in intervals(2 * curves.sweeps + curves.stands_alone):
            values = np.concatenate([curves.before[first : first + 1], curves.after[first:end]])
            if np.isfinite(values).all():
                (others if curves.stands_alone[first] else sweeps).append(Line(np.arange(first, end + 1), values))
        return sweeps or others

    def stages(self, length: int) -> list[RecordedStage]:
        """The stages of the first `length` steps, in their order."""
        kinds, levels = self.curves.kinds, self.curves.levels
        return [
            RecordedStage(StageKind(int(kinds[begin])), int(levels[begin]), begin, end)
            for begin, end in intervals(self.curves.stages[:length])
        ]

    def stage_progress(self, step: int, length: int) -> StageProgress:
        """Where a step is in its stage.

        Args:
            step: its index, below `length`.
            length: number of recorded steps.
        """
        stage = next(stage for stage in self.stages(length) if step < stage.end)
        numbers = self.curves.sweep_numbers[stage.begin : stage.end]
        changes = np.cumsum(np.diff(numbers, prepend=numbers[:1]) != 0)
        is_over = stage.end < length
        return StageProgress(stage, int(changes[step - stage.begin]) + 1, int(changes[-1]) + 1 if is_over else None)

    @property
    def is_measured(self) -> bool:
        """Whether a step has measured an energy; a step that concerns no face counts as 0 until one has."""
        return bool(np.nan_to_num(self.curves.after).any())

    @property
    def after(self) -> np.ndarray:
        """(steps,) float: energy after each step."""
        return self.curves.after

    @property
    def before(self) -> np.ndarray:
        """(steps,) float: energy before each step, under the cells of its sweep."""
        return self.curves.before

    @property
    def levels(self) -> np.ndarray:
        """(steps,) int: level of each step."""
        return self.curves.levels

    @property
    def sweeps(self) -> np.ndarray:
        """(steps,) int: the moment at which the sweep of each step began."""
        return self.curves.sweeps


def _is_any_fit(record: StepRecord) -> bool:
    """Whether a step fits the mesh by something else than the photos, in whichever way its version recorded it."""
    return record.stage.is_fit or record.stage is StageKind.FIT


@dataclass
class PathHistory:
    """Positions of all vertices at moments spread over the record, few enough to draw.

    Whenever there are too many moments, every second one is dropped and the distance between them doubles.
    """

    n_vertices: int
    _run_id: int = -1
    _stride: int = 1
    _known: int = 0
    _positions: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    _samples: list[tuple[int, np.ndarray]] = field(default_factory=list)

    def update(self, state: RunState) -> None:
        """Read the new steps."""
        if state.run_id != self._run_id:
            self._run_id, self._stride, self._known = state.run_id, 1, 0
            self._positions = state.trace.start.copy()
            self._samples = [(0, state.trace.start)]
        limit = max(4, 2 * PATH_SEGMENTS // self.n_vertices)
        for moment in range(self._known + 1, state.length + 1):
            record = state.trace.steps[moment - 1]
            self._positions[record.vertices] = record.after
            if moment % self._stride == 0:
                self._samples.append((moment, self._positions.copy()))
            if len(self._samples) > limit:
                self._stride *= 2
                self._samples = [sample for sample in self._samples if sample[0] % self._stride == 0]
        self._known = max(self._known, state.length)

    def segments(self, state: RunState) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Path segments up to the present moment.

        Where there are too many, only the vertices with the longest paths are included.

        Returns:
            Segments (s, 2, 3), world units; the time of their ends (s, 2), from 0 at the start to 1 now; vertex ids (s,).
        """
        moments = [moment for moment, _ in self._samples if moment < state.moment]
        positions = [position for moment, position in self._samples if moment < state.moment]
        if not positions:
            return np.zeros((0, 2, 3)), np.zeros((0, 2)), np.zeros(0, dtype=int)
        at = np.array([*moments, state.moment]) / max(1, state.moment)
        points = np.stack([*positions, state.vertices])
        pieces = np.stack([points[:-1], points[1:]], axis=2)  # (k, n, 2, 3)
        moved = (pieces[:, :, 0] != pieces[:, :, 1]).any(axis=-1)
        if moved.sum() > PATH_SEGMENTS:
            length = np.linalg.norm(pieces[:, :, 1] - pieces[:, :, 0], axis=-1).sum(axis=0)
            longest_first = np.argsort(-length, kind="stable")
            is_kept = np.zeros(len(length), dtype=bool)
            is_kept[longest_first] = np.cumsum(moved.sum(axis=0)[longest_first]) <= PATH_SEGMENTS
            moved &= is_kept
        when = np.broadcast_to(np.stack([at[:-1], at[1:]], axis=1)[:, None], (*pieces.shape[:2], 2))
        return pieces[moved], when[moved], np.nonzero(moved)[1]


def last_step_about(steps: list[StepRecord], moment: int, vertex: int) -> tuple[int, StepRecord, int] | None:
    """The last step up to a moment that includes a vertex: the moment after it, the record, the vertex's index in it."""
    for led_to in range(moment, 0, -1):
        record = steps[led_to - 1]
        slot = slot_of(record, vertex)
        if slot is not None:
            return led_to, record, slot
    return None


def next_move(state: RunState, vertex: int, direction: int) -> int | None:
    """The moment after the next recorded step that moved a vertex, forward (1) or backward (-1); None if there is none."""
    moments = range(state.moment + 1, state.length + 1) if direction > 0 else range(state.moment - 1, 0, -1)
    for moment in moments:
        record = state.trace.steps[moment - 1]
        slot = slot_of(record, vertex)
        if slot is not None and (record.before[slot] != record.after[slot]).any():
            return moment
    return None

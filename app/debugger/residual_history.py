"""Residual history: the comparable residual of all runs at the moments where it is known, measured in the background."""

import os
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from app.background_worker import BackgroundWorker
from app.debugger.compare import RunEnergies
from app.debugger.history import Recorded
from app.debugger.run_state import Activity, RunState
from app.debugger.runs import RunInfo
from app.plot_line import Line
from fairing.errors import Cancelled, InputError
from fairing.judge.comparable_residual import ComparableResidual, MeasuredResidual
from fairing.run.session import Session
from fairing.trace import Trace

REFINED = 100
"""Moments of a run that are measured while it is paused, besides the ends of its stages."""
REST_SECONDS = 0.4
"""The engine rests so long before something is measured that no running stage waits for."""
POLL = 0.05  # s
NICENESS = 10  # of the thread that measures, see nice(2)


class _Job(NamedTuple):
    """A moment to measure; `during_run`: also while a run goes on."""

    run: Recorded
    moment: int
    during_run: bool


@dataclass(frozen=True, eq=False)
class KnownResiduals:
    """The residuals of a run.

    Attributes:
        by_moment: ascending moments.
        why_not: why none can be measured, a line; empty if they can.
    """

    by_moment: dict[int, MeasuredResidual]
    why_not: str = ""

    def line(self, faces: np.ndarray | None = None) -> Line:
        """The known moments and the residual there, grey levels; over some faces (F,) int, or all."""
        values = [each.mean if faces is None else each.of_faces(faces) for each in self.by_moment.values()]
        known = np.isfinite(values)
        return Line(np.array(list(self.by_moment), dtype=int)[known], np.array(values, dtype=float)[known])

    def up_to(self, moment: int) -> tuple[int, float] | None:
        """The last known moment up to this one and the residual there, grey levels; None if there is none."""
        found = [known for known in self.by_moment if known <= moment]
        return (found[-1], self.by_moment[found[-1]].mean) if found else None


class ResidualHistory:
    """Measures on one thread of its own, without a lock: the ends of stages at once, the present moment and both ends of other
    runs while the engine is paused, and then the moments between them, always in the middle of the largest gap.

    Args:
        session: scene, cameras and start, which all runs share.
        energies: of all runs; they know the stages.
        activity: what the engine does at present.
        wait: blocks until the kernels are compiled; called with a function that returns whether to give up, then it raises
            `Cancelled`.
        on_new: called on the worker's thread after each measurement.
    """

    def __init__(
        self,
        session: Session,
        energies: RunEnergies,
        activity: Callable[[], Activity],
        wait: Callable[[Callable[[], bool]], None] = lambda cancelled: None,
        on_new: Callable[[], None] = lambda: None,
    ) -> None:
        self._energies, self._activity, self._wait = energies, activity, wait
        self._measure = ComparableResidual(session, self._is_cancelled, threads=1)
        self._known: dict[int, dict[int, MeasuredResidual]] = {}
        self._problem = ""
        self._job: _Job | None = None
        self._state: RunState | None = None
        self._is_closing = False
        self._lock = threading.Lock()
        self._on_new = on_new
        self._worker = BackgroundWorker(name="residual")

    def follow(self, state: RunState) -> None:
        """Measure what this state needs next, unless something is being measured. Returns at once."""
        with self._lock:
            self._state = state
            if self._job is not None or self._is_closing or self._problem:
                return
            self._job = next(self._wanted(state), None)
            if self._job is None:
                return
            job = self._job
        self._worker.post("residual", lambda: self._measured(job), lambda result: self._store(job, result))

    def of(self, run: Recorded) -> KnownResiduals:
        """What is known of the first `run.length` steps of a run."""
        with self._lock:
            known = self._known.get(run.run_id, {})
            return KnownResiduals({m: known[m] for m in sorted(known) if m <= run.length}, self._problem)

    def count(self, run_id: int) -> int:
        """Number of known moments of a run."""
        return len(self._known.get(run_id, ()))

    def keep(self, run_ids: Collection[int]) -> None:
        """Forget all other runs."""
        with self._lock:
            self._known = {run_id: known for run_id, known in self._known.items() if run_id in run_ids}

    def close(self) -> None:
        """End the thread."""
        self._is_closing = True
        self._worker.close()

    def _wanted(self, state: RunState) -> Iterator[_Job]:
        """What is missing, the most urgent first."""
        current = next(run for run in state.runs if run.run_id == state.run_id)
        known = self._known_of(current)
        ends = [0, *(stage.end for stage in self._energies.of(state).stages(state.length))]
        if state.is_working and not state.finished:
            ends = ends[:1] if len(ends) < 3 else ends[:-1]
        is_paused = state.activity is Activity.PAUSED
        if is_paused:
            yield from (_Job(state, m, False) for m in (state.moment, 0) if m not in known)
        yield from (_Job(state, m, True) for m in ends if m not in known)
        if not is_paused:
            return
        for run in state.runs:
            yield from (_Job(run, m, False) for m in (run.length, 0) if m not in self._known_of(run))
        for run in (current, *(run for run in state.runs if run is not current)):
            if (moment := _middle_of_largest_gap(self._known_of(run), run.length)) is not None:
                yield _Job(run, moment, False)

    def _known_of(self, run: RunInfo) -> dict[int, MeasuredResidual]:
        """What is known of a run; at first what is known of the run from which it was branched."""
        if run.run_id not in self._known:
            of_parent = {} if run.parent is None else self._known.get(run.parent, {})
            self._known[run.run_id] = {m: found for m, found in of_parent.items() if m <= run.forked_at}
        return self._known[run.run_id]

    def _measured(self, job: _Job) -> MeasuredResidual:
        _give_way()
        self._wait(self._is_cancelled)
        rest = time.monotonic() + (0 if job.during_run else REST_SECONDS)
        while time.monotonic() < rest:
            if self._is_cancelled():
                raise Cancelled
            time.sleep(POLL)
        trace: Trace = job.run.trace
        return self._measure.measure(trace.vertices_at(job.moment))

    def _is_cancelled(self) -> bool:
        """Commands go first: what they take must not depend on what is measured."""
        activity, job = self._activity(), self._job
        is_allowed = activity is Activity.PAUSED or (
            activity is Activity.RUNNING and job is not None and job.during_run
        )
        if is_allowed and activity is Activity.RUNNING:
            time.sleep(POLL)  # leaves the processor to the run and to what its pages draw
        return self._is_closing or not is_allowed

    def _store(self, job: _Job, result: MeasuredResidual | Exception) -> None:
        with self._lock:
            self._job = None
            state = self._state
            if isinstance(result, MeasuredResidual):
                self._known.setdefault(job.run.run_id, {})[job.moment] = result
            elif isinstance(result, InputError):
                self._problem = str(result)
            elif not isinstance(result, Cancelled):
                self._problem = f"{type(result).__name__}: {result}"
        if not isinstance(result, Cancelled):
            self._on_new()
        elif self._is_cancelled():
            return  # the state after the command that goes first brings the job back
        if state is not None:
            self.follow(state)


def _give_way() -> None:
    """Let other threads go first where the processor is busy; threads that this one starts give way, too."""
    if sys.platform == "linux":  # elsewhere threads have no priority of their own
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)


def _middle_of_largest_gap(known: Collection[int], length: int) -> int | None:
    """The next moment to measure between those known; None if no gap is left or `REFINED` moments are known."""
    moments = np.array(sorted(known))
    gaps = np.diff(moments)
    if len(moments) >= min(REFINED, length + 1) or len(gaps) == 0 or gaps.max() < 2:
        return None
    widest = int(gaps.argmax())
    return int(moments[widest] + gaps[widest] // 2)

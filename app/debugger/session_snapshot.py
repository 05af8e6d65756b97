"""Session snapshot: what a session reports at one moment, read so that no failing property stops the engine thread."""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np

from fairing.errors import Cancelled
from fairing.options import FairingOptions
from fairing.run.session import Session
from fairing.stage_kind import StageKind
from fairing.trace import SchedulePosition, Trace

T = TypeVar("T")
OnFailure = Callable[[str, Exception], None]


class SessionSnapshot(NamedTuple):
    """Fields of `RunState` that are read from the session; see there."""

    trace: Trace
    moment: int
    length: int
    vertices: np.ndarray
    locked: np.ndarray
    position: SchedulePosition
    options: FairingOptions
    finished: bool
    progress: float
    next_stage: StageKind | None


def snapshot_of(session: Session, on_failure: OnFailure) -> SessionSnapshot:
    """Read a session. A property that raises is replaced by what trace and options alone give.

    Args:
        on_failure: called with the property's name and the exception; not called for a cancellation.
    """
    trace, length = session.trace, len(session.trace)
    moment = min(session.moment, length)
    position = _read("position", lambda: session.position, lambda: recorded_position(trace, moment), on_failure)
    n_levels = session.options.n_levels
    is_finished = position.level >= n_levels
    n_vertices = len(trace.start)
    return SessionSnapshot(
        trace=trace,
        moment=moment,
        length=length,
        vertices=trace.vertices_at(moment),
        locked=_read("locked", lambda: session.locked, lambda: np.zeros(n_vertices, dtype=bool), on_failure),
        position=position,
        options=session.options,
        finished=is_finished,
        progress=_read("progress", lambda: session.progress, lambda: min(1.0, position.level / n_levels), on_failure),
        next_stage=_read("next_stage", lambda: session.next_stage, lambda: None, on_failure),
    )


def recorded_position(trace: Trace, moment: int) -> SchedulePosition:
    """Where the step after a moment belongs, by the record alone; at moment 0 the first position."""
    return trace.steps[moment - 1].next_position if moment else SchedulePosition(0, 0, 0, 0)


def _read(name: str, read: Callable[[], T], fallback: Callable[[], T], on_failure: OnFailure) -> T:
    try:
        return read()
    except Cancelled:
        return fallback()
    except Exception as error:
        on_failure(name, error)
        return fallback()

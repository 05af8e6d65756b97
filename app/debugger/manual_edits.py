"""What becomes of the runs when a user moves or locks vertices by hand."""

from collections.abc import Callable

import numpy as np

from app.debugger.runs import Runs
from fairing.errors import InputError
from fairing.run.manual_edits import with_locks
from fairing.run.session import Session
from fairing.trace import StepReason, StepRecord

NAMED = 3  # vertices in a sentence; more are counted
Keep = Callable[[Session, int, str], int]


def step_by_hand(
    session: Session, vertices: tuple[int, ...], act: Callable[[Session, np.ndarray], StepRecord], keep: Keep
) -> str:
    """A step by hand at the end of the record; at a past moment, in a run of its own. Returns what happened.

    Args:
        act: makes the step for the vertices (u,).
        keep: takes a new run to hand, that forked at a moment and has a title.

    Raises:
        InputError: the step is not possible; nothing has changed.
    """
    moment = session.moment
    is_past = moment < len(session.trace)
    acting = session.branch() if is_past else session
    record = act(acting, np.array(vertices))
    done = f"{named(vertices)} {StepReason(int(record.reasons[0])).text}"
    if is_past:
        keep(acting, moment, done)
    return f"{done}; goes on from here"


def lock_by_hand(runs: Runs, vertices: tuple[int, ...], locked: bool, keep: Keep) -> str:
    """Lock or unlock from the present moment on: at the end the same run goes on, at a past moment they fork one.

    Raises:
        InputError: a vertex cannot be unlocked; nothing has changed.
    """
    session, ids = runs.session, np.array(vertices)
    branch = session.branch(with_locks(session.options, session.scene, ids, locked))
    held = ids[branch.locked[ids]]
    if not locked and len(held):
        raise InputError(
            f"vertex {held[0]}: stays locked; it is held by an option (lock boundary, locked boxes, region) or on a face "
            "without area"
        )
    done = f"{named(vertices)} {'locked' if locked else 'unlocked'}"
    if session.moment < len(session.trace):
        keep(branch, session.moment, done)
    else:
        runs.replace(branch)
    return f"{done}; the run is finished, so nothing moves" if branch.finished else done


def named(vertices: tuple[int, ...]) -> str:
    """A few vertices by their numbers, many by their count."""
    if len(vertices) == 1:
        return f"vertex {vertices[0]}"
    if len(vertices) <= NAMED:
        return f"vertices {', '.join(map(str, vertices))}"
    return f"{len(vertices)} vertices"

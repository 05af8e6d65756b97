"""Manual edits: moving, resetting and locking vertices, which branches a new run at a past moment."""

from collections.abc import Callable

import numpy as np

from app.debugger.runs import Runs
from fairing.errors import InputError
from fairing.run.manual_edits import with_locks
from fairing.run.session import Session
from fairing.trace import StepReason, StepRecord

MAX_NAMED = 3  # vertices listed by number in a sentence; more are counted
AddRun = Callable[[Session, int, str], int]
"""Switches to a new run, given its session, the moment of the fork and its title; returns its id."""


def check_vertices(session: Session, vertices: tuple[int, ...]) -> np.ndarray:
    """The ids as an array (u,) int.

    Raises:
        InputError: there are none, or the mesh has no such vertex.
    """
    n_vertices = len(session.trace.start)
    if not vertices:
        raise InputError("vertices: expected at least one; select some first")
    wrong = [vertex for vertex in vertices if not 0 <= vertex < n_vertices]
    if wrong:
        raise InputError(f"vertex {wrong[0]}: expected a number from 0 to {n_vertices - 1}")
    return np.array(vertices, dtype=int)


def check_positions(ids: np.ndarray, positions: tuple[tuple[float, float, float], ...]) -> np.ndarray:
    """The positions of the vertices (u,) as an array (u, 3) float, world units.

    Raises:
        InputError: there are more or fewer of them than vertices, or one is not finite.
    """
    if len(positions) != len(ids):
        raise InputError(f"vertices: expected {len(ids)} positions, one each, found {len(positions)}")
    places = np.array(positions, dtype=float).reshape(-1, 3)
    infinite = ids[~np.isfinite(places).all(axis=1)]
    if len(infinite):
        raise InputError(f"vertex {infinite[0]}: expected a finite position")
    return places


def step_manually(session: Session, ids: np.ndarray, act: Callable[[Session], StepRecord], add: AddRun) -> str:
    """Make a manual step at the end of the record, or in a new run at a past moment; returns what was done.

    Args:
        ids: (u,) int, the vertices.
        act: makes the step.

    Raises:
        InputError: the step is not possible; nothing has changed.
    """
    moment = session.moment
    is_past = moment < len(session.trace)
    acting = session.branch() if is_past else session
    if is_past:
        acting.cancel_requested = session.cancel_requested
    record = act(acting)
    done = f"{vertex_list(ids)} {StepReason(int(record.reasons[0])).text}"
    if is_past:
        add(acting, moment, done)
    return f"{done}; the run continues from here"


def lock_manually(runs: Runs, ids: np.ndarray, locked: bool, add: AddRun) -> str:
    """Lock or unlock vertices (u,) from the present moment on; returns what was done.

    At the end of the record the same run continues, at a past moment a new one.

    Raises:
        InputError: a vertex cannot be unlocked; nothing has changed.
    """
    session = runs.session
    branch = session.branch(with_locks(session.options, session.scene, ids, locked))
    held = ids[branch.locked[ids]]
    if not locked and len(held):
        raise InputError(f"vertex {held[0]}: stays locked; an option (lock boundary, locked boxes, region) locks it")
    done = f"{vertex_list(ids)} {'locked' if locked else 'unlocked'}"
    if session.moment < len(session.trace):
        add(branch, session.moment, done)
    else:
        runs.replace(branch)
    return f"{done}; the run is finished, no vertex will move" if branch.finished else done


def vertex_list(ids: np.ndarray) -> str:
    """Vertices (u,) by their numbers, or their count if there are many."""
    if len(ids) == 1:
        return f"vertex {ids[0]}"
    if len(ids) <= MAX_NAMED:
        return f"vertices {', '.join(map(str, ids))}"
    return f"{len(ids)} vertices"

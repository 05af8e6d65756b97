"""Quantities on the mesh, one per face or per vertex, at any recorded moment.

All are NaN where undefined. Lengths are in percent of the diagonal of the scene's start mesh.
"""

import numpy as np

from fairing.geometry.closest_point import SurfaceTree
from fairing.judge.metrics import determined_part, energy_summary
from fairing.run.session import Session
from fairing.trace import Trace


def face_energy(session: Session, moment: int) -> np.ndarray:
    """(m,) float: E of Eq. 2 by face, under the visibility and robust scale of the moment's sweep."""
    takes_part = session.sweep_state(moment).context.takes_part
    return np.where(takes_part, energy_summary(session, moment).by_face, np.nan)


def view_count(session: Session, moment: int) -> np.ndarray:
    """(m,) float: photos that take part in each face; 0 where too few see it."""
    context = session.sweep_state(moment).context
    return np.where(context.takes_part, context.n_views, 0).astype(np.float64)


def displacement(session: Session, moment: int) -> np.ndarray:
    """(n,) float: distance of each vertex from its position at the start of the run, percent of the diagonal."""
    moved = session.trace.vertices_at(moment) - session.trace.start
    return 100 * np.linalg.norm(moved, axis=1) / session.scene.mesh.diagonal


def distance_to_truth(session: Session, moment: int) -> np.ndarray:
    """(n,) float: distance of each vertex to the truth, percent of the diagonal; NaN without a known truth.

    If the scene has true vertex positions, the distance to these without the component that slides within the surface; else
    the distance to the true surface.
    """
    scene, vertices = session.scene, session.trace.vertices_at(moment)
    if scene.truth is None:
        return np.full(len(vertices), np.nan)
    if scene.truth.vertices is None:
        distance = SurfaceTree(scene.truth.surface).distance(vertices)
    else:
        distance = np.linalg.norm(determined_part(scene, vertices - scene.truth.vertices), axis=1)
    return 100 * distance / scene.mesh.diagonal


def determinacy(session: Session, moment: int) -> np.ndarray:
    """(n,) float, 0 to 1: weakest over strongest eigenvalue of each vertex's normal matrix, from its last step.

    Near 0 the photos leave a direction undetermined (aperture problem); near 1 they determine all directions equally.
    """
    result = np.full(len(session.trace.start), np.nan)
    for slots, record in _last_steps(session.trace, moment, needs_eigenvalues=True):
        values = record.eigenvalues[slots]
        result[record.vertices[slots]] = np.clip(values[:, 0], 0, None) / values[:, 2]
    return result


def last_reason(session: Session, moment: int) -> np.ndarray:
    """(n,) float: the `StepReason` of each vertex's last step; NaN before its first."""
    result = np.full(len(session.trace.start), np.nan)
    for slots, record in _last_steps(session.trace, moment, needs_eigenvalues=False):
        result[record.vertices[slots]] = record.reasons[slots]
    return result


def _last_steps(trace: Trace, moment: int, needs_eigenvalues: bool):
    """Records from a moment backwards, each with the slots of the vertices that have no later record."""
    open_vertices = np.ones(len(trace.start), dtype=bool)
    for record in reversed(trace.steps[:moment]):
        slots = open_vertices[record.vertices]
        if needs_eigenvalues:
            slots &= record.eigenvalues[:, 2] > 0
        slots = np.flatnonzero(slots)
        if len(slots):
            open_vertices[record.vertices[slots]] = False
            yield slots, record
        if not open_vertices.any():
            return

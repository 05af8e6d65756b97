"""Energy profile: the energy of the faces around a vertex while it alone is moved along x, y or z."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fairing.errors import Cancelled
from fairing.run.session import Session
from fairing.solve.energy import Evaluator

POSITIONS = 21  # along each axis
REACH = 0.2  # of the shortest edge at the vertex: how far it is moved


@dataclass(frozen=True, eq=False)
class EnergyProfile:
    """Energies by offset.

    Attributes:
        offsets: (POSITIONS,) float: of the vertex along an axis, world units; 0 is in the middle.
        lines: (3, POSITIONS) float: sum of the photos' energies of its faces, for each axis.
    """

    offsets: np.ndarray
    lines: np.ndarray


def energy_profile(
    session: Session, vertex: int, moment: int, reach: float, is_wanted: Callable[[], bool] = lambda: True
) -> EnergyProfile | None:
    """The energy profile of a vertex at a moment, with the cells and robust scales of that moment.

    Args:
        reach: the largest offset, world units.
        is_wanted: asked before each energy; where it returns False, the computation ends.

    Returns:
        None if no face around the vertex is used, or if the profile is not wanted any more.

    Raises:
        Cancelled: the session's `cancel_requested` returned True.
    """
    sweep = session.sweep_state(moment)
    faces = np.asarray(session.scene.mesh.one_rings[vertex])
    faces = faces[sweep.context.takes_part[faces]]
    if len(faces) == 0:
        return None
    vertices, offsets = session.trace.vertices_at(moment), np.linspace(-reach, reach, POSITIONS)
    ends = vertices[vertex] + np.concatenate([-reach * np.eye(3), reach * np.eye(3)])
    context, evaluator = session.context_for_moves(vertex, moment, ends), Evaluator(session.options.threads)
    lines = np.zeros((3, POSITIONS))
    for axis, k in np.ndindex(lines.shape):
        if session.cancel_requested():
            raise Cancelled
        if not is_wanted():
            return None
        moved = vertices.copy()
        moved[vertex, axis] += offsets[k]
        lines[axis, k] = evaluator.energies(context, moved, faces, sweep.scale).energy.sum()
    return EnergyProfile(offsets, lines)


def reach_at(vertices: np.ndarray, faces: np.ndarray, vertex: int) -> float:
    """How far a vertex is moved, world units.

    Args:
        vertices: (n, 3) float: positions, world units.
        faces: (F, 3) int: the faces around the vertex.
    """
    neighbours = np.setdiff1d(faces, [vertex])
    return REACH * float(np.linalg.norm(vertices[neighbours] - vertices[vertex], axis=1).min(initial=np.inf))

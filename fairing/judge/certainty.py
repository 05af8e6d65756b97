"""Certainty of vertices: how well the photos determine a position, as an ellipsoid from the normal matrix.

The ellipsoid is long in directions that the aperture problem leaves open (within a plane, along an edge).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fairing.run.session import Session
from fairing.solve.energy import loss_of_faces
from fairing.solve.normal_equations import vertex_systems

NO_INFORMATION = 1e-9  # eigenvalues below this fraction of the largest count as zero


@dataclass(frozen=True, eq=False)
class Certainty:
    """Certainty of one vertex at one moment, all other vertices fixed, from the photos alone (without priors).

    Attributes:
        vertex: id.
        normal_matrix: (3, 3) float, energy / world unit^2: H of the one-ring.
        noise: variance of the photos' noise in units of the energy, estimated from the residual of the eigenspace.
    """

    vertex: int
    normal_matrix: np.ndarray
    noise: float

    @cached_property
    def _decomposed(self) -> tuple[np.ndarray, np.ndarray]:
        values, vectors = np.linalg.eigh(self.normal_matrix)
        return np.where(values > NO_INFORMATION * values[2], values, 0.0)[::-1], vectors.T[::-1]

    @property
    def is_seen(self) -> bool:
        """Whether the photos determine the vertex in any direction."""
        return bool(self._decomposed[0][0] > 0)

    @property
    def axes(self) -> np.ndarray:
        """(3, 3) float: unit vectors in rows, the best determined direction first."""
        return self._decomposed[1]

    @property
    def lengths(self) -> np.ndarray:
        """(3,) float: 1 / sqrt(eigenvalue) along the axes, relative to the first; infinite in undetermined directions."""
        values = self._decomposed[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(values > 0, np.sqrt(values[0] / values), np.inf)

    @property
    def deviations(self) -> np.ndarray:
        """(3,) float: standard deviations along the axes, world units; infinite in undetermined
        directions."""
        values = self._decomposed[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(values > 0, np.sqrt(self.noise / values), np.inf)


def certainties(session: Session, vertices: np.ndarray, moment: int | None = None) -> list[Certainty]:
    """Certainty of vertices at a moment, with the cells and sigma of the moment's sweep.

    The normal matrix is that of variable projection: with a fixed eigenspace a vertex within a plane would seem determined by
    its texture. Part of that remains, because oblique views show the texture less sharply: at the finest level the ellipsoid
    of a vertex in the middle of a plane is about three times as long within the plane as across it, not infinitely long.

    The noise of independent photo pixels is estimated from the loss of the faces around a vertex. With energy
    E = sum rho(e), rho(e) = e^2 / sigma^2 for small e, and loss s^2 / sigma^2 per pixel, the covariance s^2 (J^T J)^-1
    of a least squares estimate is 2 loss H^-1. A Gaussian blur of b px leaves one independent pixel in 4 pi b^2.

    Args:
        vertices: (u,) int, ids.
        moment: moment of the run; default: the present one.

    Raises:
        IndexError: no such moment.
    """
    moment = session.moment if moment is None else moment
    sweep, mesh = session.sweep_state(moment), session.scene.mesh
    faces = np.flatnonzero(np.isin(mesh.faces, vertices).any(axis=1))
    system = session.linearise_by_photos(faces, moment)
    H, _ = vertex_systems(mesh, system)
    loss, pixels = loss_of_faces(sweep.context, system)
    correlated = max(1.0, 4 * np.pi * session.options.levels[sweep.context.level].blur ** 2)
    found = []
    for vertex in vertices.tolist():
        around = (mesh.faces[faces] == vertex).any(axis=1)
        total = float(pixels[around].sum())
        noise = float((loss * pixels)[around].sum()) / total if total > 0 else 0.0
        found.append(Certainty(vertex, H[vertex], 2 * noise * correlated))
    return found

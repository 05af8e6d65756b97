"""Term of the sparse points: distances of points from the planes of the faces that their photos see, at a gate.

    sum_p rho_gate(n_f . (x_p - sum_i w_pi v_i)) / sigma_p^2

with the Geman-McClure loss, whose scale, the gate, narrows from stage to stage: wide gates find the surface among clutter, narrow
ones fit it. `n_f` is the normal of the face, `w` the barycentric weights of the point's foot on it; both are associations, found
anew at every gate. Beside it a Gaussian prior at the start holds what the points leave undetermined.
"""

import numpy as np

from fairing.mesh import Mesh
from fairing.optimize.loss import GemanMcClure
from fairing.optimize.rows import Anchor, Rows
from fairing.terms.names import POINTS, START
from fairing.terms.point_rays import FARTHEST, Assignment, PointRays, displacement

GATES = tuple(gate for gate in (2.0, 1.5, 1.0, 0.8, 0.6, 0.4, 0.3, 0.2, 0.15, 0.1) for _ in range(2))
"""Percent of the mesh's diagonal, of the sweeps of a fit; the second at a gate assigns the points anew. The last is also the
standard deviation of a point's distance from a flat face, beside the point's own.
(ledger: robust fit: last gate, robust fit: sigma of a point)"""
NEAR_GATES = GATES[8::2]
"""Of a fit that goes on from an earlier one: from 0.6 percent on, one sweep at each (ledger: surface sweep: cost)."""
PRIOR_SIGMA = 0.7
"""Percent of the diagonal: largest standard deviation of a vertex's coordinate in the start, see `PointFit`."""


class PointFit:
    """The fit of a start mesh to one set of points.

    Args:
        start: the mesh before the fit, to which its prior holds.
        rays: of the points.
        covariance: (p, 3, 3) float: of their positions, world units^2.

    Attributes:
        sigma: world units: standard deviation of the start's vertices, which the points measure (ledger: robust fit: measured
            prior).
    """

    def __init__(self, start: Mesh, rays: PointRays, covariance: np.ndarray) -> None:
        self._start, self._rays, self._covariance = start, rays, covariance
        self._unit = start.diagonal / 100
        measured = displacement(np.abs(self.assigned(start.vertices).distances))
        self.sigma = min(max(measured, GATES[-1] * self._unit), PRIOR_SIGMA * self._unit)

    def assigned(self, vertices: np.ndarray) -> Assignment:
        """The points that belong to the mesh with vertices (n, 3)."""
        return self._rays.assign(self._start.moved(vertices), FARTHEST * self._unit)

    def terms(self, vertices: np.ndarray, gate: float) -> tuple[Rows, Anchor]:
        """The points at a gate, percent of the diagonal, and the prior at the start; associations are those of vertices (n, 3)."""
        found = self.assigned(vertices)
        own = np.einsum("qi,qij,qj->q", found.normals, self._covariance[found.points], found.normals)
        points = Rows(
            POINTS,
            self._start.faces[found.faces],
            -found.weights[:, :, None] * found.normals[:, None, :],
            found.distances,
            vertices,
            1 / ((GATES[-1] * self._unit) ** 2 + own),
            GemanMcClure(gate * self._unit),
        )
        return points, Anchor.uniform(START, 1 / self.sigma**2, self._start.vertices)

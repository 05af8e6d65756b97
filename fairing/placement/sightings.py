"""Sightings: how many sparse points have the mesh where their own photos see them.

A ray goes from the camera of each photo that observes a point to the point. Where it meets the mesh at the point's depth, the
photo confirms the mesh there; where it meets the mesh elsewhere, it contradicts it; where it misses the mesh, it says
nothing, so that a mesh may be a part of the scene and points of ground and background do not count.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import trimesh

from fairing.camera import Camera
from fairing.mesh import Mesh
from fairing.placement.frames import IDENTITY, MeshFrame
from fairing.scene import SparsePoints

MOST_POINTS = 2000
"""Points that are examined by default."""
NEAR, CLOSE = 0.05, 0.02
"""Of the mesh's diagonal: largest distance along the ray from a point to a mesh that its photo confirms, of a rough start and of a
usual one."""
OF_DEPTH = 0.1
"""Of a point's depth: no larger distance confirms, however large the mesh is."""


class Support(NamedTuple):
    """What the points say about a mesh.

    Attributes:
        judged: number of points that have the mesh in their direction in at least half of their photos.
        near: of these, those with the mesh at their place in at least half of these photos, within `NEAR`.
        close: the same within `CLOSE`.
    """

    judged: int
    near: int
    close: int

    @property
    def missing(self) -> float:
        """Fraction of the judged points that have no mesh within `CLOSE`, 0 to 1."""
        return 1.0 - self.close / self.judged if self.judged else 1.0


class Sightings:
    """The rays of observed points, to be cast at one mesh in several frames.

    Args:
        mesh: in its own frame.
        points: world; those without observations take no part.
        cameras: of the views that the observations index.
        most_points: number of points that are examined; of more, an even subset.
    """

    def __init__(
        self, mesh: Mesh, points: SparsePoints, cameras: Sequence[Camera], most_points: int = MOST_POINTS
    ) -> None:
        point, view = points.observations.reshape(-1, 2).T
        ids = np.unique(point)
        chosen = ids[:: max(1, -(-len(ids) // most_points))]
        kept = np.isin(point, chosen)
        point, view = point[kept], view[kept]
        order = np.argsort(point, kind="stable")
        point, view = point[order], view[order]
        centers = np.array([camera.center for camera in cameras])
        self.count = len(chosen)
        self._point = np.searchsorted(chosen, point)
        self._of_point = np.bincount(self._point, minlength=self.count)
        self._origins, self._targets = centers[view], points.positions[point]
        # The ray caster computes in single precision, so it gets a mesh of unit size at the origin.
        used = mesh.vertices[np.unique(mesh.faces)]
        self.middle = (used.min(axis=0) + used.max(axis=0)) / 2
        self.diagonal = mesh.diagonal or 1.0
        corners = (mesh.vertices - self.middle) / self.diagonal
        self._corners = corners[mesh.faces]
        self._normals = np.cross(self._corners[:, 1] - self._corners[:, 0], self._corners[:, 2] - self._corners[:, 0])
        self._shape = trimesh.Trimesh(corners, mesh.faces, process=False)

    @property
    def targets(self) -> np.ndarray:
        """(o, 3) float, world units: the point of every ray."""
        return self._targets

    def support(self, frame: MeshFrame = IDENTITY) -> Support:
        """How many points confirm the mesh in a frame."""
        miss, reach = self.misses(frame)
        is_hit = np.isfinite(miss)
        near, close = (is_hit & (np.abs(miss) <= np.minimum(limit, reach)) for limit in (NEAR, CLOSE))
        hit, near, close = (np.bincount(self._point, rays, minlength=self.count) for rays in (is_hit, near, close))
        judged = 2 * hit >= np.maximum(self._of_point, 1)
        return Support(*(int((judged & is_so).sum()) for is_so in (judged, 2 * near >= hit, 2 * close >= hit)))

    def misses(self, frame: MeshFrame, step: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Distance from the point to the mesh along every `step`-th ray, and the largest that may confirm; of diagonals.

        Returns:
            (o,) float, negative where the mesh is in front of the point, NaN where the ray misses it; (o,) float.
        """
        origins, targets = (
            (frame.mesh_from_world(points[::step]) - self.middle) / self.diagonal
            for points in (self._origins, self._targets)
        )
        rays = targets - origins
        length = np.linalg.norm(rays, axis=1)
        directions = rays / np.maximum(length, 1e-300)[:, None]
        face = self._shape.ray.intersects_first(origins, directions)
        miss = np.full(len(rays), np.nan)
        hit = np.flatnonzero(face >= 0)
        normals, corner = self._normals[face[hit]], self._corners[face[hit], 0]
        slope = (directions[hit] * normals).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            miss[hit] = ((corner - origins[hit]) * normals).sum(axis=1) / slope - length[hit]
        return miss, OF_DEPTH * length

"""Rays of points: which face of a mesh each sparse point belongs to.

A point belongs to the face that its own photos see in its direction, found by rays from their cameras, and not to the nearest
face: points of ground and background belong to none.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from fairing.camera import Camera
from fairing.features.points import FeaturePoints
from fairing.geometry.normals import unit_normals
from fairing.geometry.triangles import barycentric
from fairing.mesh import Mesh

FARTHEST = 10.0
"""Percent of the diagonal: points farther from the face that their photos see belong to something else."""
DISPLACEMENT_QUANTILE, DISPLACEMENT_FACTOR = 0.9, 1.5
"""See `displacement`."""
RIM = 0.05
"""Barycentric: a point's foot may lie that far outside its face."""


@dataclass(frozen=True, eq=False)
class Assignment:
    """Points with the faces they belong to.

    Attributes:
        points: (q,) int: the points that belong to a face.
        faces: (q,) int.
        weights: (q, 3) float: barycentric coordinates of each point's foot on its face's plane.
        normals: (q, 3) float: unit normals of the faces.
        distances: (q,) float, world units: from the plane to the point, positive along the normal.
    """

    points: np.ndarray
    faces: np.ndarray
    weights: np.ndarray
    normals: np.ndarray
    distances: np.ndarray


def displacement(distances: np.ndarray) -> float:
    """How far the vertices of a mesh are from their true positions, by the distances (q,) of points from its faces.

    Most points lie inside faces, where the distance from the surface is less than that of the corners, and where the mesh is
    right they say nothing about the rest. Therefore it is a high quantile. (ledger: start error by points)
    """
    return DISPLACEMENT_FACTOR * float(np.quantile(distances, DISPLACEMENT_QUANTILE)) if len(distances) else 0.0


def distances_px(mesh: Mesh, cameras: Sequence[Camera], points: FeaturePoints) -> np.ndarray:
    """(q,) float, px: how far the photos show the points from the planes of their faces; of points that belong to one.

    The nearest of a point's photos counts, seen at a right angle: distance times focal length over depth.

    Args:
        cameras: of the photos that `points.photos` counts.
    """
    found = PointRays(cameras, points).assign(mesh, FARTHEST * mesh.diagonal / 100)
    focal, centers = (np.array(of_all) for of_all in zip(*((c.K[0, 0], c.center) for c in cameras), strict=True))
    point = np.repeat(np.arange(len(points)), points.n_views)
    depth = np.linalg.norm(points.positions[point] - centers[points.photos], axis=1)
    px_per_unit = np.zeros(len(points))
    np.maximum.at(px_per_unit, point, focal[points.photos] / depth)
    return np.abs(found.distances) * px_per_unit[found.points]


def points_on_surface(mesh: Mesh, cameras: Sequence[Camera], points: FeaturePoints) -> np.ndarray:
    """(p,) bool: the points that belong to a face: their own photos see it there, and it lies within a tenth of the diagonal."""
    result = np.zeros(len(points), dtype=bool)
    result[PointRays(cameras, points).assign(mesh, FARTHEST * mesh.diagonal / 100).points] = True
    return result


class PointRays:
    """The rays from the cameras of the photos that show the points."""

    def __init__(
        self, cameras: Sequence[Camera], points: FeaturePoints, check: Callable[[], None] = lambda: None
    ) -> None:
        self._check = check
        centers = np.array([camera.center for camera in cameras])
        self._positions, self._n_views = points.positions, points.n_views
        self._point = np.repeat(np.arange(len(points)), points.n_views)
        self._origins = centers[points.photos]
        self._directions = points.positions[self._point] - self._origins

    def assign(self, mesh: Mesh, reach: float) -> Assignment:
        """The points, each with the face that most of its photos, and at least half of them, see in its direction.

        Args:
            reach: largest distance of a point from the plane of its face, world units.
        """
        self._check()
        origin = _origin_of_rays(mesh)
        shape = trimesh.Trimesh(mesh.vertices - origin, mesh.faces, process=False)
        hit = shape.ray.intersects_first(self._origins - origin, self._directions)
        cast, hit = np.flatnonzero(hit >= 0), hit[hit >= 0]
        m = len(mesh.faces)
        candidates, votes = np.unique(self._point[cast] * m + hit, return_counts=True)
        point, face = candidates // m, candidates % m
        enough = 2 * votes >= self._n_views[point]
        point, face, votes = point[enough], face[enough], votes[enough]
        corners = mesh.vertices[mesh.faces[face]]
        normals = unit_normals(mesh.vertices, mesh.faces)[0][face]
        distances = ((self._positions[point] - corners[:, 0]) * normals).sum(axis=1)
        feet = self._positions[point] - distances[:, None] * normals
        weights = barycentric(corners, feet)
        kept = np.flatnonzero((np.abs(distances) < reach) & (weights.min(axis=1) > -RIM))
        # Of two faces with half of the photos each: the one the point is nearer to.
        kept = kept[np.lexsort((np.abs(distances[kept]), -votes[kept], point[kept]))]
        kept = kept[np.diff(point[kept], prepend=-1) > 0]
        return Assignment(point[kept], face[kept], weights[kept], normals[kept], distances[kept])


def _origin_of_rays(mesh: Mesh) -> np.ndarray:
    """(3,) float: where the coordinates of rays begin, which are float32: the middle of a mesh that lies far from the origin.

    Within ten diagonals float32 resolves 1e-6 of the diagonal.
    """
    middle = mesh.vertices.mean(axis=0)
    return middle if np.linalg.norm(middle) > 10 * mesh.diagonal else np.zeros(3)

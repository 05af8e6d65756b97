"""Face splits: faces of a refined mesh that points near the surface contradict are split, if other points agree.

The vertices of a start mesh were sparse points; between them flat faces cut off what is curved or set back. A surface sweep gives
points of all textured pixels. Those of every other photo build: where they lie off a face together, by more than their own
covariances explain, it is divided in four and the new vertices are fitted to them. Those of the other photos judge: a part of the
surface whose faces they do not lie clearly nearer to than before is taken back. (ledger: face splits)
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fairing.camera import Camera
from fairing.features.points import FeaturePoints
from fairing.features.surface_sweep import SurfaceSweep
from fairing.geometry.normals import face_normals
from fairing.geometry.pixel_size import pixel_size
from fairing.mesh import Mesh
from fairing.optimize.iteration import iterate
from fairing.options import StepOptions
from fairing.scene import View
from fairing.solve.step_limits import unfolded
from fairing.terms.point_rays import Assignment, PointRays
from fairing.terms.points import NEAR_GATES, PointFit
from fairing.triangulation.quads import find_quads
from fairing.triangulation.split_record import SplitRound
from fairing.triangulation.subdivision import subdivided

SWEEP_ERROR = 3.0  # px, that the sweep allows for
REACH = 3.0
"""Percent of the diagonal: points farther from the face that their photo sees belong to something else."""
NOISE = 0.2
"""px: standard deviation of a point's distance from a flat face, beside the point's own."""
LEAST_OFFSET = 0.5  # px, of the points of a quarter of a face from its plane
SIGNIFICANCE = 3.0  # standard errors, of an offset that builds and of a gain that the judges confirm
FEWEST = 4  # points of a quarter
FEWEST_JUDGES = 5
LEAST_GAIN = 0.1  # of the judges' mean loss
OUTLIER = 3.0  # standard deviations: a judge's loss is bounded there, and that of a point without a face is as large
MAD_TO_SIGMA = 1.4826
MEDIAN_ERROR = 1.2533
"""Standard error of a median in those of a mean, of normal deviates."""
SWEEP_SHARE = 0.8  # of the time of a round


def split_faces(
    views: Sequence[View],
    vertices: np.ndarray,
    faces: np.ndarray,
    rounds: int,
    smallest: float,
    executor: Executor,
    check: Callable[[], None] = lambda: None,
    on_progress: Callable[[float, str], None] = lambda part, line: None,
) -> Iterator[SplitRound]:
    """The rounds, each as it is done; the first that splits no face is the last.

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        smallest: px of a typical photo: square root of the area of a face; smaller ones are not split.
        executor: runs one task for each photo; the result does not depend on it.
        check: called again and again, from several threads; may raise `Cancelled`.
        on_progress: called with the finished part, 0 to 1, and a line, from several threads.

    Raises:
        Cancelled: by `check`.
    """
    mesh = Mesh(vertices, faces)
    for number in range(rounds):
        show = partial(_show, on_progress, number, rounds)
        points = SurfaceSweep(views, executor, check, partial(_show_sweep, show)).points(mesh, SWEEP_ERROR)
        show(SWEEP_SHARE, "splitting and judging")
        done = _Round([view.camera for view in views], mesh, points, check).result(smallest)
        yield done
        if not done.is_split.any():
            return
        mesh = Mesh(*done.result())


def _show(on_progress: Callable[[float, str], None], number: int, rounds: int, part: float, line: str) -> None:
    on_progress((number + part) / rounds, f"face splits, round {number + 1} of {rounds}: {line}")


def _show_sweep(show: Callable[[float, str], None], part: float) -> None:
    show(SWEEP_SHARE * part, "points near the surface")


class _Points:
    """Points with their rays; `pixel`: world units, of a typical pixel at the mesh."""

    def __init__(
        self, cameras: Sequence[Camera], points: FeaturePoints, pixel: float, check: Callable[[], None]
    ) -> None:
        self.rays, self.covariance, self._pixel = PointRays(cameras, points, check), points.covariance, pixel

    def assigned(self, mesh: Mesh) -> tuple[Assignment, np.ndarray]:
        """The points that belong to faces, and the standard deviations (q,), world units, of their distances from these."""
        found = self.rays.assign(mesh, REACH * mesh.diagonal / 100)
        own = np.einsum("qi,qij,qj->q", found.normals, self.covariance[found.points], found.normals)
        return found, np.sqrt(own + (NOISE * self._pixel) ** 2)

    def losses(self, mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
        """The loss (p,) of each point, and the face (p,) int that it belongs to, -1 for none."""
        found, sigma = self.assigned(mesh)
        loss, face = np.full(len(self.covariance), OUTLIER**2), np.full(len(self.covariance), -1)
        loss[found.points] = np.minimum((found.distances / sigma) ** 2, OUTLIER**2)
        face[found.points] = found.faces
        return loss, face


class _Round:
    """One round: faces are chosen and split by one half of the points, parts of them kept by the other."""

    def __init__(self, cameras: Sequence[Camera], mesh: Mesh, points: FeaturePoints, check: Callable[[], None]) -> None:
        self._mesh, self._check = mesh, check
        self._pixel = float(np.nanmedian(pixel_size(cameras, mesh.vertices)))
        self._builders, self._judges = (
            _Points(cameras, _of_photos(points, parity), self._pixel, check) for parity in (0, 1)
        )

    def result(self, smallest: float) -> SplitRound:
        """The round; smallest: see `split_faces`."""
        old, offsets = self._mesh, self._offsets()
        area = np.linalg.norm(face_normals(old.vertices, old.faces), axis=1) / 2
        is_chosen = (offsets > 0) & (area > (smallest * self._pixel) ** 2)
        chosen = np.flatnonzero(is_chosen)
        parts = self._parts(is_chosen)
        judges, errors, significance, is_split = self._judged(chosen, parts)
        is_kept = np.zeros(len(old.faces), dtype=bool)
        is_kept[chosen] = is_split[parts]
        after = self._split(is_kept)[0].vertices if is_kept.any() else old.vertices
        return SplitRound(
            old.vertices, old.faces, chosen, offsets[chosen], parts, judges, errors, significance, is_split, after
        )

    def _offsets(self) -> np.ndarray:
        """(m,) float, px: how far the points of a quarter of each face lie off it together, the largest; 0 where none do."""
        found, sigma = self._builders.assigned(self._mesh)
        # A face in four: at its corners, 0 to 2, and in its middle.
        quarter = np.where(found.weights.max(axis=1) > 0.5, found.weights.argmax(axis=1), 3)
        cell, of_point, count = np.unique(4 * found.faces + quarter, return_inverse=True, return_counts=True)
        offset = _medians(found.distances, of_point)
        scatter = MAD_TO_SIGMA * _medians(np.abs(found.distances - offset[of_point]), of_point)
        expected = _medians(sigma, of_point)
        error = MEDIAN_ERROR * np.maximum(scatter, expected) / np.sqrt(count)
        size = np.abs(offset)
        is_off = (count >= FEWEST) & (size > LEAST_OFFSET * self._pixel) & (size > SIGNIFICANCE * error)
        is_off &= scatter < np.maximum(size, 2 * expected)  # else they disagree among themselves
        result = np.zeros(len(self._mesh.faces))
        np.maximum.at(result, cell[is_off] // 4, size[is_off] / self._pixel)
        return result

    def _split(self, is_chosen: np.ndarray) -> tuple[Mesh, np.ndarray]:
        """The mesh with these faces (m,) bool split and fitted, and for each of its faces (q,) int the one it is part of."""
        old = self._mesh
        vertices, faces, parent = subdivided(old.vertices, old.faces, is_chosen)
        mesh = Mesh(vertices, faces)
        ids = np.unique(faces[is_chosen[parent]])
        fit = PointFit(mesh, self._builders.rays, self._builders.covariance)
        guard = partial(unfolded, start=mesh.vertices, faces=faces, options=StepOptions())
        for gate in NEAR_GATES:
            self._check()
            vertices = iterate(fit.terms(vertices, gate), vertices, ids, guard).after
        return mesh.moved(vertices), parent

    def _parts(self, is_chosen: np.ndarray) -> np.ndarray:
        """(k,) int: the connected part, from 0, of each chosen face."""
        m = len(is_chosen)
        beside = find_quads(self._mesh.faces).faces
        beside = beside[is_chosen[beside].all(axis=1)]
        _, part = connected_components(coo_array((np.ones(len(beside)), beside.T), shape=(m, m)), directed=False)
        return np.unique(part[is_chosen], return_inverse=True)[1]

    def _judged(self, chosen: np.ndarray, parts: np.ndarray) -> tuple[np.ndarray, ...]:
        """`judges`, `errors`, `significance` and `is_split`, see `SplitRound`, of chosen faces (k,) int with parts (k,) int."""
        p = int(parts.max(initial=-1)) + 1
        if p == 0:
            return np.zeros(0, dtype=int), np.zeros((0, 2)), np.zeros(0), np.zeros(0, dtype=bool)
        part = np.full(len(self._mesh.faces) + 1, -1)  # of each face, the last one for none
        part[chosen] = parts
        split, parent = self._split(part[:-1] >= 0)
        (before, old), (after, new) = self._judges.losses(self._mesh), self._judges.losses(split)
        new = np.where(new >= 0, parent[new], -1)
        of_point = np.where(part[old] >= 0, part[old], part[new])
        counts = of_point >= 0
        of_point, before, gain = of_point[counts], before[counts], (before - after)[counts]
        count, loss, total, squares = (
            np.bincount(of_point, values, minlength=p) for values in (None, before, gain, gain**2)
        )
        number = np.maximum(count, 1)
        error = np.sqrt(np.maximum(squares / number - (total / number) ** 2, 0) / number)
        is_better = (count >= FEWEST_JUDGES) & (total > LEAST_GAIN * loss) & (total / number > SIGNIFICANCE * error)
        means = np.column_stack([loss, np.maximum(loss - total, 0)]) / number[:, None]
        return count, np.sqrt(means), total / number / np.maximum(error, 1e-9), is_better


def _of_photos(points: FeaturePoints, parity: int) -> FeaturePoints:
    """Of points that have one observation each, those of the photos with even or odd numbers."""
    ids = np.flatnonzero(points.photos % 2 == parity)
    of_points = {
        name: getattr(points, name)[ids]
        for name in ("positions", "covariance", "colors", "photos", "pixels", "residual")
    }
    return replace(points, **of_points, offsets=np.arange(len(ids) + 1))


def _medians(values: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """(g,) float: median of the values (q,) of each group (q,) int, none of which is empty."""
    order = np.lexsort((values, groups))
    count = np.bincount(groups)
    first = np.cumsum(count) - count
    return (values[order[first + (count - 1) // 2]] + values[order[first + count // 2]]) / 2

"""Comparable residual: how well the photos agree about a mesh, by a measure that is the same at all moments and in all runs.

Energies of two sweeps do not compare: each sweep has its own cells, visibility, blur and robust scale. Here all of these are
fixed once, at the start of the run, whatever its options are: the same faces, photos and samples, at the finest level of the
default options. The residuals e of all samples give one number,

    r = sqrt(mean of sigma^2 e^2 / (sigma^2 + e^2)),   sigma = `SIGMA`,

the root mean square residual in grey levels, except that a residual well beyond sigma counts as sigma. Samples count by the
photo pixels that they stand for at the start, so that no face gains by shrinking.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fairing.cells.context import CellContext
from fairing.cells.visibility import Visibility, footprints
from fairing.errors import Cancelled
from fairing.mesh import Mesh
from fairing.options import FairingOptions
from fairing.run.recorded_stages import recorded_stages
from fairing.run.session import Session
from fairing.solve.energy import Evaluator
from fairing.solve.problem import Problem

OPTIONS = FairingOptions()
"""What the residual is measured with."""
LEVEL = OPTIONS.n_levels - 1
SIGMA = OPTIONS.robust.sigma
"""Grey levels: scale of the robust norm."""
MARGIN = 24.0
"""px: vertices may move this far from the start before cells read beyond the parts of the photos that are kept in memory, where
the last pixel is repeated."""
MOST_PIXELS = 64_000_000
"""Limit of these parts together, 256 MB. Of a mesh that needs more, every second, third ... face is measured."""
PART_SAMPLES = 1_000_000
"""Samples between two looks at `cancel_requested`, about 30 ms."""


@dataclass(frozen=True, eq=False)
class MeasuredResidual:
    """The losses of a mesh, by pair of a face and a photo; P pairs.

    Attributes:
        n_faces: number of faces of the mesh, m.
        faces, views: (P,) int: the measured pairs.
        pixels: (P,) float: photo pixels of the samples at the start, px.
        loss: (P,) float: sigma^2 times the robust norm, summed over these pixels, grey levels^2 px.
    """

    n_faces: int
    faces: np.ndarray
    views: np.ndarray
    pixels: np.ndarray
    loss: np.ndarray

    @cached_property
    def mean(self) -> float:
        """The comparable residual of the mesh, grey levels; NaN if no face is measured."""
        return self._residual(np.ones(len(self.faces), dtype=bool))

    def of_faces(self, faces: np.ndarray) -> float:
        """The residual over some faces (F,) int, grey levels; NaN if none of them is measured."""
        return self._residual(np.isin(self.faces, faces))

    def of_face_by_view(self, face: int) -> dict[int, float]:
        """The residual of a face in each photo it is measured in, grey levels, by view id."""
        return {
            int(self.views[pair]): float(np.sqrt(self.loss[pair] / self.pixels[pair]))
            for pair in np.flatnonzero((self.faces == face) & (self.pixels > 0))
        }

    def loss_by_face(self) -> np.ndarray:
        """(m,) float, grey levels^2 px: the sum of the losses of each face; 0 for a face that is not measured."""
        return np.bincount(self.faces, self.loss, self.n_faces)

    def by_face(self) -> np.ndarray:
        """(m,) float, grey levels: the residual of each face; NaN for a face that is not measured."""
        return self._rooted(*(np.bincount(self.faces, values, self.n_faces) for values in (self.loss, self.pixels)))

    def by_vertex(self, mesh: Mesh) -> np.ndarray:
        """(n,) float, grey levels: the residual over the faces around each vertex; NaN where none is measured."""
        corners = mesh.faces[self.faces].ravel()
        sums = (np.bincount(corners, np.repeat(each, 3), len(mesh.vertices)) for each in (self.loss, self.pixels))
        return self._rooted(*sums)

    def _residual(self, pairs: np.ndarray) -> float:
        return float(self._rooted(*(np.array([each[pairs].sum()]) for each in (self.loss, self.pixels)))[0])

    @staticmethod
    def _rooted(loss: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        return np.sqrt(np.divide(loss, pixels, out=np.full(len(pixels), np.nan), where=pixels > 0))


class ComparableResidual:
    """Measures the meshes of all runs that begin at the start of a session, under any options.

    Nothing is computed before the first measurement, which reads the photos and takes as long as the first sweep of a level.
    Any one thread may measure while others use the session.

    Args:
        session: scene, cameras and start.
        cancel_requested: polled several times a second while something is computed; where it returns True, that raises `Cancelled`.
        threads: number of threads; 0: one per core. The result does not depend on it.
    """

    def __init__(
        self, session: Session, cancel_requested: Callable[[], bool] = lambda: False, threads: int = 0
    ) -> None:
        self._session, self._cancel_requested = session, cancel_requested
        self._options = replace(OPTIONS, threads=threads)
        self._evaluator = Evaluator(threads, self._raise_if_cancelled)

    def measure(self, vertices: np.ndarray) -> MeasuredResidual:
        """The losses with the vertices at positions (n, 3) float, world units.

        Raises:
            InputError: a photo cannot be decoded.
            Cancelled: `cancel_requested` returned True.
        """
        context, pair_faces, pixels = self._context, self._pair_faces, self._pixels
        scale, loss = np.full(len(self._session.scene.mesh.faces), SIGMA**2), np.zeros(len(pixels))
        for faces in self._parts:
            found = self._evaluator.energies(context, vertices, faces, scale)
            # With a corner behind a camera a face explains nothing: all of its samples count as outliers.
            behind = np.isin(pair_faces, found.faces[~np.isfinite(found.energy)])
            loss += SIGMA**2 * np.where(behind, pixels, found.pair_energy)
        return MeasuredResidual(len(scale), pair_faces, context.kernel.pair_view, pixels, loss)

    def _raise_if_cancelled(self) -> None:
        if self._cancel_requested():
            raise Cancelled

    @cached_property
    def _context(self) -> CellContext:
        problem = self._session.problem_under(self._options, self._cancel_requested)
        chosen = _chosen_faces(problem)
        return problem.context_of(chosen, LEVEL, problem.start, MARGIN)

    @cached_property
    def _pair_faces(self) -> np.ndarray:
        """(P,) int: the face of each pair."""
        starts = self._context.kernel.pair_start
        return np.repeat(np.arange(len(starts) - 1), np.diff(starts))

    @cached_property
    def _pixels(self) -> np.ndarray:
        """(P,) float: photo pixels of the samples of each pair that count; 0 for a face that too few photos see."""
        data = self._context.kernel
        samples = np.diff(data.grid_start)[data.face_grid][self._pair_faces]
        counted = [
            count if start < 0 else data.masks[start : start + count].sum()
            for count, start in zip(samples.tolist(), data.pair_mask.tolist(), strict=True)
        ]
        return data.pair_weight * np.array(counted, dtype=float) * self._context.takes_part[self._pair_faces]

    @cached_property
    def _parts(self) -> list[np.ndarray]:
        """The measured faces, ids, in parts of about `PART_SAMPLES`."""
        data, faces = self._context.kernel, np.flatnonzero(self._context.takes_part)
        samples = (np.diff(data.grid_start)[data.face_grid] * np.diff(data.pair_start))[faces]
        part = np.cumsum(samples) // PART_SAMPLES
        return np.split(faces, np.flatnonzero(np.diff(part)) + 1) if len(faces) else []


def stage_residuals(session: Session) -> dict[int, float]:
    """The comparable residual, grey levels, at the start of a run and after each of its stages, by moment; without those at which
    no face is measured.

    Raises:
        InputError: a photo cannot be decoded.
        Cancelled: the session's cancellation was requested.
    """
    measure = ComparableResidual(session, lambda: session.cancel_requested(), session.options.threads)
    moments = [0, *(stage.end for stage in recorded_stages(session.trace))]
    found = {moment: measure.measure(session.trace.vertices_at(moment)).mean for moment in moments}
    return {moment: residual for moment, residual in found.items() if np.isfinite(residual)}


def _chosen_faces(problem: Problem) -> np.ndarray:
    """(m,) bool: the faces to measure, all or every second, third ..., see `MOST_PIXELS`."""
    faces, visibility = problem.scene.mesh.faces, OPTIONS.visibility
    blur = OPTIONS.levels[LEVEL].blur
    pixels = np.zeros((len(problem.scene.views), len(faces)))
    for row, view in zip(pixels, problem.scene.views, strict=True):
        seen = footprints(problem.start, faces, view.camera, problem.orientation, visibility, blur)
        around = (seen.longest_edge + 2 * MARGIN) * (seen.height + 2 * MARGIN)
        row[seen.reason == Visibility.SEEN] = around[seen.reason == Visibility.SEEN]
    total = np.sort(pixels, axis=0)[-visibility.max_views :].sum()
    chosen = np.zeros(len(faces), dtype=bool)
    chosen[:: max(1, int(np.ceil(total / MOST_PIXELS)))] = True
    return chosen

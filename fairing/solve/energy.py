"""Evaluator: energies and normal equations of faces, computed on several threads; the result is independent of their number."""

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fairing.cells.context import CellContext
from fairing.kernels.data import Task
from fairing.kernels.faces import evaluate_faces

MAX_PART_SAMPLES = 25_000_000  # per part of a list, about 0.2 s of work: the latency of a cancellation


@dataclass(frozen=True, eq=False)
class FaceSystem:
    """Energies, residual statistics and normal equations of a list of F faces.

    Attributes:
        faces: (F,) int, ids.
        energy: (F,) float: E of Eq. 2, weighted; infinite where a corner lies behind a camera.
        pair_energy: (P,) float: the energy by pair of face and view; only the pairs of `faces` are filled.
        H: (F, 9, 9) float, energy / world unit^2: normal matrix by the nine coordinates of the corners; zero for fixed corners.
        g: (F, 9) float, energy / world unit: gradient.
        largest, median: (F,) float: absolute residual, grey levels (only from `measure`).
    """

    faces: np.ndarray
    energy: np.ndarray
    pair_energy: np.ndarray
    H: np.ndarray
    g: np.ndarray
    largest: np.ndarray
    median: np.ndarray

    def replaced_by(self, other: "FaceSystem", faces: np.ndarray, pairs: np.ndarray) -> "FaceSystem":
        """This system with the rows of another one where masks (F,) and (P,) bool say so; without residual statistics."""
        if faces.all():
            return other
        zeros = np.zeros(len(faces))
        return replace(
            self,
            energy=np.where(faces, other.energy, self.energy),
            pair_energy=np.where(pairs, other.pair_energy, self.pair_energy),
            H=np.where(faces[:, None, None], other.H, self.H),
            g=np.where(faces[:, None], other.g, self.g),
            largest=zeros,
            median=zeros,
        )


class Evaluator:
    """Runs the kernels over lists of faces on several threads.

    Args:
        threads: number of threads; 0: one per core.
        raise_if_cancelled: called before each part of a list; its exception ends the computation.
    """

    def __init__(self, threads: int = 0, raise_if_cancelled: Callable[[], None] = lambda: None) -> None:
        self._threads, self._raise_if_cancelled = threads or os.cpu_count() or 1, raise_if_cancelled
        self.pool = self._new_pool()
        self.samples = 0
        """Cell samples evaluated so far, for the speed shown to users."""
        self._counting = threading.Lock()

    def clear(self) -> None:
        """End the threads; the next computation starts new ones."""
        self.pool.shutdown(wait=False)
        self.pool = self._new_pool()

    def linearise(
        self,
        context: CellContext,
        vertices: np.ndarray,
        faces: np.ndarray,
        corners: np.ndarray,
        squared_scale: np.ndarray,
        solver: str,
    ) -> FaceSystem:
        """Energy and normal equations at given vertex positions.

        Args:
            context: the cells.
            vertices: (n, 3) float, world units.
            faces: (F,) int: face ids.
            corners: (F,) int: the corner that moves, -1 for all three.
            squared_scale: (m,) float, grey levels^2: squared scale of the robust norm by face, see `Norm.squared_scale`.
            solver: "alternating" or "variable_projection".

        Returns:
            The system without residual statistics (they are 0).
        """
        task = Task.ALTERNATING if solver == "alternating" else Task.VARIABLE_PROJECTION
        return self._run(context, vertices, faces, corners, squared_scale, task)

    def measure(
        self, context: CellContext, vertices: np.ndarray, faces: np.ndarray, squared_scale: np.ndarray
    ) -> FaceSystem:
        """Energy and residual statistics at given vertex positions, without normal equations (H and g are 0).

        Args:
            context: the cells.
            vertices: (n, 3) float, world units.
            faces: (F,) int: face ids.
            squared_scale: (m,) float, grey levels^2: squared scale of the robust norm by face, see `Norm.squared_scale`.
        """
        return self._run(context, vertices, faces, np.full(len(faces), -1), squared_scale, Task.STATISTICS)

    def energies(
        self, context: CellContext, vertices: np.ndarray, faces: np.ndarray, squared_scale: np.ndarray
    ) -> FaceSystem:
        """Energies alone: `measure` without the residual statistics, which are 0; arguments (n, 3), (F,) and (m,) as there."""
        return self._run(context, vertices, faces, np.full(len(faces), -1), squared_scale, Task.ENERGY)

    def _run(self, context, vertices, faces, corners, squared_scale, task) -> FaceSystem:
        data = context.kernel
        faces = np.ascontiguousarray(faces, dtype=np.int64)
        corners = np.ascontiguousarray(corners, dtype=np.int64)
        count = len(faces)
        energy, statistics = np.zeros(count), np.zeros((count, 2))
        pair_energy = np.zeros(len(data.pair_view))
        H, g = np.zeros((count, 9, 9)), np.zeros((count, 9))
        vertices = np.require(vertices, np.float64, ["C", "W"])  # numba compiles again for what is read-only
        samples = np.diff(data.pair_start)[faces] * np.diff(data.grid_start)[data.face_grid[faces]]
        with self._counting:
            self.samples += int(samples.sum()) * data.channels

        def work(part: slice) -> None:
            self._raise_if_cancelled()
            evaluate_faces(
                data, vertices, faces[part], corners[part], squared_scale, int(task),
                energy[part], pair_energy, H[part], g[part], statistics[part],
            )  # fmt: skip

        parts = self._parts(samples)
        if len(parts) == 1:
            work(parts[0])
        else:
            list(self.pool.map(work, parts))
        return FaceSystem(faces, energy, pair_energy, H, g, *statistics.T)

    def _new_pool(self) -> ThreadPoolExecutor:
        return ThreadPoolExecutor(self._threads, thread_name_prefix="fairing")

    def _parts(self, samples: np.ndarray) -> list[slice]:
        """Consecutive slices of faces of about equal work."""
        total = np.cumsum(samples)
        if len(total) == 0:
            return []
        # Four a thread, so that threads end at about the same time.
        count = max(4 * self._threads if self._threads > 1 else 1, -(-int(total[-1]) // MAX_PART_SAMPLES))
        targets = np.linspace(0, total[-1], count + 1)[1:-1]
        cuts = np.unique(np.concatenate([[0], np.searchsorted(total, targets), [len(samples)]]))
        return [slice(int(a), int(b)) for a, b in pairwise(cuts)]


def loss_of_faces(context: CellContext, system: FaceSystem) -> tuple[np.ndarray, np.ndarray]:
    """Loss per photo pixel of the faces of a system, (F,) float, and their pixels in all photos, (F,) float.

    The loss is divided by the degrees of freedom, (n - k) / n, so that a face seen by few photos does not appear to fit
    better. Both are 0 where fewer than three photos see the face.
    """
    data, faces = context.kernel, system.faces
    samples = np.diff(data.grid_start)[data.face_grid]
    views = np.diff(data.pair_start)
    total = np.concatenate([[0], np.cumsum(data.pair_weight * np.repeat(samples, views))])
    pixels = (total[data.pair_start[1:]] - total[data.pair_start[:-1]])[faces]
    k, n = data.face_dimensions[faces], views[faces]
    pixels[k == 0] = 0
    return np.where(k > 0, system.energy / np.maximum(pixels, 1e-12) * n / np.maximum(n - k, 1), 0.0), pixels

"""Energies and normal equations of faces, computed on several threads with one and the same result."""

import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np

from fairing.cells.context import CellContext
from fairing.kernels.data import SOLVER_ALTERNATING, SOLVER_NONE, SOLVER_VARIABLE_PROJECTION
from fairing.kernels.faces import evaluate_faces
from fairing.options import RobustOptions, by_level

SOLVERS = {"alternating": SOLVER_ALTERNATING, "variable_projection": SOLVER_VARIABLE_PROJECTION}
PARTS_PER_THREAD = 4
MOST_SAMPLES = 100_000_000  # of a part, after about a second of which the work can be given up
AT_ONCE = 2  # of `Evaluator.side_by_side`

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class FaceSystem:
    """What the kernel says of a list of faces.

    Attributes:
        faces: (F,) int, ids.
        energy: (F,) float: E of Eq. 2, weighted; infinite where a corner lies behind a camera.
        pair_energy: (P,) float: the same by face and view; only the pairs of `faces` are filled.
        H: (F, 9, 9) float: normal matrix by the nine coordinates of the corners; zero where a corner was not asked for.
        g: (F, 9) float: gradient.
        largest, median: (F,) float: absolute residual, grey levels (only from `measure`).
        singular_value_ratio: (F,) float: the k-th singular value squared over the mean of the later ones (only from `measure`).
    """

    faces: np.ndarray
    energy: np.ndarray
    pair_energy: np.ndarray
    H: np.ndarray
    g: np.ndarray
    largest: np.ndarray
    median: np.ndarray
    singular_value_ratio: np.ndarray


class Evaluator:
    """Runs the kernel over lists of faces on `threads` threads (0: one per core).

    Args:
        ask: called before each of several parts of a list; what it raises ends the work.
    """

    def __init__(self, threads: int = 0, ask: Callable[[], None] = lambda: None) -> None:
        self._threads, self._ask = threads or os.cpu_count() or 1, ask
        self.pool = ThreadPoolExecutor(self._threads, thread_name_prefix="fairing")
        self.samples = 0
        """Cell samples read so far, for the speed shown to users."""
        self._counting = threading.Lock()

    def side_by_side(self, work: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """Results of independent pieces of work, each of which uses the evaluator and its pool itself.

        Two go on at once: while one is between calls of compiled code, the other keeps the threads busy.
        """
        if self._threads == 1:
            return [work(item) for item in items]
        with ThreadPoolExecutor(AT_ONCE, thread_name_prefix="side-by-side") as both:
            return list(both.map(work, items))

    def linearise(
        self,
        context: CellContext,
        vertices: np.ndarray,
        faces: np.ndarray,
        corners: np.ndarray,
        sigma: np.ndarray,
        solver: str,
    ) -> FaceSystem:
        """Energy and normal equations at `vertices`.

        Args:
            faces: (F,) int ids.
            corners: (F,) int: the corner that moves, -1 for all three.
            sigma: (m,) float: scale of the robust norm squared, by face (see `robust_scale`).
            solver: "alternating" or "variable_projection".
        """
        return self._run(context, vertices, faces, corners, sigma, SOLVERS[solver])

    def measure(self, context: CellContext, vertices: np.ndarray, faces: np.ndarray, sigma: np.ndarray) -> FaceSystem:
        """Energy and residual statistics only."""
        return self._run(context, vertices, faces, np.full(len(faces), -1), sigma, SOLVER_NONE)

    def _run(self, context, vertices, faces, corners, sigma, solver) -> FaceSystem:
        data = context.kernel
        faces = np.ascontiguousarray(faces, dtype=np.int64)
        corners = np.ascontiguousarray(corners, dtype=np.int64)
        count = len(faces)
        energy, statistics = np.zeros(count), np.zeros((count, 3))
        pair_energy = np.zeros(len(data.pair_view))
        H, g = np.zeros((count, 9, 9)), np.zeros((count, 9))
        vertices = np.ascontiguousarray(vertices, dtype=np.float64)
        samples = np.diff(data.pair_start)[faces] * np.diff(data.grid_start)[data.face_grid[faces]]
        with self._counting:
            self.samples += int(samples.sum()) * data.channels

        def work(part: slice) -> None:
            self._ask()
            evaluate_faces(
                data, vertices, faces[part], corners[part], sigma, solver,
                energy[part], pair_energy, H[part], g[part], statistics[part],
            )  # fmt: skip

        parts = self._parts(samples)
        if len(parts) == 1:
            work(parts[0])
        else:
            list(self.pool.map(work, parts))
        return FaceSystem(faces, energy, pair_energy, H, g, *statistics.T)

    def _parts(self, samples: np.ndarray) -> list[slice]:
        """Runs of faces of about equal work."""
        total = np.cumsum(samples)
        if len(total) == 0:
            return []
        count = max(self._threads * PARTS_PER_THREAD if self._threads > 1 else 1, -(-int(total[-1]) // MOST_SAMPLES))
        targets = np.linspace(0, total[-1], count + 1)[1:-1]
        cuts = np.unique(np.concatenate([[0], np.searchsorted(total, targets), [len(samples)]]))
        return [slice(int(a), int(b)) for a, b in pairwise(cuts)]


def robust_sigma(options: RobustOptions, level: int, system: FaceSystem) -> np.ndarray:
    """sigma in grey levels for the faces of `system` (F,), by the level's rule."""
    rule = by_level(options.sigma_rule, level)
    if rule == "paper":
        sigma = system.largest / np.sqrt(3)
    elif rule == "convex":
        sigma = system.largest * np.sqrt(3)
    elif rule == "mad":
        sigma = options.mad_factor * 1.4826 * system.median
    else:
        sigma = np.full(len(system.faces), options.sigma)
    return np.maximum(sigma, options.sigma_floor)


def robust_scale(options: RobustOptions, sigma: np.ndarray) -> np.ndarray:
    """What the kernel divides e^2 by: sigma squared, or sigma itself for the printed Geman-McClure form."""
    return sigma if options.norm == "geman_mcclure_printed" else sigma**2

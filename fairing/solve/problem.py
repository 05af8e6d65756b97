"""What a run minimises and within which bounds: the same from its first moment to its last."""

import itertools
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

import numpy as np

from fairing.cells.context import CellContext, build_context
from fairing.cells.scale_space import ScaleSpace
from fairing.cells.visibility import Visibility, mesh_orientation
from fairing.errors import Cancelled, InputError
from fairing.geometry.mesh_check import inspect_mesh
from fairing.options import FairingOptions
from fairing.scene import Scene
from fairing.solve.energy import Evaluator, FaceSystem
from fairing.solve.locks import locked_by_options
from fairing.solve.step_limits import pixels_moved, shortened, unfolded

TOO_MANY_PARTS = (
    "the mesh has too many faces to make the photos equally sharp on each: the last level takes them as they are"
)


class Problem:
    """How well the photos agree with the mesh, wherever its vertices are, and how far these may move.

    Args:
        scene: photos and faces.
        options: how to compare.
        start: (n, 3) float: vertices at the start of the run, world units.
        cancel_requested: asked before long computations; where it holds, they raise `Cancelled`.
        on_photo: told of the photos being read or judged: how many are done, and of how many.

    Attributes:
        locked: (n,) bool: vertices that never move, by option or because a degenerate face holds them.
        evaluator: computes energies and normal equations.
        warnings: the scene's, and what was noticed since.
        seconds: spent on "photos" and on "visibility".

    Raises:
        InputError: an option contradicts the scene.
    """

    def __init__(
        self,
        scene: Scene,
        options: FairingOptions,
        start: np.ndarray,
        cancel_requested: Callable[[], bool] = lambda: False,
        on_photo: Callable[[int, int], None] = lambda done, count: None,
    ) -> None:
        self.scene, self.options, self.start = scene, options, start
        self.evaluator = Evaluator(options.threads, self._raise_if_cancelled)
        self.warnings: list[str] = list(scene.warnings)
        self.seconds: dict[str, float] = {"photos": 0.0, "visibility": 0.0}
        self._cancel_requested, self._on_photo = cancel_requested, on_photo
        self._photos = self._fresh_photos()
        degenerate = inspect_mesh(scene.mesh).degenerate_faces
        self._judged = np.ones(len(scene.mesh.faces), dtype=bool)
        self._judged[degenerate] = False
        self.locked = locked_by_options(scene, options)
        self.locked[scene.mesh.faces[degenerate]] = True
        self.orientation = mesh_orientation(scene, start)
        """See `fairing.cells.visibility.mesh_orientation`."""
        if self.orientation < 0:
            self.warnings.append("mesh: its faces point away from the photos; they are taken as turned around")

    # ------------------------------------------------------------------ what the photos say

    def context(self, level: int, vertices: np.ndarray, among: np.ndarray | None = None) -> CellContext:
        """Visibility and cells of all faces at a level, with the vertices (n, 3) at given places.

        Args:
            among: (n,) bool: only of faces around these vertices.

        Raises:
            InputError: no photo sees any face well enough at the last level.
            Cancelled: nobody wants it any more.
        """
        began, photos_before = time.perf_counter(), self._photos.seconds
        self._photos.forget_all_but(self.options.schedule.blur[level])
        judged = self._judged if among is None else self._judged & among[self.scene.mesh.faces].any(axis=1)
        context = self.context_of(judged, level, vertices, self.options)
        on_photos = self._photos.seconds - photos_before
        self.seconds["photos"] += on_photos
        self.seconds["visibility"] += time.perf_counter() - began - on_photos
        if context.point_spread_fallback and TOO_MANY_PARTS not in self.warnings:
            self.warnings.append(TOO_MANY_PARTS)
        if among is None and not context.takes_part.any() and level == self.options.n_levels - 1:
            counts = {reason: int((context.reasons == reason).sum()) for reason in Visibility}
            found = ", ".join(f"{reason.name.lower()} {count}" for reason, count in counts.items() if count)
            raise InputError(
                f"scene {self.scene.name}: expected faces seen by at least 3 photos, found none ({found}); "
                "run `eigenfairing check` to see the mesh over the photos"
            )
        return context

    def context_of(self, faces: np.ndarray, level: int, vertices: np.ndarray, options: FairingOptions) -> CellContext:
        """The same of the faces of a mask (m,), under options of one's own.

        Raises:
            Cancelled: nobody wants it any more.
        """
        self._raise_if_cancelled()
        judged, count = itertools.count(), len(self.scene.views)
        pool = CancellablePool(self.evaluator.pool, self._raise_if_cancelled)
        return build_context(
            self.scene, self._photos, options, level, vertices, self.orientation, faces, pool,
            on_view=lambda: self._on_photo(next(judged), count),
        )  # fmt: skip

    def measure(self, context: CellContext, vertices: np.ndarray, scale: np.ndarray) -> FaceSystem:
        """Energies and residuals of all faces, see `Evaluator.measure`."""
        return self.evaluator.measure(context, vertices, np.arange(len(self.scene.mesh.faces)), scale)

    def linearise(
        self, context: CellContext, vertices: np.ndarray, faces: np.ndarray, corners: np.ndarray, scale: np.ndarray
    ) -> FaceSystem:
        """Energies and normal equations of faces, see `Evaluator.linearise`.

        Raises:
            Cancelled: nobody wants it any more.
        """
        self._raise_if_cancelled()
        return self.evaluator.linearise(context, vertices, faces, corners, scale, self.options.step.solver)

    def _raise_if_cancelled(self) -> None:
        if self._cancel_requested():
            raise Cancelled

    # ------------------------------------------------------------------ how far vertices may move

    def pixels_moved(
        self, context: CellContext, vertices: np.ndarray, ids: np.ndarray, steps: np.ndarray
    ) -> np.ndarray:
        """(u,) float: how far steps (u, 3) move vertices in the photo where they move most, px."""
        return pixels_moved(self.scene.views, context.vertex_views, vertices, ids, steps)

    def shortened(self, context: CellContext, vertices: np.ndarray, ids: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Steps (u, 3) shortened to the capture range of the context's level."""
        longest = self.options.step.max_step * max(1.0, self.options.schedule.blur[context.level])
        return shortened(self.scene.views, context.vertex_views, vertices, ids, steps, longest)

    def unfolded(self, vertices: np.ndarray, ids: np.ndarray, steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Steps (u, 3) shortened until no face folds; and (u,) bool: which vertices were held back."""
        return unfolded(vertices, ids, steps, self.start, self.scene.mesh.faces, self.options.step)

    def under(self, options: FairingOptions) -> "Problem":
        """The same under other options, with the same photos in memory."""
        other = Problem(self.scene, options, self.start, self._cancel_requested)
        other.evaluator = self.evaluator
        other.share_photos(self)
        return other

    # ------------------------------------------------------------------ photos in memory

    def forget(self) -> None:
        """Free the photos; they are read again when they are wanted."""
        self._photos = self._fresh_photos()

    def share_photos(self, other: "Problem") -> None:
        """Read the same photos as another run on the scene, if both want the same channels of them."""
        if self.options.cells.color == other.options.cells.color:
            self._photos = other._photos

    def _fresh_photos(self) -> ScaleSpace:
        return ScaleSpace(self.scene, self.options.cells.color, self._on_photo)


class CancellablePool(Executor):
    """Works on another pool; before every piece of work it calls `ask`, which raises if nobody wants it any more."""

    def __init__(self, pool: Executor, ask: Callable[[], None]) -> None:
        self._pool, self._ask = pool, ask

    def submit(self, work: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        def asked() -> Any:
            self._ask()
            return work(*arguments, **named)

        return self._pool.submit(asked)

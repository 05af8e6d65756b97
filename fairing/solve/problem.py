"""Problem: the energy of a run, and the limits of its steps."""

import itertools
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

import numpy as np

from fairing.cells.context import CellContext, build_context
from fairing.cells.point_spread import PATCH_MARGIN
from fairing.cells.scale_space import ScaleSpace
from fairing.cells.visibility import Visibility, mesh_orientation
from fairing.errors import Cancelled, InputError
from fairing.features.points import FeaturePoints
from fairing.norms.built_in import norm_of
from fairing.norms.norm import Tabulated
from fairing.options import FairingOptions
from fairing.scene import Scene
from fairing.solve.energy import Evaluator, FaceSystem
from fairing.solve.locks import locked_by_options
from fairing.solve.point_split import observed_fitting_points
from fairing.solve.step_limits import unfolded
from fairing.work import WorkLog

TOO_MANY_PARTS = (
    "the mesh has too many faces to make the photos equally sharp on each: the last level takes them as they are"
)


class Problem:
    """Energy of the mesh with its vertices at any positions, and limits of their steps. Constant during a run.

    Args:
        scene: photos and faces.
        options: of the run.
        start: (n, 3) float: vertices at the start of the run, world units.
        cancel_requested: called within long computations, from several threads; where it returns True, they raise
            `Cancelled`.
        on_photo: called when photos are read or evaluated, with their number so far and in all.
        like: a problem on the same mesh and start, whose orientation is used, and its photos where they are the same.
        work: what the computations do at present is written there.
        own_norm: a norm of one's own, for options that name it; default: that of `like`.

    Attributes:
        locked: (n,) bool: vertices that never move, by option.
        orientation: see `fairing.cells.visibility.mesh_orientation`.
        observed_points: see `fairing.solve.point_split.observed_fitting_points`.
        evaluator: computes energies and normal equations.
        norm: of the residuals of photos.
        cameras: of the photos.
        warnings: of the scene and of the run so far, a line each.
        seconds: time spent on "photos" and on "visibility", s.

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
        like: "Problem | None" = None,
        work: WorkLog | None = None,
        own_norm: Tabulated | None = None,
    ) -> None:
        self.scene, self.options, self.start = scene, options, start
        self.cameras = [view.camera for view in scene.views]
        self._own_norm = like._own_norm if own_norm is None and like is not None else own_norm
        self.norm = norm_of(options.robust.norm, self._own_norm)
        self.evaluator = Evaluator(options.threads, self.raise_if_cancelled)
        self.warnings: list[str] = list(scene.warnings)
        self.seconds: dict[str, float] = {"photos": 0.0, "visibility": 0.0}
        self._cancel_requested, self._on_photo = cancel_requested, on_photo
        self.work = work or WorkLog()
        """What the computations do at present."""
        self._photos = self._fresh_photos()
        self.locked = locked_by_options(scene, options)
        shares_points = like is not None and like.scene.sparse_points is scene.sparse_points
        self.observed_points: FeaturePoints = (
            like.observed_points if like is not None and shares_points else observed_fitting_points(scene)
        )
        self.orientation = mesh_orientation(scene, start) if like is None else like.orientation
        if like is not None and options.cells.color == like.options.cells.color and _same_photos(scene, like.scene):
            self._photos = like._photos
        if self.orientation < 0:
            self.warnings.append("mesh: its faces point away from the photos; they are used with reversed orientation")

    # ------------------------------------------------------------------ energy

    def context(self, level: int, vertices: np.ndarray) -> CellContext:
        """Visibility and cells of all faces at a level.

        Args:
            vertices: (n, 3) float: positions, world units.

        Raises:
            InputError: no photo sees any face well enough at the last level.
            Cancelled: cancellation was requested.
        """
        began, photos_before = time.perf_counter(), self._photos.seconds
        self._photos.begin_level(self.options.levels[level].blur)
        every_face = np.ones(len(self.scene.mesh.faces), dtype=bool)
        context = self.context_of(every_face, level, vertices)
        on_photos = self._photos.seconds - photos_before
        self.seconds["photos"] += on_photos
        self.seconds["visibility"] += time.perf_counter() - began - on_photos
        if context.point_spread_fallback and TOO_MANY_PARTS not in self.warnings:
            self.warnings.append(TOO_MANY_PARTS)
        if not context.takes_part.any() and level == self.options.n_levels - 1:
            counts = {reason: int((context.reasons == reason).sum()) for reason in Visibility}
            found = ", ".join(f"{reason.name.lower()} {count}" for reason, count in counts.items() if count)
            raise InputError(
                f"scene {self.scene.name}: expected faces seen by at least 3 photos, found none ({found}); "
                "run `eigenfairing check` to see the mesh over the photos"
            )
        return context

    def context_of(
        self, faces: np.ndarray, level: int, vertices: np.ndarray, patch_margin: float = PATCH_MARGIN
    ) -> CellContext:
        """Visibility and cells of the faces of a mask (m,) bool at a level.

        Args:
            vertices: (n, 3) float: positions, world units.
            patch_margin: px, see `build_context`.

        Raises:
            Cancelled: cancellation was requested.
        """
        self.raise_if_cancelled()
        judged, count = itertools.count(), len(self.scene.views)
        with self.work.doing("finding the photos that see each face", count) as work:

            def on_view() -> None:
                self._on_photo(next(judged), count)
                work.advance()

            return build_context(
                self.scene,
                self._photos,
                self.options,
                level,
                vertices,
                self.orientation,
                faces,
                self.pool,
                on_view=on_view,
                patch_margin=patch_margin,
                own_norm=self._own_norm,
            )

    def sigma(self, context: CellContext, vertices: np.ndarray) -> np.ndarray:
        """(m,) float: scale parameter of the robust loss by face at vertices (n, 3), grey levels, by the level's rule."""
        robust, rule = self.options.robust, self.options.levels[context.level].sigma_rule
        n_faces = len(self.scene.mesh.faces)
        if rule == "fixed":
            sigma = np.full(n_faces, robust.sigma)
        else:
            with self.work.doing(f"measuring {n_faces} faces"):
                measured = self.evaluator.measure(context, vertices, np.arange(n_faces), np.ones(n_faces))
            sigma = {
                "paper": measured.largest / np.sqrt(3),
                "convex": measured.largest * np.sqrt(3),
                "mad": robust.mad_factor * 1.4826 * measured.median,
            }[rule]
        return np.maximum(sigma, robust.sigma_floor)

    def energies(
        self, context: CellContext, vertices: np.ndarray, scale: np.ndarray, faces: np.ndarray | None = None
    ) -> FaceSystem:
        """Energies of faces, see `Evaluator.energies`.

        Args:
            vertices: (n, 3) float: positions, world units.
            scale: (m,) float: of the robust loss by face, see `Norm.squared_scale`.
            faces: (F,) int, ids; default: all.

        Raises:
            Cancelled: cancellation was requested.
        """
        self.raise_if_cancelled()
        faces = np.arange(len(self.scene.mesh.faces)) if faces is None else faces
        return self.evaluator.energies(context, vertices, faces, scale)

    def linearise(
        self,
        context: CellContext,
        vertices: np.ndarray,
        scale: np.ndarray,
        faces: np.ndarray | None = None,
        corners: np.ndarray | None = None,
    ) -> FaceSystem:
        """Energies and normal equations of faces, see `Evaluator.linearise`.

        Args:
            vertices: (n, 3) float: positions, world units.
            scale: (m,) float: of the robust loss by face, see `Norm.squared_scale`.
            faces: (F,) int, ids; default: all.
            corners: (F,) int: the corner that moves, -1 for all three; default: all three of each.

        Raises:
            Cancelled: cancellation was requested.
        """
        self.raise_if_cancelled()
        faces = np.arange(len(self.scene.mesh.faces)) if faces is None else faces
        corners = np.full(len(faces), -1) if corners is None else corners
        with self.work.doing(f"measuring {len(faces)} faces and their derivatives"):
            return self.evaluator.linearise(context, vertices, faces, corners, scale, self.options.step.solver)

    @property
    def pool(self) -> Executor:
        """The threads of the evaluator; every piece of work begins with `raise_if_cancelled`."""
        return CancellablePool(self.evaluator.pool, self.raise_if_cancelled)

    def raise_if_cancelled(self) -> None:
        """Called within long computations.

        Raises:
            Cancelled: cancellation was requested.
        """
        if self._cancel_requested():
            raise Cancelled

    # ------------------------------------------------------------------ limits of steps

    def pixels_moved(
        self, context: CellContext, vertices: np.ndarray, ids: np.ndarray, steps: np.ndarray
    ) -> np.ndarray:
        """(u,) float: longest displacement in a photo of the context, px, to first order.

        Args:
            vertices: (n, 3) float: positions, world units.
            ids: (u,) int: vertices that move.
            steps: (u, 3) float, world units.
        """
        longest, seen = np.zeros(len(ids)), context.vertex_views[ids]
        for v in np.flatnonzero(seen.any(axis=0)).tolist():
            rows = np.flatnonzero(seen[:, v])
            J = self.scene.views[v].camera.J_image_wrt_point(vertices[ids[rows]])
            longest[rows] = np.maximum(longest[rows], np.linalg.norm(np.einsum("nij,nj->ni", J, steps[rows]), axis=1))
        return longest

    def pixels_per_unit(self, context: CellContext, vertices: np.ndarray) -> np.ndarray:
        """(n,) float: largest motion of vertices (n, 3) in a photo of the context, px per world unit; 0 where none sees one."""
        longest = np.zeros(len(vertices))
        for v, view in enumerate(self.scene.views):
            ids = np.flatnonzero(context.vertex_views[:, v])
            J = view.camera.J_image_wrt_point(vertices[ids])
            longest[ids] = np.maximum(longest[ids], np.linalg.norm(J, 2, axis=(1, 2)) if len(ids) else 0)
        return longest

    def shortened(self, context: CellContext, vertices: np.ndarray, ids: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Steps (u, 3) float shortened to the capture range of the context's level, world units."""
        longest = self.options.step.max_step * max(1.0, self.options.levels[context.level].blur)
        pixels = self.pixels_moved(context, vertices, ids, steps)
        return steps * np.minimum(1, longest / np.maximum(pixels, 1e-12))[:, None]

    def unfolded(self, vertices: np.ndarray, ids: np.ndarray, steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Steps (u, 3) float shortened until no face folds, world units; and (u,) bool: whose steps were shortened."""
        return unfolded(vertices, ids, steps, self.start, self.scene.mesh.faces, self.options.step)

    def moved_to(self, vertices: np.ndarray, targets: np.ndarray) -> np.ndarray:
        """Vertices (n, 3) at targets (n, 3), except where they are locked or a face would fold, world units."""
        ids, after = np.flatnonzero(~self.locked), vertices.copy()
        after[ids] += self.unfolded(vertices, ids, (targets - vertices)[ids])[0]
        return after

    # ------------------------------------------------------------------ photos in memory

    def clear(self) -> None:
        """Free the photos, which are read again when needed, and end the threads."""
        self.evaluator.clear()
        self._photos = self._fresh_photos()

    def _fresh_photos(self) -> ScaleSpace:
        def on_photo(done: int, count: int) -> None:
            self._on_photo(done, count)
            self.work.photo_read(done, count)

        return ScaleSpace(self.scene, self.options.cells.color, on_photo)


def _same_photos(scene: Scene, other: Scene) -> bool:
    """Whether all photos and masks are the same: photos in which a distortion was found are others, undistorted."""
    return all(a.photo is b.photo and a.mask is b.mask for a, b in zip(scene.views, other.views, strict=True))


class CancellablePool(Executor):
    """Executor on another pool; calls `check`, which may raise, before every piece of work."""

    def __init__(self, pool: Executor, check: Callable[[], None]) -> None:
        self._pool, self._check = pool, check

    def submit(self, work: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        def checked() -> Any:
            self._check()
            return work(*arguments, **named)

        return self._pool.submit(checked)

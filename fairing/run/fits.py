"""Fits: what the stages of smoothing and of a fit to sparse points minimise, sweep by sweep."""

from functools import cached_property

import numpy as np

from fairing.cells.level_choice import typical_footprint
from fairing.features.points import FeaturePoints
from fairing.features.surface_sweep import HALF_WINDOW, SurfaceSweep, reduction
from fairing.geometry.pixel_size import pixel_size
from fairing.optimize.rows import Term
from fairing.run.history import History
from fairing.run.stages import Axes, ClosestPoints, PointGates, Stage
from fairing.scene import Scene
from fairing.solve.point_split import fitting_points
from fairing.solve.problem import Problem
from fairing.terms.axes import broad_terms, narrow_terms, relations
from fairing.terms.closest_points import anchor, average_information, closest_points
from fairing.terms.point_rays import PointRays, displacement, distances_px, points_on_surface
from fairing.terms.points import PointFit
from fairing.trace import SchedulePosition, Trace

# A start is far off if a fit to the sparse points moves this part of its vertices that far (ledger: surface sweep: which starts).
FAR_PART, FAR_PX = 0.25, 0.9
# px: Gauss-Newton reaches that far at coarse levels alone (ledger: level after a fit, one surface sweep).
FAR_ERROR = 3.0


def measured_start_error(problem: Problem, start: np.ndarray) -> float:
    """Distance of the start's vertices from their true positions, px, by the observed sparse points; 0 without points.

    Args:
        start: (n, 3) float: positions of the vertices, world units.
    """
    mesh = problem.scene.mesh.moved(start)
    return displacement(distances_px(mesh, problem.cameras, problem.observed_points))


class Fit:
    """One fit of the mesh to sparse points: a function of the photos, the points, the locked vertices and where it begins.

    Args:
        begin: (n, 3) float, world units: vertices before it.
    """

    def __init__(self, problem: Problem, begin: np.ndarray) -> None:
        self._problem, self.begin = problem, problem.scene.mesh.moved(begin)
        self._surface_points: dict[int, FeaturePoints] = {}
        self._point_fits: dict[int | None, PointFit] = {}

    @cached_property
    def error(self) -> float:
        """px: measured distance of the vertices from their true positions before the fit; 0 if it is not known."""
        problem = self._problem
        return measured_start_error(problem, self.begin.vertices) if len(problem.observed_points) else 0.0

    def allowed_error(self, number: int) -> float:
        """px: error of the vertices that the search for points of a number allows for; each for half of that of the one before."""
        return max(self.error / 2**number, FAR_ERROR)

    def needs_surface_points(self, vertices: np.ndarray) -> bool:
        """Whether points are sought near the mesh with vertices (n, 3), world units, that the sparse points alone have moved.

        A start that the sparse points hardly move is more accurate than single pixels' depths if its faces are small: lower than
        three windows of the search, each of which holds several. (ledger: surface sweep: which starts)
        """
        problem, error = self._problem, self.allowed_error(0)
        pixel = pixel_size(problem.cameras, self.begin.vertices)
        moved = np.linalg.norm(vertices - self.begin.vertices, axis=1) / pixel
        if float(np.quantile(np.nan_to_num(moved), 1 - FAR_PART)) >= FAR_PX:
            return True
        shrink = float(np.median([reduction(camera, error) for camera in problem.cameras]))
        footprint = typical_footprint(problem.scene, self.begin.vertices, problem.orientation, problem.options)
        return shrink * footprint >= 3 * (2 * HALF_WINDOW + 1)

    def surface_points(self, number: int, vertices: np.ndarray) -> FeaturePoints:
        """The points near the mesh with vertices (n, 3), world units, that the search of a number finds; kept.

        Raises:
            Cancelled: cancellation was requested.
        """
        if number not in self._surface_points:
            problem = self._problem
            with problem.work.doing("finding points near the surface"):
                sweep = SurfaceSweep(problem.scene.views, problem.evaluator.pool, problem.raise_if_cancelled)
                self._surface_points[number] = sweep.points(self.begin.moved(vertices), self.allowed_error(number))
        return self._surface_points[number]

    def point_fit(self, surface: int | None, begun: np.ndarray) -> PointFit:
        """The fit of a stage of gates; begun (n, 3): vertices at its beginning, world units."""
        if surface not in self._point_fits:
            problem = self._problem
            points = problem.observed_points
            if surface is not None:
                points = points.joined(self.surface_points(surface, begun))
            rays = PointRays(problem.cameras, points, problem.raise_if_cancelled)
            self._point_fits[surface] = PointFit(self.begin, rays, points.covariance)
        return self._point_fits[surface]

    def applies(self, stage: Stage, vertices: np.ndarray) -> bool:
        """Whether a stage has anything to do with vertices (n, 3), world units; others are left out."""
        if isinstance(stage, PointGates) and stage.surface is not None and not stage.is_wanted:
            if stage.surface == 0:
                return self.needs_surface_points(vertices)
            return self.allowed_error(stage.surface) < self.allowed_error(stage.surface - 1)
        if isinstance(stage, Axes) or (isinstance(stage, ClosestPoints) and stage.follows_axes):
            return len(relations(vertices, self.begin.faces, pixel_size(self._problem.cameras, vertices)).pairs) > 0
        return True


def points_on_mesh(
    scene: Scene, observed: FeaturePoints, vertices: np.ndarray, near: FeaturePoints | None
) -> np.ndarray:
    """(p, 3) float: the fitting points on the surface with vertices (n, 3), or all of them if their photos are not known.

    Points of the ground and the background lie near the boundary of the mesh too, but their own photos do not see the mesh at
    their place.

    Args:
        observed: see `observed_fitting_points`.
        near: points near the mesh, which count like those of the capture (ledger: surface sweep).
    """
    if len(observed) == 0:
        return fitting_points(scene)
    if near is not None:
        observed = observed.joined(near)
    cameras = [view.camera for view in scene.views]
    return observed.positions[points_on_surface(scene.mesh.moved(vertices), cameras, observed)]


class Fits:
    """The fits of a recorded run, by the moments at which they begin; found again where they are not in memory."""

    def __init__(self, problem: Problem, trace: Trace) -> None:
        self._problem, self._trace = problem, trace
        self._found: dict[int, Fit] = {}

    def begun_at(self, moment: int) -> Fit:
        """The fit that begins at a moment."""
        if moment not in self._found:
            self._found = {moment: Fit(self._problem, self._trace.vertices_at(moment))}
        return self._found[moment]

    def surface_points(self, history: History, begin: int, moment: int) -> FeaturePoints | None:
        """The points near the mesh that the fit from moment `begin` found last before a moment; None without any search.

        Raises:
            Cancelled: cancellation was requested.
        """
        searches = history.surface_begun(moment, begin)
        if not searches:
            return None
        number = max(searches)
        return self.begun_at(begin).surface_points(number, self._trace.vertices_at(searches[number]))

    def terms(self, history: History, position: SchedulePosition, moment: int) -> tuple[Term, ...]:
        """The terms of a sweep of a fit that begins at a moment; `position`: of its first step.

        Raises:
            Cancelled: cancellation was requested.
        """
        begin, stage = history.part_begun(moment, position), history.stage_of(position)
        fit, problem = self.begun_at(begin), self._problem
        stage_begun = self._trace.vertices_at(history.stage_begun(moment, position))
        vertices, sweep = self._trace.vertices_at(moment), position.sweep - stage.first_sweep
        if isinstance(stage, PointGates):
            return fit.point_fit(stage.surface, stage_begun).terms(vertices, stage.gates[sweep])
        mesh, pixel = problem.scene.mesh.moved(vertices), pixel_size(problem.cameras, vertices)
        if isinstance(stage, Axes) and not stage.is_broad:
            return narrow_terms(vertices, mesh.faces, pixel)
        near = self.surface_points(history, begin, moment)
        points = points_on_mesh(problem.scene, problem.observed_points, stage_begun, near)
        closest = closest_points(mesh, points, stage_begun)
        average = average_information(closest, vertices, ~problem.locked)
        if isinstance(stage, ClosestPoints):
            return closest, anchor(stage_begun, average)
        assert isinstance(stage, Axes)
        information = closest.hessians(vertices) / max(average, 1e-300)
        within = fit.error * 0.5**sweep
        return broad_terms(vertices, mesh.faces, pixel, information, fit.error, within, stage_begun)

    def share(self, other: "Fits", moment: int) -> None:
        """Take the fits of a run with the same past up to a moment."""
        self._found = {begin: fit for begin, fit in other._found.items() if begin < moment}

    def clear(self) -> None:
        """Forget what was found; it is found again when needed."""
        self._found.clear()

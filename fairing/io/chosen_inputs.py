"""The cameras and sparse points of a run or a triangulation: chosen before it, by the choices that its input leaves open."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from fairing.cameras.refinement import Refinement
from fairing.errors import Cancelled
from fairing.io.refined_once import refine_once
from fairing.io.scene_points import Progress, choose_points, needs_found_points
from fairing.scene import CamerasChoice, PointsChoice, Scene, SparsePoints, View


@dataclass(frozen=True, eq=False)
class ChosenInputs:
    """Photos with their chosen cameras, and the chosen sparse points.

    Attributes:
        views: with the corrected cameras, or as they were.
        sparse_points: None if there are none.
        warnings: lines about what differs from the given input.
        refinement: of the cameras; None if there was none.
    """

    views: tuple[View, ...]
    sparse_points: SparsePoints | None
    warnings: tuple[str, ...] = ()
    refinement: Refinement | None = None


def choose_inputs(
    name: str,
    views: Sequence[View],
    points: SparsePoints | None,
    points_choice: PointsChoice,
    cameras_choice: CamerasChoice,
    n_vertices: int | None,
    threads: int = 0,
    on_progress: Progress = lambda fraction, line: None,
    cancel_requested: Callable[[], bool] = lambda: False,
    skip_requested: Callable[[], bool] = lambda: False,
) -> ChosenInputs:
    """Refine the cameras and find points in the photos, where the choices require it.

    Args:
        name: of the scene: names files in the cache.
        points: given, or chosen before. Given ones follow corrected cameras, those found in the photos are found anew.
        cameras_choice: "automatic" is "refine".
        n_vertices: of the mesh; None without a mesh.
        threads: 0 for one a core.
        on_progress: called with the finished part of a piece of work, 0 to 1, and a line.
        cancel_requested: polled several times a second.
        skip_requested: polled alike; where it returns True, what is given is used.

    Raises:
        InputError: a photo or mask cannot be decoded.
        Cancelled: `cancel_requested` returned True.
    """
    # Points that were found before are found again with cameras that are corrected now.
    was_found = points is not None and points.origin == "own" and points_choice != "none"
    finds_points = was_found or needs_found_points(points, points_choice, n_vertices)
    refinement, notes = choose_cameras(
        name, views, cameras_choice, finds_points, threads, on_progress, cancel_requested, skip_requested
    )
    found = None
    if refinement is not None:
        views, found, refinement = refinement.corrected_views(views), refinement.found, replace(refinement, found=None)
        if refinement.taken and was_found:
            points, points_choice = None, "own"
        elif points_choice != "none":
            points = refinement.corrected_points(points)
    points, warnings = choose_points(
        name, views, points, points_choice, n_vertices, on_progress, cancel_requested, skip_requested, found
    )
    return ChosenInputs(tuple(views), points, (*notes, *warnings), refinement)


def inputs_of_demo(
    scene: Scene, points_choice: PointsChoice, cameras_choice: CamerasChoice, on_progress: Progress
) -> ChosenInputs:
    """The inputs of a triangulation in a demo scene, whose own choice of points and given cameras are the automatic ones.

    Arguments and exceptions as of `choose_inputs`.
    """
    points_choice = scene.points_choice if points_choice == "automatic" else points_choice
    cameras_choice = "given" if cameras_choice == "automatic" else cameras_choice
    chosen = choose_inputs(
        scene.name, scene.views, scene.sparse_points, points_choice, cameras_choice, None, on_progress=on_progress
    )
    return replace(chosen, warnings=(*scene.warnings, *chosen.warnings))


def choose_cameras(
    name: str,
    views: Sequence[View],
    cameras_choice: CamerasChoice,
    finds_points: bool,
    threads: int = 0,
    on_progress: Progress = lambda fraction, line: None,
    cancel_requested: Callable[[], bool] = lambda: False,
    skip_requested: Callable[[], bool] = lambda: False,
) -> tuple[Refinement | None, tuple[str, ...]]:
    """The refinement of the cameras, None if they are not refined, and a warning if that was skipped or photos look distorted.

    Args:
        finds_points: see `fairing.cameras.refine`; other arguments and exceptions as of `choose_inputs`.
    """
    if cameras_choice == "given":
        return None, ()
    try:
        found = refine_once(
            name, views, threads, on_progress, lambda: cancel_requested() or skip_requested(), finds_points,
            cameras_choice == "refine_lens",
        )  # fmt: skip
        return found, (found.lens_note,) * bool(found.lens_note)
    except Cancelled:
        if cancel_requested():
            raise
        return None, ("cameras were not refined, on request",)


def with_chosen_inputs(
    scene: Scene,
    threads: int = 0,
    on_progress: Progress = lambda fraction, line: None,
    cancel_requested: Callable[[], bool] = lambda: False,
    skip_requested: Callable[[], bool] = lambda: False,
) -> Scene:
    """The scene with the cameras of its `cameras_choice` and the sparse points of its `points_choice`.

    Arguments and exceptions as of `choose_inputs`.
    """
    chosen = choose_inputs(
        scene.name, scene.views, scene.sparse_points, scene.points_choice, scene.cameras_choice, len(scene.mesh.vertices),
        threads, on_progress, cancel_requested, skip_requested,
    )  # fmt: skip
    return with_inputs(scene, chosen, scene.views)


def with_inputs(scene: Scene, chosen: ChosenInputs, given: Sequence[View]) -> Scene:
    """The scene with inputs that were chosen for its photos as they were given."""
    refinement, given_cameras = chosen.refinement or scene.refinement, scene.given_cameras
    if given_cameras is None and chosen.refinement is not None and chosen.refinement.taken:
        given_cameras = tuple(view.camera for view in given)
    return replace(
        scene, views=chosen.views, sparse_points=chosen.sparse_points, points_choice="given", cameras_choice="given",
        given_cameras=given_cameras, refinement=refinement, warnings=(*scene.warnings, *chosen.warnings),
    )  # fmt: skip

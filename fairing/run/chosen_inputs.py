"""The cameras and sparse points of a run: chosen before its plan, by the choices that its scene leaves open."""

from collections.abc import Callable
from dataclasses import replace

from fairing.cameras.refinement import Refinement
from fairing.errors import Cancelled
from fairing.io.scene_points import Progress, needs_found_points, with_points
from fairing.run.refined_once import refine_once
from fairing.scene import Scene


def with_chosen_inputs(
    scene: Scene,
    threads: int = 0,
    on_progress: Progress = lambda fraction, line: None,
    cancel_requested: Callable[[], bool] = lambda: False,
    skip_requested: Callable[[], bool] = lambda: False,
) -> tuple[Scene, Refinement | None]:
    """The scene with the cameras of its `cameras_choice` and the sparse points of its `points_choice`.

    Args:
        threads: 0 for one a core.
        on_progress: called with the finished part of a piece of work, 0 to 1, and a line.
        cancel_requested: polled several times a second.
        skip_requested: polled alike; where it returns True, what is given is used.

    Returns:
        The scene, and the refinement of its cameras; None if there was none.

    Raises:
        InputError: a photo or mask cannot be decoded.
        Cancelled: `cancel_requested` returned True.
    """
    refinement = None
    if scene.cameras_choice != "given":
        adjusts_lens = scene.cameras_choice == "refine_lens"
        scene = replace(scene, cameras_choice="given")
        try:
            refinement = refine_once(
                scene, threads, on_progress, lambda: cancel_requested() or skip_requested(), _finds_points(scene),
                adjusts_lens,
            )  # fmt: skip
            scene = refinement.scene
        except Cancelled:
            if cancel_requested():
                raise
            scene = replace(scene, warnings=(*scene.warnings, "cameras were not refined, on request"))
    found = None if refinement is None else refinement.found
    return with_points(scene, on_progress, cancel_requested, skip_requested, found), refinement


def _finds_points(scene: Scene) -> bool:
    """Whether a run finds points in the photos: also where it found them before, with cameras that are corrected now."""
    points = scene.sparse_points
    was_found = points is not None and points.origin == "own"
    return was_found or needs_found_points(points, scene.points_choice, len(scene.mesh.vertices))

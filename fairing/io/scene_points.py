"""The sparse points of a scene: given with the capture, found in its photos, both or none."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from fairing.errors import Cancelled
from fairing.features.find import progress_line
from fairing.features.points import FeaturePoints
from fairing.io.capture import Capture
from fairing.io.feature_points import find_points_once
from fairing.io.points_choice import PointsChoice, are_enough
from fairing.scene import SparsePoints


def choose_points(
    capture: Capture,
    n_vertices: int | None,
    choice: PointsChoice,
    cache: Path,
    on_progress: Callable[[float, str], None] = lambda fraction, line: None,
    skip_requested: Callable[[], bool] = lambda: False,
) -> Capture:
    """The capture with the chosen sparse points, and a warning where they are not the given ones.

    With "automatic", points found in the photos replace given ones that are not enough (see `are_enough`) if they are more.

    Args:
        n_vertices: of the mesh; None without a mesh.
        cache: file (.npz) of the points found by an earlier call with the same photos and cameras.
        on_progress: called with the finished part, 0 to 1, and a line while points are found.
        skip_requested: polled several times a second while points are found; where it returns True, the given points are used.

    Raises:
        InputError: a photo or mask cannot be decoded.
    """
    given = capture.sparse_points
    n_given = 0 if given is None else len(given.positions)
    if choice == "given" or (choice == "automatic" and are_enough(n_given, n_vertices)):
        return capture
    if choice == "none":
        return capture._replace(sparse_points=None)
    n_photos = len(capture.views)

    def show(done: int, count: int) -> None:
        on_progress(done / count, progress_line(done, n_photos))

    try:
        found = find_points_once(capture.views, cache, on_progress=show, cancel_requested=skip_requested, is_cache=True)
    except Cancelled:
        warning = (
            f"no points were looked for in the photos, on request; the capture has {n_given or 'no'} sparse points"
        )
        return capture._replace(warnings=(*capture.warnings, warning))
    points, warning = _chosen(choice, given, n_given, found)
    return capture._replace(sparse_points=points, warnings=(*capture.warnings, warning))


def _chosen(
    choice: PointsChoice, given: SparsePoints | None, n_given: int, found: FeaturePoints
) -> tuple[SparsePoints | None, str]:
    """The points of a scene, and a line about them."""
    if len(found) == 0:
        return None if choice == "own" else given, f"no points were found in the photos: {found.reason}"
    if choice == "automatic" and len(found) <= n_given:
        return given, f"the capture has only {n_given} sparse points; the photos show no more ({len(found)} found)"
    if choice == "both" and given is not None and n_given > 0:
        line = f"{len(found)} points found in the photos were added to the {n_given} sparse points of the capture"
        return _joined(given, found.sparse_points()), line
    line = f"{len(found)} points were found in the photos; the capture has {n_given or 'no'} sparse points"
    return found.sparse_points(), line


def _joined(given: SparsePoints, own: SparsePoints) -> SparsePoints:
    return SparsePoints(
        np.concatenate([given.positions, own.positions]),
        np.concatenate([given.colors, own.colors]),
        np.concatenate([given.observations, own.observations + np.array([len(given.positions), 0])]),
        np.concatenate([given.pixels, own.pixels]),
        "both",
    )

"""The sparse points of a run: given with the capture, found in its photos, both or none."""

import hashlib
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fairing.errors import Cancelled
from fairing.features.find import progress_line
from fairing.features.points import FeaturePoints
from fairing.io.feature_points import find_points_once
from fairing.io.points_choice import are_enough
from fairing.photo import FilePhoto, Photo, ResizedPhoto, UndistortedPhoto
from fairing.scene import PointsChoice, Scene, SparsePoints, View
from fairing.util.cache_folder import cache_folder

Progress = Callable[[float, str], None]
"""Called with the finished part, 0 to 1, and a line while points are found."""


def with_points(
    scene: Scene,
    on_progress: Progress = lambda fraction, line: None,
    cancel_requested: Callable[[], bool] = lambda: False,
    skip_requested: Callable[[], bool] = lambda: False,
    found: FeaturePoints | None = None,
) -> Scene:
    """The scene with the sparse points of its `points_choice`, and a warning where they are not the given ones.

    Arguments and exceptions as of `choose_points`.
    """
    if scene.points_choice == "given":
        return scene
    points, warnings = choose_points(
        scene.name,
        scene.views,
        scene.sparse_points,
        scene.points_choice,
        len(scene.mesh.vertices),
        on_progress,
        cancel_requested,
        skip_requested,
        found,
    )
    return replace(scene, sparse_points=points, points_choice="given", warnings=(*scene.warnings, *warnings))


def choose_points(
    name: str,
    views: Sequence[View],
    given: SparsePoints | None,
    choice: PointsChoice,
    n_vertices: int | None,
    on_progress: Progress = lambda fraction, line: None,
    cancel_requested: Callable[[], bool] = lambda: False,
    skip_requested: Callable[[], bool] = lambda: False,
    found: FeaturePoints | None = None,
) -> tuple[SparsePoints | None, tuple[str, ...]]:
    """The chosen points, and a warning where they are not the given ones.

    With "automatic", points found in the photos replace given ones that are not enough (see `are_enough`) if they are more.
    Points that were found or joined before are used again. Found points are kept in the user's cache folder, and used as long as
    photos, cameras and the code that finds them stay the same.

    Args:
        name: of the scene: names the file in the cache.
        n_vertices: of the mesh; None without a mesh.
        cancel_requested: polled several times a second while points are found.
        skip_requested: polled alike; where it returns True, the given points are used.
        found: the points in the photos, if they were found with these cameras already.

    Raises:
        InputError: a photo or mask cannot be decoded.
        Cancelled: `cancel_requested` returned True.
    """
    n_given = 0 if given is None else given.n_observed
    was_chosen = given is not None and given.origin != "given" and choice in ("automatic", given.origin)
    if choice == "none":
        return None, ()
    if was_chosen or not needs_found_points(given, choice, n_vertices):
        return given, ()

    def show(done: int, count: int) -> None:
        on_progress(done / count, progress_line(done, len(views)))

    def ends() -> bool:
        return cancel_requested() or skip_requested()

    try:
        found = find_points_once(
            views,
            cache_file("points", name, views),
            on_progress=show,
            cancel_requested=ends,
            is_cache=True,
            found=found,
        )
    except Cancelled:
        if cancel_requested():
            raise
        line = f"no points were looked for in the photos, on request; the capture has {n_given or 'no'} sparse points"
        return given, (line,)
    points, line = _chosen(choice, given, n_given, found)
    return points, (line,)


def needs_found_points(given: SparsePoints | None, choice: PointsChoice, n_vertices: int | None) -> bool:
    """Whether the points of a choice are found in the photos; arguments as of `choose_points`."""
    if choice == "automatic":
        return not are_enough(0 if given is None else given.n_observed, n_vertices)
    return choice in ("own", "both")


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


def cache_file(kind: str, name: str, views: Sequence[View]) -> Path:
    """File in a folder of the user's cache for what is computed from these photos: one for a capture at one size."""
    photos = [(view.name, _file_of(view.photo), view.camera.width, view.camera.height) for view in views]
    digest = hashlib.sha256(repr((name, photos)).encode("utf-8", "surrogateescape")).hexdigest()[:16]
    return cache_folder() / kind / f"{re.sub(r'[^A-Za-z0-9._-]', '-', name)[:60]}-{digest}.npz"


def _file_of(photo: Photo) -> str:
    if isinstance(photo, (ResizedPhoto, UndistortedPhoto)):
        return _file_of(photo.whole)
    return str(photo.path.absolute()) if isinstance(photo, FilePhoto) else ""

"""`points`: feature points of a capture's own photos, as a COLMAP model and a point cloud."""

import shlex
from pathlib import Path

import numpy as np
from rich.console import Console

from app.cli.arguments import ALL_PHOTOS, CamerasArgument, PhotosArgument, SceneArgument
from app.cli.interrupt import Interrupt
from app.cli.lines import print_line
from app.cli.loading import load_with_progress
from app.cli.progress_bar import progress_bar
from app.files.named_scenes import is_named
from app.files.scene_source import SceneSource
from fairing.cameras import Refinement
from fairing.errors import Cancelled, InputError
from fairing.features import FeaturePoints
from fairing.features.find import progress_line
from fairing.io import locked_output_folder, read_capture
from fairing.io.chosen_inputs import choose_cameras
from fairing.io.colmap_write import check_cameras
from fairing.io.convert import write_capture
from fairing.io.feature_points import find_points_once
from fairing.io.point_cloud import write_point_cloud
from fairing.scene import CamerasChoice, View

CLOUD, STORED = "points.ply", "points.npz"


def points(
    scene: SceneArgument,
    out: Path,
    photos: PhotosArgument = ALL_PHOTOS,
    cameras: CamerasArgument = "automatic",
) -> int:
    """Triangulate points from the photos of a scene with known cameras; no mesh and no sparse points are needed.

    Args:
        out: Folder for a COLMAP text model (sparse/, images/) with the corrected cameras, points.ply, and points.npz with
            covariances.
    """
    return points_to_folder(SceneSource.typed(scene, None, photos, cameras=cameras), out, Console(stderr=True))


def points_to_folder(source: SceneSource, out: Path, console: Console) -> int:
    """Find the points and write them to a folder; points found there by an earlier command are used again.

    Returns:
        Exit code: 0, or 130 after a cancellation, with nothing written.

    Raises:
        InputError: whatever is wrong with the input, or there are no points.
    """
    if is_named(source.scene):
        loaded = load_with_progress(source, console)
        name, views, warnings, choice = loaded.name, loaded.views, loaded.warnings, loaded.cameras_choice
    else:
        capture = read_capture(source.scene, source.choice)
        name, views, warnings, choice = source.title, capture.views, capture.warnings, source.cameras
    check_cameras(views)
    try:
        with locked_output_folder(out):
            found, refinement = _find(name, views, choice, out / STORED, console)
            if refinement is not None:
                print_line(console, refinement.reason)
                if refinement.lens_note:
                    print_line(console, f"note: {refinement.lens_note}")
                views = refinement.corrected_views(views)
            if len(found) == 0:
                raise InputError(f"{source.scene}: no points found: {found.reason}")
            notes = write_capture(out, "colmap", views, found.sparse_points())
            write_point_cloud(out / CLOUD, found)
    except Cancelled:
        print_line(console, "cancelled; no points written")
        return 130
    for note in (*warnings, *notes):
        print_line(console, f"note: {note}")
    print_line(console, f"{summary_line(found, len(views))}; wrote {out / 'sparse'}, images, {CLOUD}, {STORED}")
    if refinement is not None and refinement.taken:
        words = ["eigenfairing", "fair", str(out), "--cameras", "given"]
        print_line(console, f"the capture {out} has the corrected cameras: `{shlex.join(words)}` uses them as they are")
    return 0


def summary_line(found: FeaturePoints, n_photos: int) -> str:
    """Number, photos a point, residual and accuracy of the points."""
    deviation = float(np.median(np.sqrt(np.linalg.eigvalsh(found.covariance)[:, 2])))
    return (
        f"{len(found)} points from {n_photos} photos: {found.n_views.mean():.1f} photos a point, mean residual "
        f"{found.residual.mean():.2f} px, median standard deviation along the least certain direction {deviation:.3g}"
    )


def _find(
    name: str, views: tuple[View, ...], choice: CamerasChoice, path: Path, console: Console
) -> tuple[FeaturePoints, Refinement | None]:
    """The points and the refinement of the cameras, with a progress bar; Ctrl-C cancels."""
    interrupt = Interrupt()
    with interrupt.listening(), progress_bar(console) as bar:
        task = bar.add_task("finding points", total=1.0)

        def show(done: float, line: str) -> None:
            bar.update(task, completed=done, description=line)

        refinement, _ = choose_cameras(
            name, views, choice, finds_points=True, on_progress=show, cancel_requested=lambda: interrupt.requested
        )
        found = find_points_once(
            views if refinement is None else refinement.corrected_views(views),
            path,
            on_progress=lambda done, count: show(done / count, progress_line(done, len(views))),
            cancel_requested=lambda: interrupt.requested,
            found=None if refinement is None else refinement.found,
        )
    return found, refinement

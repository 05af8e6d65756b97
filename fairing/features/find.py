"""Finds the feature points of calibrated photos: keypoints, matches, tracks, triangulation."""

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from typing import TypeVar

import numpy as np

from fairing.errors import Interrupted
from fairing.features.keypoints import Keypoints, detect_keypoints
from fairing.features.matching import match_pair
from fairing.features.options import FeatureOptions
from fairing.features.pairs import photo_pairs
from fairing.features.points import FeaturePoints
from fairing.features.tracks import Tracks, join_tracks
from fairing.features.triangulation import information, reprojection, triangulate_tracks
from fairing.scene import View

Progress = Callable[[int, int], None]
"""Called with the number of finished and of all parts."""

CANCEL_POLL = 0.2  # s
_Result = TypeVar("_Result")


def find_points(
    views: Sequence[View],
    options: FeatureOptions | None = None,
    threads: int = 0,
    on_progress: Progress | None = None,
    cancel_requested: Callable[[], bool] | None = None,
) -> FeaturePoints:
    """Points that at least `options.views` photos see, with known cameras and no mesh.

    The result does not depend on the number of threads.

    Args:
        threads: 0 for one a core.
        on_progress: called from this thread; photos, then pairs of photos.
        cancel_requested: polled several times a second.

    Raises:
        InputError: a photo or mask cannot be decoded.
        Interrupted: `cancel_requested` returned true.
    """
    options = options or FeatureOptions()
    if len(views) < options.views:
        return FeaturePoints.none(f"expected at least {options.views} photos, found {len(views)}")
    cameras = [view.camera for view in views]
    pairs = photo_pairs(cameras, options)
    if len(pairs) == 0:
        return FeaturePoints.none("no two photos are taken from different places in similar directions")
    progress, cancelled = on_progress or (lambda done, count: None), cancel_requested or (lambda: False)
    count = len(views) + len(pairs)
    pool = ThreadPoolExecutor(threads or os.cpu_count(), thread_name_prefix="features")
    try:
        run = _Run(pool, lambda done: progress(done, count), cancelled)
        progress(0, count)
        keypoints = run.all_of([lambda view=view: detect_keypoints(view, options) for view in views])
        matches = run.all_of(
            [
                lambda a=a, b=b: match_pair(keypoints[a], keypoints[b], cameras[a], cameras[b], options)
                for a, b in pairs.tolist()
            ]
        )
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
    if sum(len(found.pixels) for found in keypoints) == 0:
        return FeaturePoints.none("the photos show no keypoints: no texture, or masks exclude all of it")
    tracks = join_tracks([len(found.pixels) for found in keypoints], pairs, matches, options.views)
    if len(tracks.photos) == 0:
        return FeaturePoints.none(f"no keypoint was matched in {options.views} photos; check the cameras")
    if cancelled():
        raise Interrupted
    return _triangulated(views, keypoints, tracks, options)


def _triangulated(
    views: Sequence[View], keypoints: Sequence[Keypoints], tracks: Tracks, options: FeatureOptions
) -> FeaturePoints:
    cameras = [view.camera for view in views]
    first = np.concatenate([[0], np.cumsum([len(found.pixels) for found in keypoints])])
    index = first[tracks.photos] + tracks.keypoints
    pixels = np.concatenate([found.pixels for found in keypoints])[index]
    colors = np.concatenate([found.colors for found in keypoints])[index]
    found = triangulate_tracks(cameras, tracks.offsets, tracks.photos, pixels, options)
    if not found.is_good.any():
        return FeaturePoints.none("no track's rays meet in one point; check the cameras")
    photos, pixels, colors = tracks.photos[found.kept], pixels[found.kept], colors[found.kept]
    track = np.repeat(np.arange(len(found.is_good)), np.diff(tracks.offsets))[found.kept]
    positions, n_views = found.positions[found.is_good], np.bincount(track, minlength=len(found.is_good))[found.is_good]
    starts = np.concatenate([[0], np.cumsum(n_views)])
    row = np.repeat(np.arange(len(positions)), n_views)
    P = np.array([camera.image_from_world for camera in cameras])
    off = reprojection(P, positions[row], photos, pixels)
    sigma = np.sqrt((off**2).sum() / (2 * n_views - 3).sum())
    covariance = sigma**2 * np.linalg.inv(information(P, positions, photos, row, starts[:-1]))
    mean_color = np.add.reduceat(colors.astype(float), starts[:-1]) / n_views[:, None]
    return FeaturePoints(
        positions, covariance, np.round(mean_color).astype(np.uint8), starts, photos, pixels,
        np.add.reduceat(np.linalg.norm(off, axis=1), starts[:-1]) / n_views, float(sigma),
    )  # fmt: skip


class _Run:
    """Parts of the work on a pool of threads, with progress and cancellation."""

    def __init__(self, pool: ThreadPoolExecutor, progress: Callable[[int], None], cancelled: Callable[[], bool]) -> None:
        self._pool, self._progress, self._cancelled = pool, progress, cancelled
        self._done = 0

    def all_of(self, parts: Iterable[Callable[[], _Result]]) -> list[_Result]:
        """The results of all parts, in their order."""
        futures = [self._pool.submit(part) for part in parts]
        waiting = set(futures)
        while waiting:
            if self._cancelled():
                raise Interrupted
            finished, waiting = wait(waiting, timeout=CANCEL_POLL, return_when=FIRST_COMPLETED)
            for future in finished:
                future.result()  # raises what the part raised
                self._done += 1
                self._progress(self._done)
        return [future.result() for future in futures]

"""Finds the feature points of calibrated photos: keypoints, matches, tracks, triangulation."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from typing import TypeVar

import numpy as np

from fairing.camera import Camera
from fairing.errors import Cancelled
from fairing.features.keypoints import Keypoints, detect_keypoints, relative_sigma
from fairing.features.matching import match_pair
from fairing.features.options import FeatureOptions
from fairing.features.pairs import photo_pairs
from fairing.features.points import FeaturePoints, points_of_tracks
from fairing.features.tracks import Tracks, join_tracks
from fairing.features.triangulation import Triangulated, triangulate_tracks
from fairing.scene import View

Progress = Callable[[int, int], None]
"""Called with the amount of finished and of all work, in units of one pair of photos."""

PHOTO_WORK = 8  # pairs that take as long as one photo's keypoints, as measured on two captures

_Result = TypeVar("_Result")


def find_points(
    views: Sequence[View],
    options: FeatureOptions | None = None,
    threads: int = 0,
    on_progress: Progress | None = None,
    cancel_requested: Callable[[], bool] | None = None,
    keypoints: Sequence[Keypoints] | None = None,
) -> FeaturePoints:
    """The points that at least `options.views` photos show, from photos and cameras alone.

    The result does not depend on the number of threads. Without any point, its `reason` explains why.

    Args:
        threads: 0 for one a core.
        on_progress: called from this thread.
        cancel_requested: polled several times a second from this thread.
        keypoints: of each photo, as `find_keypoints` returns them for the same options; default: detected here.

    Raises:
        InputError: a photo or mask cannot be decoded.
        Cancelled: `cancel_requested` returned true. A photo being searched is finished in the background.
    """
    chosen = options or FeatureOptions()
    if len(views) < chosen.views:
        return FeaturePoints.none(f"expected at least {chosen.views} photos, found {len(views)}")
    cameras = [view.camera for view in views]
    pairs = photo_pairs(cameras, chosen)
    if len(pairs) == 0:
        return FeaturePoints.none("no two photos are taken from different places in similar directions")
    amount = (len(views) * PHOTO_WORK if keypoints is None else 0) + len(pairs) + 1
    with _Work(threads, amount, on_progress, cancel_requested) as work:
        detected = _detected(work, views, chosen) if keypoints is None else keypoints
        if sum(len(found) for found in detected) == 0:
            return FeaturePoints.none("the photos show no keypoints: there is no texture, or masks exclude it")
        matches = work.all_of(
            [
                lambda a=a, b=b: match_pair(detected[a], detected[b], cameras[a], cameras[b], chosen)
                for a, b in pairs.tolist()
            ]
        )
        counts = [len(found) for found in detected]
        (tracks,) = work.all_of([lambda: join_tracks(counts, pairs, matches, chosen.views)])
        if len(tracks) == 0:
            return FeaturePoints.none(
                f"no keypoint was matched in {chosen.views} photos; check the cameras, or add photos that overlap more"
            )
        return _triangulated(work, cameras, detected, tracks, chosen)


def find_keypoints(
    views: Sequence[View],
    options: FeatureOptions | None = None,
    threads: int = 0,
    on_progress: Progress | None = None,
    cancel_requested: Callable[[], bool] | None = None,
    most: int = 0,
) -> list[Keypoints]:
    """The keypoints of each photo, which do not depend on cameras. Arguments and exceptions as of `find_points`; further:

    Args:
        most: of each photo only so many, the strongest; 0 for all.
    """
    with _Work(threads, len(views) * PHOTO_WORK, on_progress, cancel_requested) as work:
        return _detected(work, views, options or FeatureOptions(), most)


def progress_line(done: int, n_photos: int) -> str:
    """One line about the work that is under way, of the amount `done` that `find_points` reports."""
    photo = done // PHOTO_WORK + 1
    return f"finding points: photo {photo} of {n_photos}" if photo <= n_photos else "finding points: matching photos"


def _detected(work: "_Work", views: Sequence[View], options: FeatureOptions, most: int = 0) -> list[Keypoints]:
    return work.all_of([lambda view=view: detect_keypoints(view, options, most) for view in views], PHOTO_WORK)


def _triangulated(
    work: "_Work", cameras: list[Camera], keypoints: Sequence[Keypoints], tracks: Tracks, options: FeatureOptions
) -> FeaturePoints:
    first = np.concatenate([[0], np.cumsum([len(found) for found in keypoints])])
    index = first[tracks.photos] + tracks.keypoints
    pixels = np.concatenate([found.pixels for found in keypoints])[index]
    sigma = relative_sigma(np.concatenate([found.scale for found in keypoints])[index])
    colors = np.concatenate([found.colors for found in keypoints])[index]

    at_once = 10_000  # tracks

    def block(start: int) -> Triangulated:
        offsets = tracks.offsets[start : start + at_once + 1]
        seen = slice(offsets[0], offsets[-1])
        return triangulate_tracks(
            cameras, offsets - offsets[0], tracks.photos[seen], pixels[seen], sigma[seen], options
        )

    blocks = work.all_of([lambda s=s: block(s) for s in range(0, len(tracks), at_once)], 0)
    found = Triangulated(*(np.concatenate(parts) for parts in zip(*blocks, strict=True)))
    return points_of_tracks(cameras, tracks, found, pixels, sigma, colors)


class _Work:
    """Parts of the work on a pool of threads, with progress and cancellation."""

    def __init__(
        self,
        threads: int,
        amount: int,
        on_progress: Progress | None,
        cancel_requested: Callable[[], bool] | None,
    ) -> None:
        self._pool = ThreadPoolExecutor(threads or os.cpu_count() or 1, thread_name_prefix="features")
        self._amount, self._done = amount, 0
        self._progress, self._cancelled = on_progress or (lambda done, count: None), cancel_requested or (lambda: False)

    def __enter__(self) -> "_Work":
        self._progress(0, self._amount)
        return self

    def __exit__(self, *_: object) -> None:
        """Start no further part."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def all_of(self, parts: Sequence[Callable[[], _Result]], amount: int = 1) -> list[_Result]:
        """The results of all parts, in their order; each part counts as `amount` in the progress."""
        futures = [self._pool.submit(part) for part in parts]
        waiting = set(futures)
        while waiting:
            if self._cancelled():
                raise Cancelled
            finished, waiting = wait(waiting, timeout=0.2, return_when=FIRST_COMPLETED)
            for future in finished:
                future.result()  # raises what the part raised
                self._done += amount
                self._progress(self._done, self._amount)
        return [future.result() for future in futures]

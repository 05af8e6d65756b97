"""Photos stored turned, with an orientation tag: whether their cameras were calibrated on the stored or the upright picture.

Where only one of the two fits the camera's size, `fairing.io.calibrated` has taken it. Where both fit (square photos, turned
by 180 degrees, mirrored, formats that state no sizes), other photos of the capture decide, whose sizes leave no choice, else
the observed points: at the right pixels the photos that see a point agree on its brightness. Else the user is asked.
"""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from fairing.errors import InputError
from fairing.io.capture import Capture, listed
from fairing.photo import FilePhoto
from fairing.scene import SparsePoints, View
from fairing.util.orientation import AS_STORED, swaps_sides, turned_size

# The correlation of a photo's brightness at its points with that in other photos must reach the first number over at least
# so many observations, and exceed that of the other orientation by so many standard deviations of Fisher's atanh, but never
# by less than the last number: a wrong orientation of a flat scene seen along one line agrees, too, if less.
_AGREEMENT = 0.5
_MIN_OBSERVATIONS = 20
_DEVIATIONS = 5
_LEAD = 0.2
_MOST_PHOTOS = 12
"""Photos decoded to decide."""
_BLUR = 1.5  # px: observed pixels of a point lie within a pixel of each other


def settle_orientations(capture: Capture) -> Capture:
    """The capture with every photo as it was calibrated, and a note about those that are turned.

    Raises:
        InputError: both orientations of a photo fit, and nothing decides.
    """
    by_size = {v for v, view in enumerate(capture.views) if _orientation(view) != AS_STORED}
    others = {
        v: other
        for v, view in enumerate(capture.views)
        if v not in by_size
        and isinstance(view.photo, FilePhoto)
        and (other := view.photo.other_orientation) != AS_STORED
    }
    stored_by_size = {v for v, other in others.items() if _only_stored_fits(capture, v, other)}
    open_ones = {v: other for v, other in others.items() if v not in stored_by_size}
    if open_ones:
        is_decided = bool(by_size) != bool(stored_by_size)
        if bool(by_size) if is_decided else _points_decide(capture, open_ones):
            capture = capture._replace(views=_turned(capture, open_ones))
    names = [view.name for view in capture.views if _orientation(view) != AS_STORED]
    if not names:
        return capture
    note = f"photos turned upright by their orientation tag: {len(names)} ({listed(names)})"
    return capture._replace(warnings=(*capture.warnings, note))


def _orientation(view: View) -> int:
    return view.photo.orientation if isinstance(view.photo, FilePhoto) else AS_STORED


def _only_stored_fits(capture: Capture, v: int, other: int) -> bool:
    camera = capture.views[v].camera
    return swaps_sides(other) and camera.width != camera.height and not capture.sizes_from_photos


def _turned(capture: Capture, others: dict[int, int]) -> tuple[View, ...]:
    """The views with the given photos in their other orientation."""
    views = list(capture.views)
    for v, other in others.items():
        photo, camera = views[v].photo, views[v].camera
        assert isinstance(photo, FilePhoto)
        if swaps_sides(other) and camera.width != camera.height:
            raise _question(views[v], other)  # the format states no size, so its camera was built for the stored one
        views[v] = replace(views[v], photo=replace(photo, orientation=other))
    return tuple(views)


def _points_decide(capture: Capture, others: dict[int, int]) -> bool:
    """Whether the photos are meant in their other orientations."""
    v, other = next(iter(others.items()))
    points = capture.sparse_points
    if points is None or len(points.observations) < _MIN_OBSERVATIONS:
        raise _question(capture.views[v], other)
    chosen = _overlapping(points, list(others), len(capture.views))
    stored_correlation, n = _agreement(capture.views, points, chosen, others, turn=False)
    turned_correlation, _ = _agreement(capture.views, points, chosen, others, turn=True)
    lead = np.arctanh(turned_correlation) - np.arctanh(stored_correlation)
    needed = max(_LEAD, _DEVIATIONS * np.sqrt(2 / max(n - 3, 1)))
    if max(stored_correlation, turned_correlation) < _AGREEMENT or abs(lead) < needed:
        raise _question(capture.views[v], other)
    return lead > 0


def _question(view: View, other: int) -> InputError:
    return InputError(
        f"photo {view.name}: its file has the orientation tag {other}, and it fits its camera both as stored and turned; if "
        "the camera was calibrated on the upright picture, turn the files (mogrify -auto-orient), else remove the tag "
        "(exiftool -Orientation=)"
    )


def _overlapping(points: SparsePoints, questioned: list[int], n_views: int) -> list[int]:
    """The photos to decode: of those in question the ones with most points, and those that see most points of these."""
    counts = np.bincount(points.observations[:, 1], minlength=n_views)
    first = sorted(questioned, key=lambda v: -counts[v])[: _MOST_PHOTOS // 2]
    seen = np.isin(points.observations[:, 0], points.observations[np.isin(points.observations[:, 1], first), 0])
    shared = np.bincount(points.observations[seen, 1], minlength=n_views)
    rest = [v for v in np.argsort(-shared, kind="stable").tolist() if v not in first and shared[v] > 0]
    return first + rest[: _MOST_PHOTOS - len(first)]


def _agreement(
    views: Sequence[View], points: SparsePoints, chosen: list[int], others: dict[int, int], turn: bool
) -> tuple[float, int]:
    """Correlation of the brightness at the points of the photos in question with its mean in the other photos, and its size.

    Brightness is relative to the photo's mean and deviation at its points, since exposures differ.

    Args:
        turn: whether the photos in question are turned into their other orientations.
    """
    total, count = np.zeros(len(points.positions)), np.zeros(len(points.positions))
    samples = {}
    for v in chosen:
        photo, pixels = views[v].photo, points.pixels[points.observations[:, 1] == v]
        ids = points.observations[points.observations[:, 1] == v, 0]
        if turn and v in others:
            assert isinstance(photo, FilePhoto)
            # Formats that state no sizes give pixels from the middle; a lens, built for the stored size, matters little.
            pixels = pixels + (np.array(turned_size(photo.size, others[v])) - photo.size) / 2
            keeps_size = turned_size(photo.size, others[v]) == photo.size
            photo = replace(photo, lens=photo.lens if keeps_size else None, orientation=others[v])
        pixels = np.rint(pixels).astype(int)
        inside = ((pixels >= 0) & (pixels < photo.size)).all(axis=1)
        if inside.sum() < 2:
            continue
        grey = cv2.GaussianBlur(cv2.cvtColor(photo.load(), cv2.COLOR_RGB2GRAY), (0, 0), _BLUR)
        values = grey[pixels[inside, 1], pixels[inside, 0]].astype(float)
        values = (values - values.mean()) / (values.std() or 1.0)
        samples[v] = ids[inside], values
        np.add.at(total, ids[inside], values)
        np.add.at(count, ids[inside], 1)
    own, other = [], []
    for v in others.keys() & samples.keys():
        ids, values = samples[v]
        shared = count[ids] > 1
        own.append(values[shared])
        other.append((total[ids[shared]] - values[shared]) / (count[ids[shared]] - 1))
    own, other = np.concatenate(own or [np.zeros(0)]), np.concatenate(other or [np.zeros(0)])
    if len(own) < _MIN_OBSERVATIONS or own.std() == 0 or other.std() == 0:
        return 0.0, 0
    return min(float(np.corrcoef(own, other)[0, 1]), 0.9999), len(own)

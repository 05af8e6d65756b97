"""The points that become vertices where there is no mesh: in a box that was found or chosen, or all."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fairing.errors import InputError
from fairing.scene import Around, BoxCorners, SparsePoints, View
from fairing.triangulation.object_box import ObjectBox, box_of_corners, find_object

FEWEST = 3


def points_around(
    views: Sequence[View], points: SparsePoints, around: Around, corners: BoxCorners | None = None
) -> tuple[SparsePoints, ObjectBox | None, str]:
    """The points that become vertices, the box if they are those in one, and a line about them; empty if all are taken.

    Args:
        corners: of a chosen box, which replaces the object's.

    Raises:
        InputError: the object is chosen, but there is none; or the chosen box is none, or holds no points.
    """
    if corners is not None:
        box = chosen_box(corners, points)
        words = (
            f"{box_words(corners)}: {box.n_points} of {len(points.positions)} sparse points; the mesh covers them alone"
        )
        return points_inside(points, box), box, words
    if around == "everything":
        return points, None, ""
    box = find_object(views, points)
    if box is None or not (box.orbited or around == "object"):
        if around == "object":
            raise InputError("--around object: no points were found that most photos look at; use --around everything")
        return points, None, ""
    return points_inside(points, box), box, _found_line(box, len(points.positions))


def check_corners(corners: BoxCorners, around: Around = "automatic") -> None:
    """Check the corners x0 y0 z0 x1 y1 z1 of a box.

    Raises:
        InputError: they are no corners of a box, or the points are chosen by `around` already.
    """
    words = box_words(corners)
    if around != "automatic":
        raise InputError(
            f"{words}: chooses the points to triangulate, as --around {around} does; leave one of them out"
        )
    for name, low, high in zip("xyz", corners[:3], corners[3:], strict=True):
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise InputError(
                f"{words}: expected x0 y0 z0 x1 y1 z1 with {name}0 < {name}1, found {low:g} and {high:g}; give the corner with "
                "the smallest coordinates first"
            )


def chosen_box(corners: BoxCorners, points: SparsePoints) -> ObjectBox:
    """The box with these corners.

    Raises:
        InputError: they are no corners of a box, or fewer than three points are in it.
    """
    check_corners(corners)
    box = box_of_corners(corners)
    count = int(box.contains(points.positions).sum())
    if count < FEWEST:
        low, high = np.quantile(points.positions, (0.05, 0.95), axis=0)
        raise InputError(
            f"{box_words(corners)}: expected at least {FEWEST} sparse points in the box, found {count} of "
            f"{len(points.positions)}; nine tenths of them along each axis are in "
            f"{box_words([*low.tolist(), *high.tolist()])}"
        )
    return replace(box, n_points=count)


def box_words(corners: Sequence[float]) -> str:
    """The option that chooses a box, without exponents, to a ten thousandth of its size."""
    size = max(high - low for low, high in zip(corners[:3], corners[3:], strict=True))
    if not (np.isfinite(corners).all() and 0 < size < np.inf):
        return " ".join(["--box", *(f"{number:g}" for number in corners)])
    decimals = max(0, 4 - int(np.floor(np.log10(size))))
    return " ".join(["--box", *(f"{number:.{decimals}f}" for number in corners)])


def _found_line(box: ObjectBox, n_points: int) -> str:
    """The line about the object's box, of a capture with n points."""
    width, depth, height = box.size
    low, high = box.bounds
    return (
        f"object's box: {width:.3g} x {depth:.3g}, {height:.3g} high, with {box.n_points} of {n_points} sparse points, "
        f"because {box.reason}; the mesh covers it alone (--around everything: all points; to choose another box change "
        f"{box_words([*low.tolist(), *high.tolist()])})"
    )


def points_inside(points: SparsePoints, box: ObjectBox) -> SparsePoints:
    """The points in a box."""
    kept = box.contains(points.positions)
    new_index = np.cumsum(kept) - 1
    seen = kept[points.observations[:, 0]]
    observations = points.observations[seen].copy()
    observations[:, 0] = new_index[observations[:, 0]]
    return SparsePoints(points.positions[kept], points.colors[kept], observations, points.pixels[seen], points.origin)

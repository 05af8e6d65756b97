"""Table of intrinsics and radial distortion before and after refinement, for the photos of each camera."""

from collections.abc import Sequence

import numpy as np

from app.html import text
from fairing.camera import Camera
from fairing.cameras.corrected_scene import found_lens
from fairing.scene import View

_DECIMALS = 6  # of intrinsics in px: photos whose intrinsics agree so far were taken by one camera


def lens_table(views: Sequence[View], given: Sequence[Camera]) -> str:
    """Markup of the table; "" if no intrinsics were refined.

    Args:
        views: with the corrected cameras.
        given: their cameras before.
    """
    lenses = [_lens(view) for view in views]
    changes = [np.append(K - camera.K, k) for (K, k), camera in zip(lenses, given, strict=True)]
    if not np.round(changes, _DECIMALS).any():  # K comes of a camera's matrix, so its last digits change
        return ""
    groups: dict[tuple[float, ...], list[int]] = {}
    for v, ((K, k), camera) in enumerate(zip(lenses, given, strict=True)):
        key = np.round(np.concatenate([camera.K.ravel(), K.ravel(), k]), _DECIMALS).tolist()
        groups.setdefault(tuple(key), []).append(v)
    rows = "".join(
        _rows(photos, views[photos[0]].name, given[photos[0]].K, *lenses[photos[0]]) for photos in groups.values()
    )
    return f"<table class='photos lens'><tr><th>Lens</th><th class='n'>given</th><th class='n'>corrected</th></tr>{rows}</table>"


def _lens(view: View) -> tuple[np.ndarray, np.ndarray]:
    """Intrinsics (3, 3), px, of a photo as it was taken, and k_1 and k_2 (2,)."""
    lens = found_lens(view)
    return (view.camera.K, np.zeros(2)) if lens is None else (lens.K, lens.distortion[:2])


def _rows(photos: Sequence[int], first: str, before: np.ndarray, after: np.ndarray, k: np.ndarray) -> str:
    """Rows of one camera; photos: which it took, `first` the name of the first one."""
    others = f" and {len(photos) - 1} more" if len(photos) > 1 else ""
    values = [
        ("Focal length, px", before[0, 0], after[0, 0], 2),
        ("Principal point x, px", before[0, 2], after[0, 2], 2),
        ("Principal point y, px", before[1, 2], after[1, 2], 2),
        ("Radial distortion k<sub>1</sub>", 0.0, k[0], 4),
        ("Radial distortion k<sub>2</sub>", 0.0, k[1], 4),
    ]
    rows = "".join(
        f"<tr><td>{name}</td><td class='n'>{_figure(old, digits)}</td><td class='n'>{_figure(new, digits)}</td></tr>"
        for name, old, new, digits in values
    )
    return f"<tr><td class='one' colspan='3'>{text(first)}{others}</td></tr>{rows}"


def _figure(value: float, digits: int) -> str:
    """With a fixed number of decimals, without a negative zero."""
    return f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "\u2212")

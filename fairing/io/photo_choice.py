"""Photo choice: the scene format, photos left out, masks, weights, and the resolution to work at."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from fairing.errors import InputError
from fairing.io.capture import Capture, files_below, listed, reading
from fairing.photo import FilePhoto, Mask
from fairing.scene import SparsePoints, View

SceneFormat = Literal[
    "colmap", "bundler", "openmvg", "meshroom", "transforms.json", "middlebury", "strecha", "matrices", "scene.json"
]
MASK_FOLDER = "masks"
_SMALLEST_SCALE = 0.05
_PNG = frozenset({".png"})


@dataclass(frozen=True)
class PhotoChoice:
    """Photos are named as in the list that `eigenfairing check` prints; * and ? are wildcards."""

    leave_out: tuple[str, ...] = ()
    """Photos to leave out, by name: `--leave-out 0003.jpg "night/*"`."""
    masks: Path | None = None
    """Folder of masks: for photo a.jpg the image a.jpg.png, black where the photo is ignored (as in COLMAP). Default:
    the folder `masks` beside the cameras, if there is one."""
    photo_weights: tuple[str, ...] = ()
    """Weights of photos relative to the others: `--photo-weights 0003.jpg=0.5 "night/*=0.1"`. Default: 1 each."""
    photo_scale: float = 1.0
    """Scale photos to this fraction of their width and height, 0.05 to 1: less memory and time, less accuracy."""
    format: SceneFormat | None = None
    """Format to read where a folder holds cameras in several. Default: the readable one with the most photos, then with
    sparse points."""


def check_format(name: str | None, where: object) -> SceneFormat | None:
    """A format read from a file.

    Raises:
        InputError: there is no format of this name.
    """
    for known in get_args(SceneFormat):
        if name == known:
            return known
    if name is not None:
        raise InputError(f"{where}: format: expected one of {', '.join(get_args(SceneFormat))}, found {name[:40]!r}")
    return None


def apply_choice(capture: Capture, choice: PhotoChoice, folder: Path) -> Capture:
    """The capture reduced to the chosen photos, with masks and weights, at the chosen scale.

    Args:
        folder: the folder of the cameras.

    Raises:
        InputError: no photo has a given name, a weight is not a positive number, or a mask cannot be read or has
            another size than its photo.
    """
    names = [view.name for view in capture.views]
    if not _SMALLEST_SCALE <= choice.photo_scale <= 1:
        raise InputError(f"--photo-scale: expected {_SMALLEST_SCALE:g} to 1, found {choice.photo_scale:g}")
    left_out = _matching(choice.leave_out, names, "--leave-out")
    weights = {view.name: view.weight for view in capture.views}
    for text in choice.photo_weights:
        pattern, _, number = text.rpartition("=")
        weight = _weight(number, text)
        for name in _matching((pattern,), names, "--photo-weights"):
            weights[name] = weight
    if choice.masks is not None and not choice.masks.is_dir():
        raise InputError(f"--masks {choice.masks}: expected a folder, found none")
    # Masks named by the format are used where the folder has none.
    own = {view.mask.path for view in capture.views if view.mask is not None}
    masks, warnings = _masks(choice.masks or folder / MASK_FOLDER, names, own)
    kept = [i for i, name in enumerate(names) if name not in left_out]
    views = tuple(
        replace(view, weight=weights[view.name], mask=_mask_of(view, masks))
        for view in (capture.views[i] for i in kept)
    )
    if left_out:
        warnings = (f"photos left out on request: {len(left_out)} ({listed(sorted(left_out))})", *warnings)
    sparse = capture.sparse_points
    if sparse is not None and left_out:
        sparse = _of_views(sparse, kept, len(names))
    if choice.photo_scale != 1:
        resized = tuple(_resized(view, choice.photo_scale) for view in views)
        sparse = None if sparse is None else _at_sizes(sparse, views, resized)
        views = resized
    return capture._replace(views=views, sparse_points=sparse, warnings=(*capture.warnings, *warnings))


def _matching(patterns: Iterable[str], names: Sequence[str], flag: str) -> set[str]:
    found: set[str] = set()
    for pattern in patterns:
        matching = {name for name in names if name == pattern or fnmatchcase(name, pattern)}
        if not matching:
            raise InputError(f"{flag} {pattern}: no photo has this name; the photos are {listed(names)}")
        found |= matching
    return found


def _weight(number: str, text: str) -> float:
    try:
        weight = float(number)
    except ValueError:
        weight = float("nan")
    if not 0 < weight < float("inf"):
        raise InputError(f"--photo-weights {text}: expected a photo's name, =, and a number of more than 0")
    return weight


def _masks(folder: Path, names: Sequence[str], own: set[Path]) -> tuple[dict[str, Path], tuple[str, ...]]:
    """Masks by photo, and warnings. The mask of images/a.jpg may also be named a.jpg.png.

    Args:
        own: masks named by the capture's format.
    """
    if not folder.is_dir():
        return {}, ()
    with reading(folder, "a folder of masks"):
        files = {path.relative_to(folder).as_posix(): path for path in files_below(folder, _PNG)}
    masks = {}
    for name in names:
        for file in (f"{name}.png", f"{name.removeprefix('images/')}.png"):
            if file in files:
                masks[name] = files[file]
    warnings = []
    if masks:
        warnings.append(f"masks: {len(masks)} of {len(names)} photos have one in {folder}")
    unused = [file for file, path in files.items() if path not in masks.values() and path not in own]
    if unused:
        warnings.append(
            f"masks that belong to no photo: {len(unused)} ({listed(unused)}); name a mask as its photo with .png appended"
        )
    return masks, tuple(warnings)


def _mask_of(view: View, masks: dict[str, Path]) -> Mask | None:
    if view.name not in masks:
        return view.mask
    return Mask(masks[view.name], view.photo.lens if isinstance(view.photo, FilePhoto) else None)


def _of_views(sparse: SparsePoints, kept: list[int], n_views: int) -> SparsePoints:
    """The points with the observations of the kept views; points without observations are kept."""
    new_index = np.full(n_views, -1)
    new_index[kept] = np.arange(len(kept))
    seen = new_index[sparse.observations[:, 1]] >= 0
    observations = sparse.observations[seen].copy()
    observations[:, 1] = new_index[observations[:, 1]]
    return SparsePoints(sparse.positions, sparse.colors, observations, sparse.pixels[seen])


def _resized(view: View, scale: float) -> View:
    return view.resized(*(max(1, round(scale * size)) for size in (view.camera.width, view.camera.height)))


def _at_sizes(sparse: SparsePoints, before: Sequence[View], after: Sequence[View]) -> SparsePoints:
    """The points with their observations scaled to views of other sizes."""
    if not before:
        return sparse
    factors = np.array(
        [
            (b.camera.width / a.camera.width, b.camera.height / a.camera.height)
            for a, b in zip(before, after, strict=True)
        ]
    )
    pixels = (sparse.pixels + 0.5) * factors[sparse.observations[:, 1]] - 0.5
    return replace(sparse, pixels=pixels)

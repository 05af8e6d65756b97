"""Photo choice: the scene format, photos left out, masks, weights, and the resolution to work at."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from fairing.errors import InputError
from fairing.io.capture import Capture, MissingPhoto, listed
from fairing.io.mask_files import masks_of
from fairing.io.mesh_place import in_frame
from fairing.placement.frames import MeshFrame, parse_axes
from fairing.scene import WEIGHTS, SparsePoints, View
from fairing.util.plugins import offered

SceneFormat = Literal[
    "colmap", "bundler", "openmvg", "meshroom", "opensfm", "visualsfm", "metashape", "realityscan", "transforms.json",
    "middlebury", "strecha", "matrices", "scene.json",
]  # fmt: skip
READERS_GROUP = "fairing.readers"
"""Of the entry points by which packages offer readers."""
_SMALLEST_SCALE = 0.05
SMALLEST_MESH_SCALE = 1e-9


@dataclass(frozen=True)
class PhotoChoice:
    """Photos are named as in the list that `eigenfairing check` prints; * and ? are wildcards."""

    leave_out: tuple[str, ...] = ()
    """Photos to leave out, by name: `--leave-out 0003.jpg "night/*"`."""
    masks: Path | None = None
    """Folder of masks: for photo a.jpg the image a.jpg.png (as in COLMAP), a.png or a_mask.png, black where the photo is
    ignored. Default: the folder `masks` beside the cameras, if there is one, or images a_mask.png beside the photos."""
    photo_weights: tuple[str, ...] = ()
    """Weights of photos relative to the others: `--photo-weights 0003.jpg=0.5 "night/*=0.1"`. Default: 1 each."""
    photo_scale: float = 1.0
    """Scale photos to this fraction of their width and height, 0.05 to 1: less memory and time, less accuracy."""
    mesh_axes: str = "x,y,z"
    """Axes of the mesh, if they differ from the cameras': where its x, y, z lie along the cameras' axes. A mesh that is y up
    among cameras that are z up: `--mesh-axes=x,-z,y`. Results are in the mesh's frame."""
    mesh_scale: float = 1.0
    """Unit of the mesh in units of the cameras' world, 1e-9 to 1e9: 0.001 for a mesh in millimetres among cameras in metres."""
    format: str | None = None
    """Format to read where a folder holds cameras in several, such as colmap, bundler, scene.json or that of an installed
    package. Default: the readable one with the most photos, then with sparse points."""


def format_names() -> tuple[str, ...]:
    """The names of all formats, also of those that installed packages read."""
    return (*get_args(SceneFormat), *(reader.NAME for reader in offered(READERS_GROUP).values()))


def check_format(name: str | None, where: object) -> str | None:
    """A format read from a file.

    Raises:
        InputError: there is no format of this name.
    """
    if name is not None and name not in format_names():
        raise InputError(f"{where}: format: expected one of {', '.join(format_names())}, found {name[:40]!r}")
    return name


def apply_choice(capture: Capture, choice: PhotoChoice, folder: Path) -> Capture:
    """The capture reduced to the chosen photos, with masks and weights, at the chosen scale.

    Args:
        folder: the folder of the cameras.

    Raises:
        InputError: no photo has a given name, a weight is not within `WEIGHTS`, a photo that is not left out is missing,
            or a mask cannot be read or has another size than its photo.
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
    kept = [i for i, name in enumerate(names) if name not in left_out]
    for photo in (capture.views[i].photo for i in kept):
        if isinstance(photo, MissingPhoto):
            raise photo.error
    masks, warnings = masks_of(capture.views, kept, choice.masks, folder)
    views = tuple(
        replace(capture.views[i], weight=weights[names[i]], mask=mask) for i, mask in zip(kept, masks, strict=True)
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
    chosen = capture._replace(views=views, sparse_points=sparse, warnings=(*capture.warnings, *warnings))
    return chosen if _is_same_frame(choice) else in_frame(chosen, _frame(choice))


def _is_same_frame(choice: PhotoChoice) -> bool:
    return (choice.mesh_axes, choice.mesh_scale) == (PhotoChoice.mesh_axes, PhotoChoice.mesh_scale)


def _frame(choice: PhotoChoice) -> MeshFrame:
    """The frame of the mesh that was chosen."""
    if not SMALLEST_MESH_SCALE <= choice.mesh_scale <= 1 / SMALLEST_MESH_SCALE:
        raise InputError(f"--mesh-scale: expected a factor of 1e-9 to 1e9, found {choice.mesh_scale:g}")
    return MeshFrame("as chosen", choice.mesh_scale * parse_axes(choice.mesh_axes), np.zeros(3))


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
    low, high = WEIGHTS
    if not low <= weight <= high:
        raise InputError(f"--photo-weights {text}: expected a photo's name, =, and a number of {low:g} to {high:g}")
    return weight


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

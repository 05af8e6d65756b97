"""Refinement of cameras, kept in the user's cache folder: photos and cameras that were refined once need no search."""

import hashlib
import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np

import fairing.cameras
from fairing.camera import Camera
from fairing.cameras.refinement import Iteration, Progress, Refinement, refine
from fairing.errors import InputError
from fairing.features.options import FeatureOptions
from fairing.io.atomic import write_atomically
from fairing.io.feature_points import points_key
from fairing.io.scene_points import cache_file
from fairing.scene import View
from fairing.util.npz import read_npz


def refine_once(
    name: str,
    views: Sequence[View],
    threads: int,
    on_progress: Progress,
    cancel_requested: Callable[[], bool],
    finds_points: bool,
    adjusts_lens: bool,
) -> Refinement:
    """What `refine` returns, without its points if the cache has it. Arguments and exceptions as of `refine`.

    Args:
        name: of the scene: names the file in the cache.
    """
    path = cache_file("cameras", name, views)
    key = hashlib.sha256(
        points_key(views, FeatureOptions()).encode() + _code_digest() + bytes([adjusts_lens])
    ).hexdigest()
    kept = _kept(path, key, views)
    if kept is not None:
        return kept
    found = refine(views, threads, on_progress, cancel_requested, finds_points, adjusts_lens)
    arrays = {
        "cameras": np.array([camera.image_from_world for camera in found.cameras]),
        "turns": np.array([iteration.turns for iteration in found.iterations]),
        "shifts": np.array([iteration.shifts for iteration in found.iterations]),
        "errors": np.array([iteration.errors for iteration in found.iterations]),
        "facts": np.str_(json.dumps(found.facts())),
        "key": np.str_(key),
    }
    with suppress(OSError, InputError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, lambda file: np.savez_compressed(file, **arrays))
    return found


def _kept(path: Path, key: str, views: Sequence[View]) -> Refinement | None:
    """The refinement in a file; None if there is no file, it is damaged, or was made of other photos or cameras."""
    try:
        with path.open("rb") as file:
            found = read_npz(file, ("cameras", "turns", "shifts", "errors"), ("facts", "key"))
        if found["key"].item() != key:
            return None
        cameras = [
            Camera.recorded(matrix, view.camera.width, view.camera.height)
            for matrix, view in zip(found["cameras"], views, strict=True)
        ]
        iterations = [Iteration(*state) for state in zip(found["turns"], found["shifts"], found["errors"], strict=True)]
        return Refinement.of_facts(json.loads(found["facts"].item()), cameras, iterations)
    except (OSError, ValueError, KeyError, TypeError):
        return None


@cache
def _code_digest() -> bytes:
    """Changes whenever the code that refines cameras does."""
    sources = sorted(Path(fairing.cameras.__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).digest()

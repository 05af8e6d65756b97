"""Trace headers: the scene, options and library versions of a recorded run."""

import hashlib
from importlib.metadata import version
from typing import Any

import numpy as np

from fairing.errors import InputError
from fairing.options import FairingOptions, options_to_dict
from fairing.scene import Scene
from fairing.trace import Trace


def header_of(scene: Scene, options: FairingOptions) -> dict[str, Any]:
    """The header of a new trace, see `Trace.header`."""
    return {
        "scene": scene.name,
        "views": [view.name for view in scene.views],
        "sparse_points": _points_of(scene),
        "options": options_to_dict(options),
        "versions": {name: version(name) for name in ("numpy", "scipy", "numba")},
    }


def check_same_scene(scene: Scene, trace: Trace) -> None:
    """Refuse a trace of other photos, of another mesh or, if the run used them, of other sparse points.

    Raises:
        InputError: the trace was recorded on another scene, which the message names.
    """
    names = [view.name for view in scene.views]
    same_mesh = np.array_equal(trace.faces, scene.mesh.faces) and len(trace.start) == len(scene.mesh.vertices)
    if trace.header.get("views") != names or not same_mesh:
        raise InputError(
            f"trace of scene {trace.header.get('scene')}: expected the photos and the mesh it was recorded on, "
            f"found those of {scene.name}; open it with its own scene"
        )
    recorded, found = trace.header.get("sparse_points"), _points_of(scene)
    if recorded is not None and recorded != found and any(trace.header["options"]["step"]["points"]):
        raise InputError(
            f"trace of scene {trace.header.get('scene')}: expected the sparse points it was recorded with "
            f"({recorded['count']} of them), found {found['count']}, or others; open it with the scene as it was"
        )


def _points_of(scene: Scene) -> dict[str, Any]:
    """Count and digest of the sparse points, which identify them: they are a prior of the run."""
    points = scene.sparse_positions
    return {"count": len(points), "digest": hashlib.blake2b(points.tobytes(), digest_size=16).hexdigest()}

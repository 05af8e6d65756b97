"""Trace headers: the scene, options and library versions of a recorded run."""

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from typing import Any

import numpy as np

from fairing.camera import Camera
from fairing.cameras.corrected_scene import facts_of_lens, found_lens, recorded_lens, with_cameras
from fairing.cameras.refinement import Refinement
from fairing.errors import InputError
from fairing.options import FairingOptions, options_from_dict, options_to_dict
from fairing.run.recorded_terms import header_of_terms
from fairing.scene import Scene, View
from fairing.terms.own import OwnTerm
from fairing.trace import Trace

REFINEMENT = "refinement"
"""Key of a header: what refinement of the cameras found, see `Refinement.facts`, and its iterations."""


def header_of(scene: Scene, options: FairingOptions, terms: Sequence[OwnTerm] = ()) -> dict[str, Any]:
    """The header of a new trace, see `Trace.header`; terms: of one's own."""
    return (
        {
            "scene": scene.name,
            "views": [view.name for view in scene.views],
            "options": options_to_dict(options),
            "versions": {name: version(name) for name in ("numpy", "scipy", "numba")},
        }
        | inputs_of(scene)
        | header_of_terms(terms)
    )


def inputs_of(scene: Scene) -> dict[str, Any]:
    """The entries of a header about cameras and sparse points, see `Trace.header`."""
    inputs: dict[str, Any] = {"sparse_points": recorded_points(scene)}
    if scene.cameras_origin == "corrected":
        inputs["cameras"] = recorded_cameras(scene.views)
    if scene.refinement is not None:
        inputs[REFINEMENT] = scene.refinement.facts() | {"iterations": _recorded_iterations(scene.refinement)}
    return inputs


def scene_of_trace(scene: Scene, trace: Trace) -> Scene:
    """The scene with the cameras that the trace was recorded with: corrected ones, or the given ones of the scene.

    Its points are the given ones instead of an "automatic" choice if the trace was recorded with them.

    Traces of versions that did not record the points were recorded with those of the scene.
    """
    scene = with_recorded_cameras(scene, trace.header)
    if REFINEMENT in trace.header or trace.header.get("sparse_points") is not None or trace.plan or len(trace):
        scene = replace(scene, cameras_choice="given")
    if scene.points_choice != "automatic":
        return scene
    recorded = trace.header.get("sparse_points")
    was_recorded = (trace.plan is not None or len(trace) > 0) if recorded is None else _same(recorded, scene)
    return replace(scene, points_choice="given") if was_recorded else scene


def check_same_scene(scene: Scene, trace: Trace) -> None:
    """Refuse a trace of other photos, of another mesh or, if the run used them, of other sparse points.

    The points are compared once they are chosen, see `Scene.points_choice`.

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
    recorded = trace.header.get("sparse_points")
    if scene.points_choice != "given" or scene.cameras_choice != "given" or recorded is None or _same(recorded, scene):
        return
    if options_from_dict(trace.header["options"]).uses_points:
        raise InputError(
            f"trace of scene {trace.header.get('scene')}: expected the sparse points it was recorded with "
            f"({recorded['count']} of them), found {len(scene.sparse_positions)}, or others; open it with the scene as it was"
        )


def recorded_points(scene: Scene) -> dict[str, Any] | None:
    """Count, digest and origin of the sparse points, which identify them; None while a choice of points or cameras is left."""
    if scene.points_choice != "given" or scene.cameras_choice != "given":
        return None
    points = scene.sparse_positions
    digest = hashlib.blake2b(points.tobytes(), digest_size=16).hexdigest()
    origin = None if scene.sparse_points is None else scene.sparse_points.origin
    return {"count": len(points), "digest": digest, "origin": origin}


def _same(recorded: dict[str, Any], scene: Scene) -> bool:
    """Whether recorded points are those that a scene has."""
    found = recorded_points(replace(scene, points_choice="given", cameras_choice="given"))
    assert found is not None, "no choice is left"
    return all(recorded[name] == found[name] for name in ("count", "digest"))


def _recorded_iterations(refinement: Refinement) -> list[dict[str, Any]]:
    """Iterations for a header, with six significant digits: they are only shown."""

    def rounded(values: np.ndarray) -> list[Any]:
        return np.array([float(f"{value:.6g}") for value in values.ravel().tolist()]).reshape(values.shape).tolist()

    return [{name: rounded(values) for name, values in vars(state).items()} for state in refinement.iterations]


def recorded_cameras(views: Sequence[View]) -> list[dict[str, Any]]:
    """The entry "cameras" of a header, which `with_recorded_cameras` reads."""
    recorded = []
    for view in views:
        camera, lens = view.camera, found_lens(view)
        matrix = {"matrix": camera.image_from_world.tolist(), "width": camera.width, "height": camera.height}
        recorded.append(matrix if lens is None else matrix | {"lens": facts_of_lens(lens)})
    return recorded


def with_recorded_cameras(scene: Scene, header: dict[str, Any]) -> Scene:
    """The scene with the cameras of a header, where it has some of the scene's photos, scaled to the size of its photos.

    Raises:
        InputError: the recorded cameras make no sense.
    """
    recorded = header.get("cameras")
    names = [view.name for view in scene.views]
    if recorded is None or scene.cameras_origin == "corrected" or header.get("views") != names:
        return scene
    try:
        cameras = [Camera.recorded(np.array(c["matrix"], float), c["width"], c["height"]) for c in recorded]
        lenses = [recorded_lens(c.get("lens"), camera) for c, camera in zip(recorded, cameras, strict=True)]
        if len(cameras) != len(names):
            raise ValueError(f"{len(cameras)} of them")
    except (TypeError, KeyError, ValueError, AttributeError) as error:
        raise InputError(
            f"header: expected a camera for each photo, found others ({error}); record the run again"
        ) from None
    sizes = [(view.camera.width, view.camera.height) for view in scene.views]
    return with_cameras(
        scene,
        [c if (c.width, c.height) == size else c.resized(*size) for c, size in zip(cameras, sizes, strict=True)],
        [None if lens is None else lens.resized(*size) for lens, size in zip(lenses, sizes, strict=True)],
    )

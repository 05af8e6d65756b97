"""In-view check: whether the photos show the mesh, to find wrong axes, units or frames before a run starts."""

from typing import NamedTuple

import numpy as np

from fairing.check.conventions import cameras_fit, explain_view
from fairing.errors import InputError
from fairing.placement.judge import judge_placement
from fairing.scene import Scene

LEAST_SEEING = 0.5
"""Of the photos: where fewer see the mesh, it is in another frame than the cameras, and no single camera is mirrored."""


class _InView(NamedTuple):
    """Vertices in a photo: number in front of its camera, and fraction of all behind it, by projections inside the photo."""

    seen: int
    behind: float


def check_mesh_in_view(scene: Scene) -> None:
    """Refuse a scene whose photos show none of the mesh's vertices, or with a mirrored camera.

    Only vertices are projected; occlusion is ignored.

    Raises:
        InputError: no vertex lies inside a photo and in front of its camera; or most of the mesh lies behind a few cameras
            and still projects into their photos, which reveals mirrored cameras. (A 3x4 matrix and its negative are the
            same camera, so the matrix alone does not reveal it.)
    """
    vertices = scene.mesh.vertices[np.unique(scene.mesh.faces)]
    found = [_in_view(scene, v, vertices) for v in range(len(scene.views))]
    is_behind = np.array([view.seen == 0 and view.behind > 0.5 for view in found])
    is_seeing = np.array([view.seen > 0 for view in found])
    if is_behind.any() and is_seeing.any() and is_seeing.mean() < LEAST_SEEING:
        raise InputError(
            f"mesh: it lies behind {int(is_behind.sum())} of the {len(scene.views)} cameras, whose photos do not show it; "
            + _explanation(scene)
        )
    if is_behind.any() and is_seeing.any():
        raise InputError(
            f"camera of photo {scene.views[int(is_behind.argmax())].name}: the mesh lies behind it and yet projects into its "
            "photo, so its axes are mirrored; flip one (x right, y down, z forward) or remove the photo"
        )
    if not is_seeing.any():
        raise InputError(
            f"mesh: none of its {len(vertices)} vertices lies inside any of the {len(scene.views)} photos; "
            + _explanation(scene)
        )


def _in_view(scene: Scene, v: int, vertices: np.ndarray) -> _InView:
    camera = scene.views[v].camera
    pixels, depth = camera.project(vertices)
    with np.errstate(invalid="ignore"):
        inside = ((pixels >= -0.5) & (pixels <= np.array([camera.width, camera.height]) - 0.5)).all(axis=1)
    return _InView(int((inside & (depth > 0)).sum()), float((inside & (depth < 0)).mean()))


def _explanation(scene: Scene) -> str:
    """What explains that the photos do not show the mesh: where sparse points fit the cameras, the mesh; else the cameras."""
    if cameras_fit(scene):
        placement = judge_placement(scene)
        if placement.better is not None:
            return placement.line
        return "the sparse points fit the cameras, so the mesh is in another frame: bring it into the cameras' world"
    mistake = explain_view(scene)
    if mistake is not None:
        return f"they would if {mistake}: correct that, or the axes of the mesh (--mesh-axes)"
    return "mesh and cameras differ in axes, units or frame, bring the mesh into the cameras' world"

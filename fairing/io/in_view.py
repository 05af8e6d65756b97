"""In-view check: whether the photos show the mesh, to find wrong axes, units or frames before a run starts."""

import numpy as np

from fairing.check.conventions import explain_view
from fairing.errors import InputError
from fairing.scene import Scene


def check_mesh_in_view(scene: Scene) -> None:
    """Refuse a scene whose photos show none of the mesh's vertices, or whose cameras are mirrored.

    Only vertices are projected; occlusion is ignored.

    Raises:
        InputError: no vertex lies inside a photo and in front of its camera, or most of the mesh lies behind a camera
            and still projects into its photo, which reveals a mirrored camera. (A 3x4 matrix and its negative are the
            same camera, so the matrix alone does not reveal it.)
    """
    vertices = scene.mesh.vertices[np.unique(scene.mesh.faces)]
    is_seen = False
    for view in scene.views:
        pixels, depth = view.camera.project(vertices)
        with np.errstate(invalid="ignore"):
            inside = ((pixels >= -0.5) & (pixels <= np.array([view.camera.width, view.camera.height]) - 0.5)).all(
                axis=1
            )
        seen = int((inside & (depth > 0)).sum())
        if seen == 0 and (inside & (depth < 0)).mean() > 0.5:
            raise InputError(
                f"camera of photo {view.name}: the mesh lies behind it and yet projects into its photo, so its "
                "axes are mirrored; flip one (x right, y down, z forward) or remove the photo"
            )
        is_seen |= seen > 0
    if not is_seen:
        mistake = explain_view(scene)
        raise InputError(
            f"mesh: none of its {len(vertices)} vertices lies inside any of the {len(scene.views)} photos; "
            + (
                f"they would if {mistake}: correct that"
                if mistake
                else "mesh and cameras differ in axes, units or frame, bring the mesh into the cameras' world"
            )
        )

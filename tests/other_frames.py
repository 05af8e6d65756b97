"""A scene in another unit and about another origin: the same photos, everything in the world changed together."""

from dataclasses import replace

import numpy as np

from fairing.camera import Camera
from fairing.scene import Scene


def in_frame(scene: Scene, scale: float = 1.0, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Scene:
    """The scene with its world scaled, then shifted; without truth.

    Args:
        scale: new units per old unit.
        shift: new units.
    """
    old_from_new = np.eye(4)
    old_from_new[:3] = np.column_stack([np.eye(3), -np.asarray(shift)]) / scale
    views = tuple(
        replace(view, camera=Camera(view.camera.image_from_world @ old_from_new, view.camera.width, view.camera.height))
        for view in scene.views
    )
    points = scene.sparse_points
    if points is not None:
        points = replace(points, positions=scale * points.positions + shift)
    vertices = scale * scene.unweld(scene.mesh.vertices) + shift
    return Scene.build(scene.name, vertices, scene.original_faces, views, sparse_points=points)

"""A small building whose cameras are turned at random."""

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from demo_scenes.building.scene import scene_of_plan
from fairing.camera import Camera
from fairing.scene import Scene
from tests.small_building import small_building


@cache
def exact_scene() -> Scene:
    return replace(scene_of_plan("building small", small_building()), points_choice="own")


def turned(scene: Scene, px: float) -> Scene:
    """The scene with its cameras turned at random, px standard deviation an axis."""
    rng, views = np.random.default_rng(1), []
    for view in scene.views:
        camera = view.camera
        turn = Rotation.from_rotvec(rng.normal(size=3) * px / camera.K[0, 0]).as_matrix()
        R = turn @ camera.camera_from_world[:, :3]
        wrong = Camera.from_krt(camera.K, R, -R @ camera.center, camera.width, camera.height)
        views.append(replace(view, camera=wrong))
    return replace(scene, views=tuple(views))

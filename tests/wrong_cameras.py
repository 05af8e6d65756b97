"""A small building whose cameras are turned at random, or whose lens is bent."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from demo_scenes.building.scene import scene_of_plan
from fairing.camera import Camera
from fairing.distortion import MODELS
from fairing.lens import Lens
from fairing.photo import ArrayPhoto
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


def bent(scene: Scene, k1: float, k2: float) -> Scene:
    """The scene as photographed through a lens with radial distortion, of which its cameras do not tell."""
    views = []
    for view in scene.views:
        lens = Lens(view.camera.K, np.array([k1, k2]), view.camera.width, view.camera.height)
        rows, columns = np.mgrid[: lens.height, : lens.width]
        rays = MODELS["polynomial"].undistort(
            (np.column_stack([columns.ravel(), rows.ravel()]) - lens.K[:2, 2]) / np.diag(lens.K)[:2], lens.distortion
        )
        x, y = (rays * np.diag(lens.K)[:2] + lens.K[:2, 2]).T.reshape(2, *rows.shape).astype(np.float32)
        pixels = cv2.remap(view.photo.load(), x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        views.append(replace(view, photo=ArrayPhoto(pixels)))
    return replace(scene, views=tuple(views))

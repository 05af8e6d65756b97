"""Picking camera: a browser's camera as a `Camera`, for picking vertices."""

import numpy as np
import viser
import viser.transforms

from fairing.camera import Camera

HEIGHT = 540  # px, at most: resolution of the visibility test


def camera_of(client: viser.ClientHandle) -> Camera:
    """The browser's camera in page units, with an image of at most `HEIGHT` rows."""
    camera = client.camera
    height = min(HEIGHT, int(camera.image_height))
    width = max(1, round(height * camera.aspect))
    focal = height / 2 / np.tan(camera.fov / 2)
    K = np.array([[focal, 0, width / 2 - 0.5], [0, focal, height / 2 - 0.5], [0, 0, 1]])
    camera_from_world = viser.transforms.SO3(np.asarray(camera.wxyz)).as_matrix().T
    return Camera.from_krt(K, camera_from_world, -camera_from_world @ np.asarray(camera.position), width, height)

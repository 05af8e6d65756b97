"""View-dependent textures: from a photo's camera they show the photo, and they change continuously between photos."""

import cv2
import numpy as np
import pytest

from fairing.scene import Scene
from fairing.texture import EigenTexture, TexturedModel, eigen_texture, textured_model
from tests.small_scene import FACES, HEIGHT, VERTICES, WIDTH, cameras, corner_scene, photos
from tests.texture_view import inner, shown_in

pytestmark = pytest.mark.slow


def glossy_photos() -> dict[int, np.ndarray]:
    """The corner's photos with a highlight of up to 50 grey levels that moves over the faces with the camera."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    found = {}
    for i, (camera, photo) in enumerate(zip(cameras(), photos(), strict=True)):
        rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(camera.image_from_world[:, :3]).T
        top = camera.center + ((1 - camera.center[2]) / rays[..., 2])[..., None] * rays
        middle = 0.5 + 1.0 * (camera.center[:2] / np.linalg.norm(camera.center) - 0.577)
        sheen = 50 * np.exp(-((top[..., :2] - middle) ** 2).sum(axis=-1) / (2 * 0.35**2))
        found[i] = np.clip(photo + sheen[..., None], 0, 255).astype(np.uint8)
    return found


@pytest.fixture(scope="module")
def glossy() -> EigenTexture:
    return eigen_texture(corner_scene(change=glossy_photos()), VERTICES)


def from_eye(texture: EigenTexture, eye: np.ndarray) -> TexturedModel:
    return TexturedModel(texture.vertices, texture.faces, texture.layout.uv, texture.image_for(eye))


def test_from_a_photos_camera_it_is_closer_to_the_photo_than_the_static_texture(glossy: EigenTexture):
    photos, scene = glossy_photos(), corner_scene(change=glossy_photos())
    static = textured_model(scene, VERTICES, 1024)
    for i, view in enumerate(scene.views):
        image, is_shown = shown_in(from_eye(glossy, view.camera.center), view.camera)
        other, _ = shown_in(static, view.camera)
        part = inner(is_shown)

        # The sheen is broad; details differ by the resampling of both alike.
        mine, usual = (
            np.sqrt((cv2.GaussianBlur(shown - photos[i], (0, 0), 2)[part] ** 2).mean()) for shown in (image, other)
        )
        assert mine < 0.6 * usual, (i, mine, usual)


def test_where_the_photos_agree_it_looks_like_the_static_texture():
    scene = corner_scene()
    texture, static = eigen_texture(scene, VERTICES), textured_model(scene, VERTICES, 1024)
    eyes = [view.camera.center for view in scene.views] + [np.array([4.0, 3.0, 5.0])]
    for eye in eyes:
        camera = scene.views[0].camera
        image, is_shown = shown_in(from_eye(texture, eye), camera)
        other, _ = shown_in(static, camera)
        difference = (image - other)[inner(is_shown)]
        assert np.sqrt((difference**2).mean()) < 6, np.sqrt((difference**2).mean())
        assert abs(difference.mean()) < 1, difference.mean()


def test_exposures_of_the_photos_are_removed():
    gains = np.array([0.75, 1.25, 0.85, 1.1, 0.95, 1.2, 0.8, 1.05])
    exposed = {i: np.clip(photo * gains[i] * 0.8, 0, 255).astype(np.uint8) for i, photo in enumerate(photos())}
    scene = corner_scene(change=exposed)
    texture, camera = eigen_texture(scene, VERTICES), scene.views[0].camera
    means = []
    for view in scene.views:
        image, is_shown = shown_in(from_eye(texture, view.camera.center), camera)
        means.append(image[is_shown].mean())
    assert max(means) / min(means) < 1.03, means


def test_weights_are_those_of_the_nearest_photos_and_continuous(glossy: EigenTexture):
    centers = np.array([camera.center for camera in cameras()])
    at_photo = glossy.weights_for(centers[2])
    assert np.allclose(at_photo.sum(axis=1), 1)
    assert (at_photo.max(axis=1) > 0.98).all()
    path = np.concatenate([np.linspace(a, b, 2000) for a, b in zip(centers, np.roll(centers, -1, axis=0), strict=True)])
    weights = np.array([glossy.weights_for(eye) for eye in path])
    assert ((weights > 1e-4).sum(axis=2) <= 3).all()
    moved = np.abs(np.diff(weights, axis=0)).max(axis=(1, 2))
    # Twice as slow a walk, steps half as large: no jump anywhere, however fast the weights change beside a photo.
    slower = np.concatenate(
        [np.linspace(a, b, 16000) for a, b in zip(centers, np.roll(centers, -1, axis=0), strict=True)]
    )
    finer = np.array([glossy.weights_for(eye) for eye in slower])
    assert np.abs(np.diff(finer, axis=0)).max() < 0.3 * moved.max()
    assert np.abs(np.diff(finer, axis=0)).max() < 0.12


def test_a_face_that_no_photo_sees_is_grey():
    scene = corner_scene()
    hidden = Scene.build("hidden", VERTICES, np.vstack([FACES, [1, 2, 6]]), scene.views)
    texture = eigen_texture(hidden, VERTICES)
    image = texture.image_for(np.array([4.0, 4.0, 4.0]))
    x, y = (texture.layout.uv[6].mean(axis=0) * image.shape[1::-1]).astype(int)
    assert image[y, x].tolist() == [96, 96, 96]

"""Common point spread function: against scipy's filters, and against a texture whose blur is known exactly."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates, spline_filter

from fairing.camera import Camera
from fairing.cells.point_spread import LENS_VARIANCE, MAX_AREA_RATIO, common_psf_patches, missing_blur
from fairing.cells.scale_space import ScaleSpace
from fairing.photo import ArrayPhoto
from fairing.scene import Scene, View
from tests.small_scene import FACES, VERTICES, corner_scene

pytestmark = pytest.mark.compiled

POOL = ThreadPoolExecutor(2)
FACE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
SIZE = 160


def far_camera(x: float, y: float, pixels: float) -> Camera:
    """Looks at the middle of FACE from direction (x, y, 1), so far away that it is affine; `pixels` a unit."""
    middle, eye = FACE.mean(axis=0), 1e4 * np.array([x, y, 1.0])
    eye += middle
    z = (middle - eye) / np.linalg.norm(middle - eye)
    right = np.cross(z, [0.0, 1, 0])
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(z, right), z])
    focal = pixels * np.linalg.norm(eye - middle)
    K = np.array([[focal, 0, SIZE / 2], [0, focal, SIZE / 2], [0, 0, 1]])
    return Camera.from_krt(K, R, -R @ eye, SIZE, SIZE)


CAMERAS = [far_camera(0, 0, 70), far_camera(0.7, 0.1, 60), far_camera(-0.4, 0.6, 80), far_camera(0.1, -0.8, 55)]
PAIR_VIEW, PAIR_START = np.arange(len(CAMERAS)), np.array([0, len(CAMERAS)])


def jacobian(camera: Camera) -> np.ndarray:
    return camera.J_image_wrt_point(FACE.mean(axis=0)[None])[0][:, :2]


def photo_of_waves(camera: Camera) -> np.ndarray:
    """(h, w) float: a sum of waves on the plane of FACE, seen through the lens's Gaussian: each wave is only damped."""
    J = jacobian(camera)
    back = np.linalg.inv(J)
    origin = camera.project(np.zeros((1, 3)))[0][0]
    v, u = np.mgrid[:SIZE, :SIZE]
    points = np.stack([u - origin[0], v - origin[1]], axis=-1) @ back.T
    photo = np.full((SIZE, SIZE), 120.0)
    rng = np.random.default_rng(5)
    for wave in rng.normal(scale=35, size=(12, 2)):
        damping = np.exp(-0.5 * LENS_VARIANCE * wave @ back @ back.T @ wave)
        photo += 15 * damping * np.cos(points @ wave + rng.uniform(0, 6))
    return photo


def luma(scene: Scene, view: int) -> np.ndarray:
    return scene.views[view].photo.load().astype(float) @ np.array([0.299, 0.587, 0.114])  # Rec. 601


def test_the_patches_are_the_blurred_photos():
    scene = corner_scene()
    photos = ScaleSpace(scene, color=False)
    corners = VERTICES[FACES]
    start = np.arange(len(FACES) + 1) * len(scene.views)
    view = np.tile(np.arange(len(scene.views)), len(FACES))
    cams = [item.camera for item in scene.views]
    covariance = missing_blur(cams, view, start, corners, np.full(len(view), 1.5))
    pixels, base, frame = common_psf_patches(photos, cams, view, start, corners, np.full(len(view), 1.5), False, POOL)
    smooth, _, _ = common_psf_patches(photos, cams, view, start, corners, np.full(len(view), 1.5), True, POOL)
    for pair in (0, 11, 29):
        left, top, width, height = frame[pair]
        photo = luma(scene, view[pair])
        # Along the axes of its ellipse a Gaussian is a product of two: sample the photo along rotated axes.
        values, vectors = np.linalg.eigh(covariance[pair])
        rows = slice(base[pair], base[pair] + width * height)
        found = pixels[rows].reshape(height, width)
        spline = spline_filter(photo, order=3, mode="mirror")
        for y, x in ((top + height // 2, left + width // 2), (top + 8, left + width // 3)):
            reach = np.arange(-60, 61) / 10
            a, b = np.meshgrid(reach, reach, indexing="ij")
            weight = np.exp(-0.5 * (a**2 + b**2))
            places = (
                np.stack([a * np.sqrt(values[0]), b * np.sqrt(values[1])], axis=-1) @ vectors.T + np.array([x, y])
            ).reshape(-1, 2)
            around = map_coordinates(spline, places.T[::-1], order=3, mode="mirror", prefilter=False)
            expected = (weight.ravel() * around).sum() / weight.sum()
            assert found[y - top, x - left] == pytest.approx(expected, abs=0.15)
        coefficients = spline_filter(found.astype(float), order=3, mode="mirror")
        inner = (slice(10, -10), slice(10, -10))
        assert np.abs(smooth[rows].reshape(height, width)[inner] - coefficients[inner]).max() < 0.05


def test_a_round_gaussian_agrees_with_scipy():
    camera = far_camera(0, 0, 70)
    noise = np.random.default_rng(0).integers(0, 256, (SIZE, SIZE, 3), np.uint8)
    scene = replace(corner_scene(), views=[View(name, camera, ArrayPhoto(noise)) for name in "abc"])
    photos = ScaleSpace(scene, color=True)
    min_sigma = np.array([2.0])
    pixels, base, (frame,) = common_psf_patches(
        photos, [camera], np.array([0]), np.array([0, 1]), FACE[None], min_sigma, False, POOL
    )
    left, top, width, height = frame
    expected = gaussian_filter(
        noise.transpose(2, 0, 1).astype(float), (0, *[np.sqrt(4 - LENS_VARIANCE)] * 2), truncate=6
    )[:, top : top + height, left : left + width]
    assert base.tolist() == [0]
    assert np.abs(pixels.reshape(3, height, width) - expected).max() < 0.02


def test_all_photos_have_one_psf_on_the_face():
    covariance = missing_blur(CAMERAS, PAIR_VIEW, PAIR_START, FACE[None], np.full(4, 0.5))
    psfs = []
    for camera, missing in zip(CAMERAS, covariance, strict=True):
        back = np.linalg.inv(jacobian(camera))
        psfs.append(back @ (missing + LENS_VARIANCE * np.eye(2)) @ back.T)
        assert np.linalg.eigvalsh(missing)[0] > -1e-12
    assert np.allclose(psfs, psfs[0], rtol=1e-6, atol=1e-12)
    # Smallest: some photo needs no blur along some direction.
    assert min(np.linalg.eigvalsh(missing)[0] for missing in covariance) < 0.02


def test_an_oblique_view_does_not_blur_the_others_without_limit():
    oblique = [*CAMERAS, far_camera(6.0, 0.0, 70)]
    covariance = missing_blur(oblique, np.arange(5), np.array([0, 5]), FACE[None], np.full(5, 0.5))
    sharpest = min(LENS_VARIANCE / abs(np.linalg.det(jacobian(camera))) for camera in oblique)
    back = np.linalg.inv(jacobian(oblique[0]))
    psf = back @ (covariance[0] + LENS_VARIANCE * np.eye(2)) @ back.T
    # A photo that is less sharp than the common PSF along some direction keeps its own blur there.
    assert np.sqrt(np.linalg.det(psf)) <= 1.3 * MAX_AREA_RATIO * sharpest
    assert sharpest * 6 < LENS_VARIANCE / abs(np.linalg.det(jacobian(oblique[4])))


def test_photos_with_a_common_psf_show_one_texture():
    """The cells of a plane seen from near, far and obliquely become the same image; photos as seen differ."""
    waves = [photo_of_waves(camera) for camera in CAMERAS]
    views = [
        View(f"{i}", camera, ArrayPhoto(np.repeat(np.round(photo)[..., None], 3, axis=2).astype(np.uint8)))
        for i, (camera, photo) in enumerate(zip(CAMERAS, waves, strict=True))
    ]
    photos = ScaleSpace(replace(corner_scene(), views=views), color=False)
    pixels, base, frame = common_psf_patches(
        photos, CAMERAS, PAIR_VIEW, PAIR_START, FACE[None], np.full(4, 0.5), True, POOL
    )
    a, b = np.random.default_rng(1).dirichlet(np.ones(3), 400)[:, :2].T
    points = np.stack([a, b, np.zeros(400)], axis=1)
    cells, as_seen = [], []
    for i, camera in enumerate(CAMERAS):
        uv = camera.project(points)[0]
        left, top, width, height = frame[i]
        part = pixels[base[i] : base[i] + width * height].reshape(height, width)
        cells.append(map_coordinates(part, (uv - (left, top)).T[::-1], order=3, prefilter=False))
        as_seen.append(map_coordinates(np.round(waves[i]), uv.T[::-1], order=3))
    spread, before = (np.std(values, axis=0).mean() for values in (cells, as_seen))
    # The rest is the rounding to whole grey levels.
    assert spread < 0.3, (spread, before)
    assert before > 5 * spread

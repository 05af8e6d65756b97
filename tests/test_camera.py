"""Camera: projection against OpenCV, its parts against its matrix, Jacobian against differences, what it refuses."""

import cv2
import numpy as np
import pytest

from fairing.camera import Camera
from fairing.errors import InputError
from fairing.geometry.pixel_size import pixel_size

K = np.array([[700.0, 0.3, 320.5], [0, 690.0, 241.0], [0, 0, 1]])
RVEC = np.array([0.2, -0.4, 0.1])
R = cv2.Rodrigues(RVEC)[0]
T = np.array([0.3, -0.2, 5.0])
POINTS = np.random.default_rng(0).uniform(-1, 1, (50, 3))


@pytest.fixture
def camera() -> Camera:
    return Camera.from_krt(K, R, T, 640, 480)


def test_projection_agrees_with_opencv():
    K_without_skew = K * (1 - np.eye(3, k=1))
    expected = cv2.projectPoints(POINTS, RVEC, T, K_without_skew, np.zeros(4))[0][:, 0]
    pixels, depth = Camera.from_krt(K_without_skew, R, T, 640, 480).project(POINTS)
    np.testing.assert_allclose(pixels, expected, atol=1e-9)
    np.testing.assert_allclose(depth, (POINTS @ R.T + T)[:, 2], atol=1e-12)


@pytest.mark.parametrize("scale", [1, -1, 1e-6, -3e4])
def test_matrix_and_its_multiples_are_the_same_camera(camera: Camera, scale: float):
    other = Camera(scale * camera.image_from_world, 640, 480)
    np.testing.assert_allclose(other.image_from_world, camera.image_from_world, rtol=1e-12, atol=1e-12)


def test_parts_are_recovered_from_the_matrix(camera: Camera):
    other = Camera(-2 * camera.image_from_world, 640, 480)
    np.testing.assert_allclose(other.K, K, atol=1e-9)
    np.testing.assert_allclose(other.camera_from_world, np.column_stack([R, T]), atol=1e-12)
    np.testing.assert_allclose(other.center, -R.T @ T, atol=1e-12)


def test_depth_behind_is_not_positive(camera: Camera):
    behind = camera.center - R[2]
    assert camera.project(behind)[1] == pytest.approx(-1)


def test_jacobian_agrees_with_central_differences(camera: Camera):
    h = 1e-5
    for axis in range(3):
        step = h * np.eye(3)[axis]
        expected = (camera.project(POINTS + step)[0] - camera.project(POINTS - step)[0]) / (2 * h)
        # Truncation of order h^2 and rounding of order eps * 640 / h, both below 1e-7 px a world unit.
        np.testing.assert_allclose(camera.J_image_wrt_point(POINTS)[:, :, axis], expected, atol=1e-6)


def test_a_pixel_covers_its_size_at_a_points_depth_in_the_median_photo(camera: Camera):
    """Oracle: a point moved along the camera's rows by that much moves by a pixel."""
    farther = Camera.from_krt(np.diag([350.0, 350, 1]), R, T + np.array([0, 0, 3]), 640, 480)
    away = Camera.from_krt(K, np.diag([1.0, -1, -1]) @ R, -T, 640, 480)
    points = np.vstack([POINTS, farther.center - 4 * R[2]])
    size = pixel_size([camera, farther], points)
    assert np.isnan(size).tolist() == [False] * len(POINTS) + [True], "only the last is behind both cameras"
    assert np.array_equal(pixel_size([camera, away, farther], POINTS), size[:-1])
    for point, width in zip(POINTS[:10], size[:10], strict=True):
        own = []
        for one in (camera, farther):
            there = one.project(np.array([point, point + 1e-3 * R[0]]))[0]
            own.append(1e-3 / np.linalg.norm(there[1] - there[0]))
        np.testing.assert_allclose(width, np.mean(own), rtol=1e-6)


def test_camera_cannot_be_changed_from_outside(camera: Camera):
    with pytest.raises(ValueError, match="read-only"):
        camera.image_from_world[0, 0] = 1


@pytest.mark.parametrize(
    ("matrix", "said"),
    [
        (np.eye(3), "expected 3x4"),
        (np.full((3, 4), np.nan), "NaN"),
        (np.full((3, 4), np.inf), "finite"),
        (np.full((3, 4), 1e300), "singular"),
        (np.zeros((3, 4)), "singular"),
        (np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]), "orthographic"),
        (np.array([[1.0, 2, 3, 0], [2, 4, 6, 0], [0, 0, 1, 1]]), "singular"),
    ],
)
def test_unusable_matrix_is_refused(matrix: np.ndarray, said: str):
    with pytest.raises(InputError, match=said) as error:
        Camera(matrix, 640, 480)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("k", "r", "t", "said"),
    [
        (K, np.diag([1.0, -1, 1]), T, "mirrored"),
        (K, 2 * np.eye(3), T, "not a rotation"),
        (np.diag([700.0, -700, 1]), R, T, "fy=-700"),
        (np.diag([0.0, 700, 1]), R, T, "fx=0"),
        (K, R, np.array([0, 0, np.nan]), "NaN"),
        (K[:2], R, T, "expected K 3x3"),
    ],
)
def test_unusable_pose_is_refused(k: np.ndarray, r: np.ndarray, t: np.ndarray, said: str):
    with pytest.raises(InputError, match=said):
        Camera.from_krt(k, r, t, 640, 480)


def test_photo_size_must_be_positive():
    with pytest.raises(InputError, match="0x480"):
        Camera.from_krt(K, R, T, 0, 480)

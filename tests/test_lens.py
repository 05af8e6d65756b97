"""Lenses: pixels and photos of every model against OpenCV, or against formulas of this test."""

import time
from collections.abc import Callable

import cv2
import numpy as np
import pytest

from fairing.distortion import MODELS
from fairing.errors import InputError
from fairing.lens import Lens

WIDTH, HEIGHT = 160, 120
FISHEYE = (0.03, -0.02, 0.01, -0.004)


def four_radial(rays: np.ndarray) -> np.ndarray:
    k1, k2, p1, p2, k3, k4 = PARAMETERS["four radial"]
    (x, y), r2 = rays.T, (rays**2).sum(axis=1)
    s = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3 + k4 * r2**4
    return np.stack(
        [x * s + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * s + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y], axis=1
    )


def by_bisection(undistorted_radius: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
    """Distorted rays of a lens that is given by the radius of the ray, which grows with that of the distorted ray."""

    def distort(rays: np.ndarray) -> np.ndarray:
        radius = np.linalg.norm(rays, axis=1)
        low, high = np.zeros(len(rays)), np.ones(len(rays))
        for _ in range(60):
            middle = (low + high) / 2
            is_less = undistorted_radius(middle) < radius
            low, high = np.where(is_less, middle, low), np.where(is_less, high, middle)
        return rays * (low / radius)[:, None]

    return distort


def with_opencv(rays: np.ndarray) -> np.ndarray:
    points = np.column_stack([rays, np.ones(len(rays))])
    return cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.eye(3), np.array(PARAMETERS["polynomial"]))[0][:, 0]


def with_opencv_fisheye(rays: np.ndarray) -> np.ndarray:
    points = np.column_stack([rays, np.ones(len(rays))])[:, None]
    return cv2.fisheye.projectPoints(points, np.zeros(3), np.zeros(3), np.eye(3), np.array(FISHEYE))[0][:, 0]


PARAMETERS = {
    "polynomial": (-0.2, 0.08, 0.003, -0.002, -0.01, 0.02, 0.0, 0.0),
    "four radial": (-0.1, 0.06, 0.004, -0.003, -0.03, 0.02),
    "fisheye": FISHEYE,
    "division": (-0.2,),
    "measured radial": (0.15,),
}
DISTORTED: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "polynomial": with_opencv,
    "four radial": four_radial,
    "fisheye": with_opencv_fisheye,
    "division": by_bisection(lambda m: m / (1 - 0.2 * m**2)),
    "measured radial": by_bisection(lambda m: m * (1 + 0.15 * m**2)),
}


def lens_of(model: str, skew: float = 0.0) -> Lens:
    K = np.array([[150.0, skew, 82.3], [0, 148.0, 57.9], [0, 0, 1]])
    return Lens(K, np.array(PARAMETERS[model]), WIDTH, HEIGHT, model)


def grid(step: int = 1, border: int = 0) -> np.ndarray:
    columns, rows = np.meshgrid(np.arange(border, WIDTH - border, step), np.arange(border, HEIGHT - border, step))
    return np.stack([columns, rows], axis=-1).reshape(-1, 2).astype(float)


def distorted_pixels(lens: Lens, pinhole: np.ndarray) -> np.ndarray:
    """Pixels (n, 2) of the distorted photo from pixels (n, 2) of the undistorted one, by this test's formulas."""
    rays = (pinhole - lens.pinhole_K[:2, 2]) / np.diag(lens.pinhole_K)[:2]
    return DISTORTED[lens.model](rays) @ lens.K[:2, :2].T + lens.K[:2, 2]


def test_every_model_is_tested():
    assert PARAMETERS.keys() == MODELS.keys()


@pytest.mark.parametrize("skew", [0.0, 3.0])
@pytest.mark.parametrize("model", PARAMETERS)
def test_undistorted_pixels_are_where_the_ray_meets_the_pinhole(model: str, skew: float):
    lens, pinhole = lens_of(model, skew), grid(5)
    np.testing.assert_allclose(lens.undistort(distorted_pixels(lens, pinhole)), pinhole, rtol=0, atol=1e-8)


@pytest.mark.parametrize("skew", [0.0, 3.0])
@pytest.mark.parametrize("model", PARAMETERS)
def test_an_undistorted_photo_shows_what_the_rays_see(model: str, skew: float):
    lens = lens_of(model, skew)

    def shade(pixels: np.ndarray) -> np.ndarray:
        return 128 + 60 * np.sin(pixels[:, 0] / 9) + 50 * np.cos(pixels[:, 1] / 7)

    photo = np.repeat(shade(grid()).reshape(HEIGHT, WIDTH, 1), 3, axis=2).astype(np.uint8)
    shown = lens.undistort_photo(photo)[4:-4, 4:-4, 0].astype(float)
    expected = shade(distorted_pixels(lens, grid(border=4))).reshape(shown.shape)
    # Rounding to whole grey levels twice, and the interpolation; a tenth of a pixel would be one grey level more.
    assert np.abs(shown - expected).max() < 2
    assert np.abs(shown - expected).mean() < 0.7
    mask = lens.undistort_mask((photo[..., 0] > 128).astype(np.uint8))[4:-4, 4:-4]
    sure = np.abs(expected - 128) > 12
    np.testing.assert_array_equal(mask[sure], (expected > 128)[sure])


@pytest.mark.parametrize("model", PARAMETERS)
def test_a_resized_lens_shows_the_same_rays(model: str):
    lens = lens_of(model, 2.0)
    half = lens.resized(WIDTH // 2, HEIGHT // 2)
    pixels = grid(9)
    # Below a pixel: the borders whose content decides on the zoom are centres of pixels.
    rays = [(other.undistort(p) - other.pinhole_K[:2, 2]) / np.diag(other.pinhole_K)[:2]
            for other, p in ((lens, pixels), (half, (pixels + 0.5) / 2 - 0.5))]  # fmt: skip
    both = np.isfinite(rays[0]).all(axis=1) & np.isfinite(rays[1]).all(axis=1)
    assert both.sum() > 100
    np.testing.assert_allclose(rays[0][both], rays[1][both], rtol=0, atol=1e-9)


def test_pixels_that_no_ray_meets_are_not_a_number():
    """A barrel polynomial whose distorted radius has its maximum, 0.4 focal lengths, inside the photo's corners."""
    lens = Lens(np.array([[300.0, 0, 79.5], [0, 300, 59.5], [0, 0, 1]]), np.array([-0.9]), WIDTH, HEIGHT)
    pixels = np.array([[79.5 + 300 * r, 59.5] for r in (0.1, 0.3, 0.39, 0.42, 0.6)])
    found = lens.undistort(pixels)
    assert np.isfinite(found[:3]).all()
    assert np.isnan(found[3:]).all()


def test_a_fisheye_has_no_pixels_where_its_undistorted_photo_does_not_reach():
    lens = Lens(np.array([[50.0, 0, 79.5], [0, 50, 59.5], [0, 0, 1]]), np.zeros(4), WIDTH, HEIGHT, "fisheye")
    straight = lens.undistort(np.array([[79.5, 59.5], [100.0, 59.5], [0.5, 59.5], [0.0, 0.0]]))
    np.testing.assert_allclose(straight[1], (79.5 + 50 * np.tan(20.5 / 50), 59.5))
    assert np.isnan(straight[2:]).all()


@pytest.mark.parametrize(
    ("model", "parameters"), [("measured radial", (-2.0,)), ("fisheye", (-1.0,)), ("four radial", (-2.0,))]
)
def test_a_lens_that_folds_the_photo_is_refused(model: str, parameters: tuple[float, ...]):
    with pytest.raises(InputError, match=r"lens: the distortion .* folds the photo over itself"):
        Lens(np.array([[100.0, 0, 79.5], [0, 100, 59.5], [0, 0, 1]]), np.array(parameters), WIDTH, HEIGHT, model)


@pytest.mark.parametrize("model", PARAMETERS)
def test_two_hundred_thousand_observations_are_undistorted_in_a_second(model: str):
    lens = lens_of(model)
    pixels = np.random.default_rng(0).uniform((0, 0), (WIDTH, HEIGHT), (200_000, 2))
    start = time.perf_counter()
    lens.undistort(pixels)
    # 0.3 to 0.8 s on a quiet machine.
    assert time.perf_counter() - start < 8

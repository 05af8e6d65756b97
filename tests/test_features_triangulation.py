"""Triangulation and covariance against exact points, a general optimiser and repeated noise."""

import numpy as np
from scipy.optimize import least_squares

from fairing.features.options import FeatureOptions
from fairing.features.points import points_of_tracks
from fairing.features.tracks import Tracks
from fairing.features.triangulation import triangulate_tracks
from tests.speckled_corner import camera_at

OPTIONS = FeatureOptions()
CAMERAS = [camera_at((6 * np.sin(t), 0.4 * np.cos(5 * t), -6 * np.cos(t))) for t in np.linspace(-0.5, 0.5, 6)]


def observed(points: np.ndarray, counts: np.ndarray):
    """Exact observations: point p in the first `counts[p]` cameras of a random choice; offsets, photos, pixels."""
    rng = np.random.default_rng(0)
    photos = [np.sort(rng.permutation(len(CAMERAS))[:n]) for n in counts]
    pixels = [np.array([CAMERAS[v].project(p)[0] for v in seen]) for p, seen in zip(points, photos, strict=True)]
    return np.concatenate([[0], np.cumsum(counts)]), np.concatenate(photos), np.concatenate(pixels)


def random_points(n: int) -> np.ndarray:
    return np.random.default_rng(1).uniform(-1.5, 1.5, (n, 3))


def test_exact_observations_give_the_exact_points():
    points = random_points(200)
    offsets, photos, pixels = observed(points, np.resize([3, 4, 5, 6], 200))
    found = triangulate_tracks(CAMERAS, offsets, photos, pixels, np.ones(len(photos)), OPTIONS)
    wide = found.is_good
    assert wide.mean() > 0.9  # three neighbouring cameras may be less than 4 degrees apart: none here
    assert np.abs(found.positions[wide] - points[wide]).max() < 1e-10
    assert found.kept[np.repeat(wide, np.diff(offsets))].all()


def test_the_point_minimises_the_weighted_reprojection_error():
    points, rng = random_points(30), np.random.default_rng(2)
    offsets, photos, pixels = observed(points, np.resize([3, 5, 6], 30))
    pixels += rng.normal(0, 0.15, pixels.shape)
    sigma = rng.uniform(0.5, 3, len(photos))
    found = triangulate_tracks(CAMERAS, offsets, photos, pixels, sigma, OPTIONS)
    for p in np.flatnonzero(found.is_good):
        seen = range(offsets[p], offsets[p + 1])

        def residuals(x: np.ndarray, seen: range = seen) -> np.ndarray:
            return np.concatenate([(CAMERAS[photos[o]].project(x)[0] - pixels[o]) / sigma[o] for o in seen])

        best = least_squares(residuals, points[p], xtol=1e-14, ftol=1e-14, gtol=1e-14).x
        assert np.abs(found.positions[p] - best).max() < 1e-7


def test_a_wrong_observation_is_dropped_and_the_rest_agree():
    points = random_points(50)
    offsets, photos, pixels = observed(points, np.full(50, 6))
    wrong = offsets[:-1] + np.arange(50) % 6
    pixels[wrong] += [7.0, -4.0]
    found = triangulate_tracks(CAMERAS, offsets, photos, pixels, np.ones(len(photos)), OPTIONS)
    assert found.is_good.all()
    assert not found.kept[wrong].any()
    assert found.kept.sum() == len(photos) - 50
    assert np.abs(found.positions - points).max() < 1e-9


def test_too_few_agreeing_photos_make_no_point():
    points = random_points(20)
    offsets, photos, pixels = observed(points, np.full(20, 3))
    pixels[offsets[:-1]] += [6.0, 9.0]
    found = triangulate_tracks(CAMERAS, offsets, photos, pixels, np.ones(len(photos)), OPTIONS)
    assert not found.is_good.any()
    assert not found.kept.any()


def test_rays_at_a_small_angle_make_no_point():
    points = random_points(20)
    offsets, photos, pixels = observed(points, np.full(20, 6))
    wide = FeatureOptions(angle=80.0)
    assert not triangulate_tracks(CAMERAS, offsets, photos, pixels, np.ones(len(photos)), wide).is_good.any()


def test_a_point_behind_the_cameras_is_no_point():
    behind = np.array([[0.0, 0.0, -30.0]])
    pixels = np.array([camera.project(behind)[0][0] for camera in CAMERAS])
    found = triangulate_tracks(CAMERAS, np.array([0, 6]), np.arange(6), pixels, np.ones(6), OPTIONS)
    assert not found.is_good.any()


def points_with_noise(n: int, sigma_px: float):
    """n points seen by 3 to 6 photos, with noise; half of the observations are three times as uncertain."""
    points, rng = random_points(n), np.random.default_rng(7)
    offsets, photos, pixels = observed(points, np.resize([3, 4, 5, 6], n))
    relative = rng.choice([1.0, 3.0], len(photos))
    pixels += rng.normal(0, sigma_px, pixels.shape) * relative[:, None]
    found = triangulate_tracks(CAMERAS, offsets, photos, pixels, relative, FeatureOptions(residual=50.0))
    tracks = Tracks(offsets, photos, np.zeros_like(photos))
    made = points_of_tracks(CAMERAS, tracks, found, pixels, relative, np.zeros((len(photos), 3), np.uint8))
    return made, points[found.is_good]


def test_the_keypoint_sigma_is_estimated_from_residuals():
    made, _ = points_with_noise(4000, 0.2)
    assert abs(made.keypoint_sigma / 0.2 - 1) < 0.02


def test_covariances_describe_the_errors():
    made, truth = points_with_noise(4000, 0.2)
    error = made.positions - truth
    chi_square = np.einsum("pi,pij,pj->p", error, np.linalg.inv(made.covariance), error)
    # Three coordinates, the variance estimated with 6 and 3 to 9 degrees of freedom: heavier tails than chi-square's.
    assert 2.2 < np.median(chi_square) < 2.6  # chi-square: 2.37
    assert 2.9 < np.mean(np.minimum(chi_square, 50)) < 3.7
    by_views = [np.median(chi_square[made.n_views == n]) for n in (3, 4, 5, 6)]
    assert 2.0 < min(by_views) <= max(by_views) < 2.8


def test_the_covariance_is_that_of_repeated_noise():
    points, rng = random_points(3), np.random.default_rng(11)
    offsets, photos, exact = observed(points, np.array([3, 4, 6]))
    repeats, sigma = 1500, 0.1
    many = np.concatenate([exact + rng.normal(0, sigma, exact.shape) for _ in range(repeats)])
    all_offsets = np.concatenate([[0], np.cumsum(np.tile(np.diff(offsets), repeats))])
    ones = np.ones(len(many))
    found = triangulate_tracks(CAMERAS, all_offsets, np.tile(photos, repeats), many, ones, OPTIONS)
    assert found.is_good.all()
    tracks = Tracks(all_offsets, np.tile(photos, repeats), np.zeros(len(many), int))
    made = points_of_tracks(CAMERAS, tracks, found, many, ones, np.zeros((len(many), 3), np.uint8))
    for p in range(3):
        spread = np.cov((found.positions[p::3] - points[p]).T)
        stated = made.covariance[p::3].mean(axis=0)
        ratio = np.linalg.eigvals(np.linalg.solve(stated, spread)).real
        assert np.abs(ratio - 1).max() < 0.15, ratio

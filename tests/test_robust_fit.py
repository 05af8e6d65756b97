"""Robust fit of a mesh to points: exact points of a cube's corner, with ground, background and false points."""

import numpy as np
import pytest
import trimesh

from fairing.features import FeaturePoints
from fairing.mesh import Mesh
from fairing.scene import SparsePoints
from fairing.terms.point_judge import loss_of_points, points_prefer
from fairing.terms.point_rays import distances_px, points_on_surface
from fairing.terms.points import PRIOR_SIGMA
from tests.fit_of_points import fit_of_points
from tests.small_scene import FACES, VERTICES
from tests.speckled_corner import cameras

SIGMA = 0.0005  # edges: of the points, along each axis


def truth() -> Mesh:
    """The corner in 96 faces."""
    vertices, faces = VERTICES, FACES
    for _ in range(2):
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    return Mesh(vertices, faces)


def off_surface(mesh: Mesh, vertices: np.ndarray) -> np.ndarray:
    """(n, 3) distance of vertices from the sides they belong to, 0 where they may slide; % of the diagonal."""
    on_side = truth().vertices > 1 - 1e-9
    return 100 * np.where(on_side, vertices - 1, 0) / mesh.diagonal


def start(error: float = 0.7, seed: int = 0) -> Mesh:
    """The corner with every coordinate off by a Gaussian error, % of the diagonal."""
    exact = truth()
    noise = np.random.default_rng(seed).normal(0, error / 100 * exact.diagonal, exact.vertices.shape)
    return Mesh(exact.vertices + noise, exact.faces)


def points_at(positions: np.ndarray) -> FeaturePoints:
    """Points that all photos see, with noise."""
    n, v = len(positions), len(cameras())
    noisy = positions + np.random.default_rng(1).normal(0, SIGMA, positions.shape)
    nothing = np.zeros((n, 3), np.uint8)
    return FeaturePoints(
        noisy, np.tile(SIGMA**2 * np.eye(3), (n, 1, 1)), nothing, v * np.arange(n + 1), np.tile(np.arange(v), n),
        np.zeros((n * v, 2)), np.zeros(n), 0.2,
    )  # fmt: skip


def on_sides(n: int) -> np.ndarray:
    """(n, 3) points on the three sides."""
    rng = np.random.default_rng(2)
    positions = rng.uniform(0, 1, (n, 3))
    positions[np.arange(n), np.arange(n) % 3] = 1
    return positions


def rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean()))


def test_vertices_move_to_the_surface():
    mesh = start()
    fit = fit_of_points(mesh, cameras(), points_at(on_sides(4000)))
    before, after = off_surface(mesh, mesh.vertices), off_surface(mesh, fit.vertices)
    assert rms(after) < 0.2 * rms(before)
    assert np.median(np.abs(after[after != 0])) < 0.05
    assert fit.loss[1] < 0.1 * fit.loss[0]
    assert fit.assigned > 3500
    assert fit.start_error == pytest.approx(0.007 * mesh.diagonal, rel=0.4)


def test_a_start_that_the_points_find_nearly_right_is_held_more_firmly():
    """By as much as they measure: with a fixed prior, few and noisy points would spoil it."""
    mesh, rng = start(0.1), np.random.default_rng(8)
    noisy = points_at(on_sides(250) + rng.normal(0, 0.0015 * mesh.diagonal, (250, 3)))
    held = fit_of_points(mesh, cameras(), noisy).vertices
    free = fit_of_points(mesh, cameras(), noisy, sigma=PRIOR_SIGMA * mesh.diagonal / 100).vertices
    assert not np.array_equal(free, mesh.vertices)
    assert rms(off_surface(mesh, held)) < 0.95 * rms(off_surface(mesh, free))


def test_ground_and_background_and_what_stands_in_front_change_nothing():
    mesh, rng = start(), np.random.default_rng(3)
    points = on_sides(3000)
    away = -np.ones(3) / np.sqrt(3)
    background = points[:800] + away * rng.uniform(0.3, 2, (800, 1)) + rng.normal(0, 0.5, (800, 3))
    ground = np.column_stack([rng.uniform(-1.5, 2.5, (1500, 2)), np.full(1500, -0.02)])  # just below the rim
    in_front = 1.3 + rng.normal(0, 0.05, (400, 3))
    clean = fit_of_points(mesh, cameras(), points_at(points))
    fit = fit_of_points(mesh, cameras(), points_at(np.concatenate([points, background, ground, in_front])))
    assert rms(off_surface(mesh, fit.vertices)) < 1.3 * rms(off_surface(mesh, clean.vertices))


def test_a_start_at_the_truth_stays_there():
    mesh = truth()
    fit = fit_of_points(mesh, cameras(), points_at(on_sides(3000)))
    assert rms(off_surface(mesh, fit.vertices)) < 100 * SIGMA / mesh.diagonal
    assert fit.start_error < 2 * SIGMA


def test_no_points_leave_the_start_as_it_is():
    mesh = start()
    for points in (FeaturePoints.none("no texture"), points_at(on_sides(30) - 5)):
        fit = fit_of_points(mesh, cameras(), points)
        np.testing.assert_array_equal(fit.vertices, mesh.vertices)
        assert (fit.assigned, fit.start_error) == (0, 0.0)


def test_no_face_folds_over():
    mesh = start(2.0, seed=5)
    fit = fit_of_points(mesh, cameras(), points_at(on_sides(4000)))
    before, after = (Mesh(v, mesh.faces).vertices[mesh.faces] for v in (mesh.vertices, fit.vertices))
    normals = [np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) for t in (before, after)]
    assert ((normals[0] * normals[1]).sum(axis=1) >= 0).all()


def test_the_same_points_give_the_same_vertices():
    mesh, points = start(), points_at(on_sides(1500))
    first, second = (fit_of_points(mesh, cameras(), points).vertices for _ in range(2))
    assert first.tobytes() == second.tobytes()


def test_locked_vertices_stay():
    mesh = start()
    locked = np.arange(len(mesh.vertices)) % 3 == 0
    fit = fit_of_points(mesh, cameras(), points_at(on_sides(3000)), locked)
    np.testing.assert_array_equal(fit.vertices[locked], mesh.vertices[locked])
    assert (fit.vertices[~locked] != mesh.vertices[~locked]).any()


def test_points_of_ground_and_background_are_not_on_the_surface():
    mesh, rng = truth(), np.random.default_rng(6)
    ground = np.column_stack([rng.uniform(1.2, 2.5, (300, 2)), np.full(300, -0.02)])
    found = points_on_surface(mesh, cameras(), points_at(np.concatenate([on_sides(600), ground])))
    assert found[:600].mean() > 0.9
    assert not found[600:].any()


def test_points_lose_less_at_the_truth_than_at_a_displaced_mesh():
    points = points_at(on_sides(2000))
    assert loss_of_points(truth(), cameras(), points) < 0.5 * loss_of_points(start(), cameras(), points)


def test_distances_in_photos_are_those_of_a_slow_loop():
    n = 90
    positions = on_sides(n)
    side = np.argmax(positions, axis=1)
    positions[np.arange(n), side] += np.random.default_rng(3).uniform(-0.01, 0.01, n)
    exact = points_at(positions)
    found = distances_px(truth(), cameras(), exact)
    expected = []
    for p, s in zip(exact.positions, side, strict=True):
        nearest = min(np.linalg.norm(p - camera.center) / camera.K[0, 0] for camera in cameras())
        expected.append(abs(p[s] - 1) / nearest)
    # Points near a side's rim may belong to no face.
    assert len(found) > 0.9 * n
    assert all(np.isclose(expected, value, rtol=1e-6).any() for value in found)


def test_points_prefer_the_better_mesh_and_only_clearly():
    points = points_at(on_sides(2000))
    assert points_prefer(start(), truth(), cameras(), points)
    assert not points_prefer(truth(), start(), cameras(), points)
    assert not points_prefer(truth(), truth(), cameras(), points)
    few = points_at(on_sides(3))
    assert not points_prefer(start(0.05), truth(), cameras(), few)


def test_points_of_a_capture_get_the_covariances_of_their_residuals():
    views = range(len(cameras()))
    positions = on_sides(60)
    rng = np.random.default_rng(7)
    observations = np.array([(p, v) for p in range(60) for v in views])[rng.permutation(60 * len(views))]
    pixels = np.array([cameras()[v].project(positions[p])[0] for p, v in observations]) + rng.normal(
        0, 0.3, (len(observations), 2)
    )
    once = np.concatenate([observations, [[60, 0]]])  # a point that one photo observes has no position of its own
    sparse = SparsePoints(
        np.concatenate([positions, [[0.5, 0.5, 1.0]]]),
        np.zeros((61, 3), np.uint8),
        once,
        np.append(pixels, [[5, 5]], axis=0),
    )
    found = FeaturePoints.of_sparse_points(sparse, cameras())
    np.testing.assert_array_equal(found.positions, positions)
    assert (found.n_views == len(views)).all()
    p = 7
    J = np.concatenate([camera.J_image_wrt_point(positions[p]).reshape(2, 3) for camera in cameras()])
    # The scale of the covariance is estimated from residuals, its shape is exact.
    expected = np.linalg.inv(J.T @ J)
    assert np.allclose(found.covariance[p] / np.trace(found.covariance[p]), expected / np.trace(expected), atol=1e-9)
    assert np.trace(found.covariance[p]) == pytest.approx(0.3**2 * np.trace(expected), rel=0.5)

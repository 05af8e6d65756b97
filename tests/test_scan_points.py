"""Scan points: edges and ends of the surface are chosen, and visibility in photos is correct."""

import numpy as np
import pytest

from fairing.errors import InputError
from fairing.geometry.rasterize import rasterize
from fairing.registration.scan_points import critical_points, seen_points
from tests.small_scene import FACES, VERTICES, corner_scene


def scan(noise: float = 0.0) -> np.ndarray:
    """The three visible sides of the cube, scanned on a grid that misses edges and corners."""
    rng = np.random.default_rng(4)
    u, v = (w.ravel() for w in np.meshgrid(*2 * [np.linspace(0.013, 0.987, 45)]))
    sides = [np.insert(np.column_stack([u, v]), axis, 1.0, axis=1) for axis in range(3)]
    points = np.concatenate(sides)
    return points + rng.normal(0, noise, points.shape)


@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_bends_and_ends_are_chosen_densely_and_planes_sparsely(noise):
    found = critical_points(scan(noise), 0.1)
    to_edge = np.sort(np.minimum(found.positions, np.abs(1 - found.positions)), axis=1)[:, 1]
    is_near = to_edge < 0.06
    assert is_near[: len(found.positions) // 2].mean() > 0.95
    apart = np.linalg.norm(found.positions[:, None] - found.positions, axis=-1) + np.eye(len(found.positions))
    assert apart.min() >= 0.1
    assert apart[~is_near][:, ~is_near].min() >= 0.25
    assert 9 * 8 * 0.6 < is_near.sum() < 9 * 11, is_near.sum()  # nine edges of length 1
    assert (~is_near).sum() >= 3 * 3
    assert found.is_end[np.linalg.norm(found.positions - VERTICES[1], axis=1) < 0.05].all()


def test_every_corner_of_the_cube_has_a_point_near_it():
    found = critical_points(scan(), 0.08).positions
    distance = np.linalg.norm(found[:, None] - VERTICES, axis=-1).min(axis=0)
    assert distance.max() < 0.06, distance


def test_photos_see_points_that_are_not_occluded():
    points = scan()
    table = 0.3 + 0.3 * points[:400]  # a plate within the cube: hidden from everywhere
    everything = np.concatenate([points, table])
    chosen = np.concatenate([points[::37], table[::50]])
    views = corner_scene().views
    found = seen_points(everything, chosen, views, 0.1)
    is_seen = np.zeros((len(chosen), len(views)), dtype=bool)
    is_seen[found.observations[:, 0], found.observations[:, 1]] = True
    n_outer = len(points[::37])
    assert not is_seen[n_outer:].any()
    expected = np.zeros_like(is_seen)
    for v, view in enumerate(views):
        _, depth = rasterize(VERTICES, FACES, view.camera)
        uv, own = view.camera.project(chosen[:n_outer])
        x, y = np.round(uv).astype(int).T
        inside = (x >= 0) & (x < view.camera.width) & (y >= 0) & (y < view.camera.height)
        expected[np.flatnonzero(inside), v] = own[inside] < depth[y[inside], x[inside]] * 1.01
    assert (is_seen[:n_outer] == expected[:n_outer]).mean() > 0.97
    uv = np.array([views[v].camera.project(chosen[p])[0] for p, v in found.observations])
    np.testing.assert_allclose(found.pixels, uv)


def test_a_scan_of_a_few_points_is_refused():
    with pytest.raises(InputError, match="at least 50 points, found 3"):
        critical_points(VERTICES[:3], 0.1)

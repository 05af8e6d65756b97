"""Experiments: their measurements against independent computations, and resuming."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from demo_scenes import load_demo
from fairing.cells.layout import cell_grid
from fairing.cells.scale_space import LUMA
from fairing.errors import InputError
from fairing.experiments import CaptureRange, KSweep, NoiseAgainstBound, Setting, WarpComparison, results
from fairing.experiments.k_sweep import part_left
from fairing.experiments.noise import noisy_views
from fairing.judge import cramer_rao
from fairing.judge.cramer_rao import cramer_rao_bound, cramer_rao_covariance, luma_noise
from fairing.photo import ArrayPhoto
from fairing.run.session import Session
from tests.small_scene import FACES, VERTICES, corner_scene, small_options

ONE_LEVEL = small_options(schedule={"blur": [1.2], "max_sweeps": [4]}, cells={"size": [48]})


@pytest.fixture(scope="module")
def setting() -> Setting:
    return Setting.of(corner_scene(), ONE_LEVEL)


# ---------------------------------------------------------------------- the ground


def test_the_best_seen_vertex_is_the_corner_that_all_faces_share(setting: Setting):
    assert setting.vertex == 0
    assert Setting.of(load_demo("cube")).vertex == 0


def test_errors_are_percent_of_the_shortest_edge(setting: Setting):
    assert setting.edge == 1.0
    direction = setting.directions(5)[2]
    scene = setting.displaced(7.0, direction)
    assert setting.distance(scene.mesh.vertices) == pytest.approx(7.0)
    np.testing.assert_array_equal(scene.mesh.vertices[1:], VERTICES[1:])
    np.testing.assert_allclose(scene.mesh.vertices[0], VERTICES[0] + 0.07 * direction)


def test_directions_are_unit_vectors_on_all_sides(setting: Setting):
    directions = setting.directions(12)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    assert np.linalg.norm(directions.mean(axis=0)) < 0.1
    apart = directions @ directions.T - 2 * np.eye(12)
    assert apart.max() < np.cos(np.radians(30))


def test_errors_of_a_vertex_on_an_edge_are_measured_across_it():
    setting = Setting.of(corner_scene(), ONE_LEVEL, vertex=1)  # on the edge of y = 1 and z = 1
    np.testing.assert_allclose(setting.directions(4)[:, 0], 0, atol=1e-12)
    vertices = VERTICES.copy()
    vertices[1] += (0.3, 0.04, 0.03)
    assert setting.distance(vertices) == pytest.approx(5.0)


def test_a_scene_without_truth_is_refused_in_one_line():
    scene = replace(corner_scene(), truth=None)
    with pytest.raises(InputError, match=r"scene corner: .*they are unknown; use a synthetic scene") as error:
        Setting.of(scene)
    assert "\n" not in str(error.value)


def test_a_vertex_that_does_not_exist_is_refused():
    with pytest.raises(InputError, match="vertex 7: this mesh has vertices 0 to 6"):
        Setting.of(corner_scene(), vertex=7)


def test_only_the_vertex_moves_in_a_run_whatever_the_options_lock(setting: Setting):
    options = replace(ONE_LEVEL, locked_vertices=(0,), lock_boundary=True)
    session = setting.session(setting.displaced(5, setting.directions(1)[0]), options)
    assert session.locked.tolist() == [False, *6 * [True]]


# ---------------------------------------------------------------------- the bound


def dense_bound(noise: float, size: int, views: list[int]) -> np.ndarray:
    """The Fisher information with every texel's grey level written out as an unknown, then inverted."""
    scene = corner_scene((0, 0, 0))
    ramp = cell_grid(size).astype(float)
    bary = np.stack([ramp[0], ramp[1], 1 - ramp[0] - ramp[1]], axis=1)
    texels = len(bary)
    information = np.zeros((3 + 6 * texels, 3 + 6 * texels))
    for f, face in enumerate(FACES):
        hat = bary[:, list(face).index(0)]
        points = bary @ VERTICES[face]
        for i in views:
            camera, photo = scene.views[i].camera, scene.views[i].photo.load()[..., 0].astype(float)
            uv, _ = camera.project(points)
            moved = np.stack([camera.project(points + 1e-5 * axis)[0] for axis in np.eye(3)])
            back = np.stack([camera.project(points - 1e-5 * axis)[0] for axis in np.eye(3)])

            def grey(places, photo=photo):
                return map_coordinates(
                    photo, places[..., ::-1].transpose(2, 0, 1).reshape(2, -1), order=3, mode="mirror"
                )

            g = ((grey(uv + 50 * (moved - uv)) - grey(uv + 50 * (back - uv))).reshape(3, -1) / 0.001).T
            area = 0.5 * abs(np.linalg.det(np.diff(camera.project(VERTICES[face])[0], axis=0)))
            for t in range(texels):
                row = np.zeros(len(information))
                row[:3], row[3 + f * texels + t] = hat[t] * g[t], 1
                information += area / texels / noise**2 * np.outer(row, row)
    return np.linalg.inv(information)[:3, :3]


def test_the_bound_is_the_inverse_of_the_whole_fisher_information(monkeypatch):
    monkeypatch.setattr(cramer_rao, "CELL_SIZE", 8)
    views = {face: np.array([0, 2, 5]) for face in range(6)}
    found = cramer_rao_covariance(corner_scene(), 0, 3.0, views)
    expected = dense_bound(3.0, 8, [0, 2, 5])
    # The dense one spreads a face's area in a photo evenly over its texels; perspective makes some larger.
    np.testing.assert_allclose(found, expected, rtol=0.15, atol=0.15 * np.abs(expected).max())


def test_the_bound_grows_with_the_noise_and_with_fewer_photos(monkeypatch):
    monkeypatch.setattr(cramer_rao, "CELL_SIZE", 48)
    scene = corner_scene()
    assert cramer_rao_bound(scene, 0, 4.0) == pytest.approx(2 * cramer_rao_bound(scene, 0, 2.0))
    assert cramer_rao_bound(corner_scene(count=4), 0, 2.0) > cramer_rao_bound(scene, 0, 2.0)


def test_a_bound_on_a_scene_without_truth_or_on_an_unseen_vertex_is_refused():
    with pytest.raises(InputError, match="true positions"):
        cramer_rao_bound(replace(corner_scene(), truth=None), 0, 1.0)
    with pytest.raises(InputError, match="leave a direction undetermined"):
        cramer_rao_covariance(corner_scene(), 0, 1.0, {face: np.zeros(0, int) for face in range(6)})


def test_luma_noise_follows_from_noise_in_three_channels():
    rng = np.random.default_rng(0)
    smooth = rng.uniform(50, 200, (200_000, 1))
    noisy = np.rint(smooth + 3 * rng.standard_normal((200_000, 3)))
    luma = (noisy - smooth) @ LUMA
    assert luma.std() == pytest.approx(luma_noise(3.0), rel=0.01)


def test_noisy_photos_are_seeded_and_have_the_requested_noise():
    flat = replace(corner_scene().views[0], photo=ArrayPhoto(np.full((120, 160, 3), 128, np.uint8)))
    (first,), (again,), (other,) = (noisy_views((flat,), 5.0, seed) for seed in (3, 3, 4))
    assert first.photo.load().std() == pytest.approx(5.0, rel=0.02)
    np.testing.assert_array_equal(first.photo.load(), again.photo.load())
    assert not np.array_equal(first.photo.load(), other.photo.load())


# ---------------------------------------------------------------------- the experiments


def test_cases_already_measured_are_not_measured_again(setting: Setting):
    experiment = CaptureRange(starts=(4.0, 8.0), directions=2)
    whole = list(results(experiment, setting))
    assert [(row["start_percent"], row["direction"]) for row in whole] == [(4, 0), (8, 0), (4, 1), (8, 1)]
    rest = list(results(experiment, setting, done=[whole[0], whole[2]]))
    assert rest == [whole[1], whole[3]]


def test_a_near_start_converges_and_one_across_the_edge_does_not(setting: Setting):
    experiment = CaptureRange(starts=(4.0, 90.0), directions=1)
    near, far = results(experiment, setting)
    assert near["end_percent"] < 0.4
    assert far["end_percent"] > 9
    assert "up to 4 %" in experiment.finding([near, far])
    assert "From 90 % it converged from 0 of 1 directions." in experiment.finding([near, far])


def test_the_end_error_is_that_of_an_ordinary_run(setting: Setting):
    (row,) = results(CaptureRange(starts=(6.0,), directions=1), setting)
    direction = setting.directions(1)[0]
    session = Session(corner_scene(tuple(0.06 * direction)), replace(ONE_LEVEL, locked_vertices=tuple(range(1, 7))))
    session.run()
    assert row["end_percent"] == pytest.approx(100 * np.linalg.norm(session.vertices[0] - 1), rel=1e-6)
    assert row["steps"] == len(session.trace)


def test_noise_costs_accuracy_and_the_bound_lies_below(setting: Setting, monkeypatch):
    monkeypatch.setattr(cramer_rao, "CELL_SIZE", 48)
    experiment = NoiseAgainstBound(noises=(0.0, 12.0), draws=2)
    rows = list(results(experiment, setting))
    assert [(row["noise"], row["draw"]) for row in rows] == [(0, 0), (12, 0), (12, 1)]
    noisy = [row for row in rows if row["noise"] == 12]
    assert min(row["end_percent"] for row in noisy) > rows[0]["bound_percent"]
    expected = 100 * cramer_rao_bound(corner_scene(), 0, luma_noise(12.0))
    assert noisy[0]["bound_percent"] == pytest.approx(expected, rel=1e-3)
    assert noisy[0]["end_percent"] != noisy[1]["end_percent"]
    assert "(rms of 2)" in experiment.finding(rows)


def test_bias_and_spread_of_the_draws_are_separated():
    rows = [{"noise": 2.0, "bound_percent": 0.01, "end_percent": end, "error": [end]} for end in (0.10, 0.12, 0.11)]
    said = NoiseAgainstBound().finding(rows)
    assert "0.11 % of the edge (rms of 3), 11.0 times the bound" in said
    assert "The spread about the mean is 1.0 times the bound." in said


def test_an_eigenspace_of_more_dimensions_absorbs_more_misalignment(setting: Setting):
    direction = setting.directions(2)[0]
    left = [part_left(setting, k, direction) for k in range(1, 6)]
    assert all(later < earlier for earlier, later in pairwise(left)), left
    assert left[0] < 0.5  # even one dimension follows the texture
    assert left[4] < 0.1 * left[0]


def test_k_runs_from_one_to_the_number_of_views_minus_two(setting: Setting):
    # Two of the eight photos see some of the faces at too flat an angle.
    assert [case["k"] for case in KSweep(directions=1).cases(setting)] == [1, 2, 3, 4]
    with pytest.raises(InputError, match="k from 1 to 4"):
        KSweep(dimensions=(3, 5)).cases(setting)


def test_the_warps_differ_from_the_same_start(setting: Setting):
    experiment = WarpComparison(starts=(8.0,), directions=1)
    rows = list(results(experiment, setting))
    ends = {(row["warp"], row["solver"]): row["end_percent"] for row in rows}
    assert len(ends) == 4
    assert min(ends, key=lambda variant: ends[variant]) == ("homography", "variable_projection")
    for row in rows:
        assert row["path"][0] == pytest.approx(8.0)
        assert row["path"][-1] == row["end_percent"]
        assert len(row["path"]) == row["steps"] + 1
    assert "homography, variable projection" in experiment.finding(rows)

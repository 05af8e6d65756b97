"""Metrics against brute force, scikit-image and manual calculations."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from fairing.camera import Camera
from fairing.geometry.closest_point import SurfaceTree
from fairing.geometry.rasterize import rasterize
from fairing.judge.left_out import Prediction, leave_one_out, psnr, ssim_map
from fairing.judge.metrics import (
    Distances,
    determined_part,
    energy_summary,
    flipped_faces,
    held_out_distances,
    quality_report,
    reprojection_error,
    sample_surface,
    surface_distance,
    vertex_errors,
)
from fairing.judge.render import OUTLIER, Renderer, robust_mean
from fairing.mesh import Mesh
from fairing.photo import ArrayPhoto, Mask
from fairing.run.session import Session
from fairing.scene import Scene, View
from tests.small_scene import FACES, START, VERTICES, corner_scene, observed, on_the_faces, small_options, sparse_points

pytestmark = pytest.mark.compiled


@pytest.mark.parametrize("count", [1, 3, 4, 5, 300])
def test_closest_point_agrees_with_a_loop_over_all_triangles(count):
    rng = np.random.default_rng(count)
    vertices = rng.normal(size=(3 * count, 3)) * [1, 1, 0.2]
    faces = np.arange(3 * count).reshape(-1, 3)
    if count > 4:
        vertices[faces[1]] = vertices[faces[1, 0]]  # a point
        vertices[faces[2, 2]] = 0.3 * vertices[faces[2, 0]] + 0.7 * vertices[faces[2, 1]]  # a line
    points = rng.normal(size=(200, 3)) * 2
    distance, face = SurfaceTree(Mesh(vertices, faces)).closest(points)
    pairs = np.repeat(points, count, axis=0)
    foot = trimesh.triangles.closest_point(np.tile(vertices[faces], (len(points), 1, 1)), pairs)
    expected = np.linalg.norm(foot - pairs, axis=1).reshape(len(points), count)
    assert np.abs(distance - np.nanmin(expected, axis=1)).max() < 1e-9
    reached = expected[np.arange(len(points)), face]
    sound = np.isfinite(reached)
    assert np.abs(reached - distance)[sound].max() < 1e-9


def test_surface_samples_lie_on_the_mesh_in_proportion_to_area_and_repeat():
    mesh = Mesh(VERTICES * [1, 1, 3], FACES)
    points = sample_surface(mesh)
    assert np.array_equal(points, sample_surface(mesh))
    assert SurfaceTree(mesh).distance(points).max() < 1e-12
    top = (points[:, 2] > 3 - 1e-9).mean()
    assert top == pytest.approx(1 / 7, abs=1e-3)


def test_surface_distance_of_a_shifted_plane_is_the_shift():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    found = surface_distance(
        Mesh(square + np.array([0, 0, 0.01]), faces), Mesh(4 * square - [1, 1, 0], faces), np.sqrt(2)
    )
    summary = found.summary()
    for name in ("rms", "mean", "median", "max"):
        assert summary[f"{name}_world"] == pytest.approx(0.01)
        assert summary[f"{name}_percent"] == pytest.approx(1 / np.sqrt(2))


def test_summaries_agree_with_manual_calculation():
    summary = Distances(np.array([0.0, 3.0, 4.0]), 50.0).summary()
    assert summary["rms_world"] == pytest.approx(np.sqrt(25 / 3))
    assert summary["median_world"] == 3
    assert summary["mean_percent"] == pytest.approx(100 * (7 / 3) / 50)
    assert summary["max_percent"] == 8


def test_errors_split_into_what_photos_determine_and_free_sliding():
    scene = corner_scene()
    vertices = VERTICES.copy()
    vertices[0] += [0.1, 0.2, 0.2]  # a corner of three planes
    vertices[1] += [0.3, 0.0, 0.4]  # an edge along x
    vertices[2] += [0.6, 0.8, 0.5]  # in the plane z = 1
    errors = vertex_errors(scene, vertices)
    assert errors.total.values == pytest.approx([0.3, 0.5, np.sqrt(1.25), 0, 0, 0, 0])
    assert errors.determined.values == pytest.approx([0.3, 0.4, 0.5, 0, 0, 0, 0])
    assert errors.sliding.values == pytest.approx([0, 0.3, 1, 0, 0, 0, 0])
    assert errors.total.diagonal == scene.mesh.diagonal


def test_the_determined_part_ignores_normals_that_repeat_each_other():
    scene = corner_scene()
    tilted = np.array([[0, 0, 1], [0, 0.001, 1], [0, 0, 1]]) / np.linalg.norm([0, 0.001, 1])
    assert scene.truth is not None
    scene = replace(scene, truth=replace(scene.truth, normals=[tilted] * 7))
    part = determined_part(scene, np.tile([3.0, 4.0, 5.0], (7, 1)))
    assert part[0] == pytest.approx([0, 0, 5], abs=0.01)


def test_reprojection_error_is_the_rms_over_photos():
    scene = corner_scene()
    errors = reprojection_error(scene, scene.mesh.vertices)
    pixels = [view.camera.project(np.stack([VERTICES[0] + START, VERTICES[0]]))[0] for view in scene.views]
    assert errors[0] == pytest.approx(np.sqrt(np.mean([((a - b) ** 2).sum() for a, b in pixels])))
    assert (errors[1:] == 0).all()
    slid = VERTICES.copy()
    slid[1] += [0.2, 0, 0]
    assert reprojection_error(scene, slid)[1] < 1e-9
    assert reprojection_error(scene, slid, determined_only=False)[1] > 5


def test_flips_are_counted_against_the_start():
    end = VERTICES.copy()
    end[2] = [0.5, 1.5, 1]  # beyond the square's diagonal, in its plane: one of its triangles turns over
    assert flipped_faces(VERTICES, end, FACES).tolist() == [0]
    assert len(flipped_faces(VERTICES, VERTICES, FACES)) == 0


def test_held_out_sparse_points_are_measured_to_both_meshes():
    scene = corner_scene()
    assert held_out_distances(scene, VERTICES, VERTICES) is None
    kept = np.array([[0.5, 0.5, 1.02], [1.01, 0.5, 0.5], [0.5, 1.05, 0.5]])
    points = sparse_points(np.repeat(kept, 2, axis=0) + np.tile([[9.0], [0.0]], (3, 1)))
    found = held_out_distances(replace(scene, sparse_points=points), VERTICES, VERTICES + np.array([0, 0, 0.02]))
    assert found is not None
    assert found.before.values == pytest.approx([0.02, 0.01, 0.05])
    assert found.after.values[0] == pytest.approx(0)
    assert (found.held_out, len(found.after.values)) == (3, 3)


GROUND = np.random.default_rng(3).uniform([1.05, -2, -0.05], [3, 3, -0.05], (400, 3))


@pytest.mark.parametrize("photos_are_known", [True, False])
def test_points_of_the_ground_do_not_count_as_points_of_the_surface(photos_are_known: bool):
    scene, positions = corner_scene(), np.concatenate([on_the_faces(120), GROUND])
    if photos_are_known:
        scene = observed(scene, positions)
    else:
        scene = replace(scene, sparse_points=sparse_points(np.repeat(positions, 2, axis=0)))
    found = quality_report(scene, scene.mesh.vertices, VERTICES)["sparse_points_to_surface"]
    assert found["held_out"] == 520
    # Points of the ground beside the cube lie within a tenth of the diagonal of it; only their photos tell them apart.
    nearby = 0 if photos_are_known else int((_distance_to_corner(GROUND) < 0.1 * scene.mesh.diagonal).sum())
    assert found["on_surface"] == 120 + nearby
    assert found["after"]["median_percent"] < 1e-9
    assert found["before"]["median_percent"] > 0.1


def test_without_points_on_the_surface_the_report_has_numbers_only():
    scene = observed(corner_scene(), GROUND)
    assert quality_report(scene, VERTICES, VERTICES)["sparse_points_to_surface"] == {"held_out": 400, "on_surface": 0}


def _distance_to_corner(points: np.ndarray) -> np.ndarray:
    return SurfaceTree(Mesh(VERTICES, FACES)).distance(points)


def test_energy_summary_equals_the_recorded_energies():
    session = Session(corner_scene(), small_options())
    for _ in range(3):
        session.step()
    for moment, record in enumerate(session.trace.steps):
        summary = energy_summary(session, moment)
        assert np.array_equal(summary.by_face, record.face_energy_before)
        assert np.array_equal(summary.by_view, record.view_energy_before)
        assert summary.total == summary.by_face.sum()


def test_the_quality_report_names_before_and_after():
    scene = corner_scene()
    report = quality_report(scene, scene.mesh.vertices, VERTICES)
    assert report["flipped_faces"] == []
    assert report["vertices_determined"]["before"]["max_world"] == pytest.approx(np.linalg.norm(START))
    assert report["vertices_determined"]["after"]["max_world"] == 0
    assert report["vertices_determined"]["most_worsened_percent"] == 0
    assert report["surface_to_truth"]["after"]["max_world"] < 1e-12
    assert report["reprojection_px"]["before"]["max"] > 1


def test_psnr_and_ssim_agree_with_scikit_image():
    rng = np.random.default_rng(3)
    reference = rng.uniform(0, 255, (60, 70))
    image = reference + rng.normal(0, 20, reference.shape)
    assert psnr(image, reference) == pytest.approx(peak_signal_noise_ratio(reference, image, data_range=255))
    _, expected = structural_similarity(
        image, reference, data_range=255, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, full=True
    )
    # The two differ only where the window leaves the picture.
    assert np.abs(ssim_map(image, reference) - expected)[5:-5, 5:-5].max() < 1e-9


def test_the_robust_mean_agrees_with_a_plain_one_and_leaves_outliers_out():
    rng = np.random.default_rng(0)
    colors = rng.uniform(90, 110, (7, 50, 3)).astype(np.float32)
    weights = rng.uniform(0, 1, (7, 50)).astype(np.float32)
    weights[rng.random((7, 50)) < 0.3] = 0
    weights[:, 0] = 0
    found = robust_mean(colors, weights)
    assert (found[0] == 0).all()
    for q in range(1, 50):
        seen = weights[:, q] > 0
        c, w = colors[seen, q].astype(float), weights[seen, q].astype(float)
        center = np.median(c, axis=0)
        for _ in range(3):
            trust = w / (1 + ((c - center) ** 2).mean(axis=1) / OUTLIER**2) ** 2
            center = trust @ c / trust.sum()
        assert found[q] == pytest.approx(center, abs=1e-3)
    colors = np.full((5, 1, 3), 100, np.float32)
    colors[4] = 250
    assert robust_mean(colors, np.ones((5, 1), np.float32))[0] == pytest.approx([100] * 3, abs=0.1)


def layered_scene() -> Scene:
    """A grey wall partly hidden by a bright board, seen by five cameras side by side."""
    wall = np.array([[-4, -4, 6], [4, -4, 6], [4, 4, 6], [-4, 4, 6]], float)
    board = np.array([[-0.5, -0.5, 4], [0.5, -0.5, 4], [0.5, 0.5, 4], [-0.5, 0.5, 4]], float)
    vertices = np.vstack([wall, board])
    faces = np.array([[0, 2, 1], [0, 3, 2], [4, 6, 5], [4, 7, 6]])
    views = []
    for i, x in enumerate((-1.0, -0.5, 0.0, 0.5, 1.0)):
        K = np.array([[100, 0, 60], [0, 100, 45], [0, 0, 1]], float)
        camera = Camera.from_krt(K, np.eye(3), np.array([-x, 0, 0]), 121, 91)
        face_id, _ = rasterize(vertices, faces, camera)
        grey = np.where(face_id >= 2, 220, 90).astype(np.uint8)
        views.append(View(f"{i}", camera, ArrayPhoto(np.repeat(grey[..., None], 3, axis=2))))
    return Scene.build("layers", vertices, faces, tuple(views), points_choice="given")


def test_occluders_do_not_contribute_colours_to_hidden_surfaces():
    scene = layered_scene()
    rendered = Renderer(scene, scene.mesh.vertices).render(2)
    truth = scene.views[2].photo.load()
    known = rendered.is_known
    assert known.mean() > 0.8
    edges = np.abs(np.diff(truth[..., 0].astype(int), axis=0, prepend=0)) + np.abs(
        np.diff(truth[..., 0].astype(int), axis=1, prepend=0)
    )
    near_edge = np.zeros(known.shape, bool)
    for dy in (-2, -1, 0, 1, 2):
        for dx in (-2, -1, 0, 1, 2):
            near_edge |= np.roll(edges > 0, (dy, dx), (0, 1))
    wrong = np.abs(rendered.image - truth).max(axis=2)[known & ~near_edge]
    # Photos mix both colours at the board's edge; such an outlier keeps 1/2000 of its weight.
    assert wrong.max() < 0.5
    assert rendered.n_sources[45, 60] == 4
    assert rendered.n_sources[5, 60] == 4
    # Beside the board two of the other cameras see the board instead of the wall.
    assert rendered.n_sources[45, 60 + 16] < 4


def test_the_true_mesh_predicts_left_out_photos_better_than_the_start():
    scene = corner_scene()
    start, truth = leave_one_out(scene, scene.mesh.vertices, VERTICES, views=[0, 3])
    assert (truth.psnr > start.psnr + 3).all()
    assert (truth.ssim > start.ssim).all()
    assert np.array_equal(truth.share, start.share)


def masked(view: View, counts: np.ndarray, folder: Path) -> View:
    Image.fromarray(counts.astype(np.uint8) * 255).save(folder / f"{view.name}.png")
    return replace(view, mask=Mask(folder / f"{view.name}.png"))


def test_masked_pixels_contribute_no_colour_and_are_not_evaluated(tmp_path: Path):
    scene = layered_scene()
    half = np.ones((91, 121), bool)
    half[:, :60] = False
    red = scene.views[3].photo.load().copy()
    red[:, :60] = (255, 0, 0)
    red_view = replace(scene.views[3], photo=ArrayPhoto(red))
    views = [*scene.views[:3], masked(red_view, half, tmp_path), scene.views[4]]
    rendered = Renderer(replace(scene, views=tuple(views)), scene.mesh.vertices).render(2)
    plain = Renderer(scene, scene.mesh.vertices).render(2)
    fooled = Renderer(replace(scene, views=(*scene.views[:3], red_view, scene.views[4])), scene.mesh.vertices).render(2)
    # Red never shows, not even at the mask's border, where pixels mix.
    known = rendered.is_known
    assert np.ptp(rendered.image[known], axis=1).max() < 1e-3
    assert np.ptp(fooled.image[known], axis=1).max() > 1e-3
    assert (rendered.n_sources <= plain.n_sources).all()
    assert (rendered.n_sources < plain.n_sources).any()
    judged = replace(scene, views=tuple([masked(scene.views[2], half, tmp_path), *scene.views[:2], *scene.views[3:]]))
    predictions: list[Prediction] = []
    leave_one_out(judged, scene.mesh.vertices, views=[0], on_view=predictions.append)
    assert not predictions[0].is_known[:, :60].any()
    assert predictions[0].is_known[:, 61:].any()


def test_photos_contribute_in_proportion_to_their_weight():
    scene = layered_scene()
    dark = replace(scene.views[3], photo=ArrayPhoto(np.clip(scene.views[3].photo.load(), 10, 255) - 6))

    def middle(weight: float) -> float:
        views = (*scene.views[:3], replace(dark, weight=weight), scene.views[4])
        return float(Renderer(replace(scene, views=views), scene.mesh.vertices).render(2).image[45, 60, 0])

    assert middle(1e-6) == pytest.approx(220, abs=1e-3)
    assert middle(1.0) < 219.5
    assert middle(1e3) < middle(1.0) - 3


def test_large_photos_are_rendered_at_reduced_size_and_from_the_best_sources_only(monkeypatch: pytest.MonkeyPatch):
    scene = layered_scene()
    whole = Renderer(scene, scene.mesh.vertices).render(2)
    monkeypatch.setattr("fairing.judge.render.LARGEST", 60 * 45)
    small = Renderer(scene, scene.mesh.vertices).render(2)
    assert small.image.shape == (45, 59, 3)
    image, known = small.at_size(121, 91)
    assert np.median(np.abs(image - whole.image)[known & whole.is_known]) < 0.5
    monkeypatch.setattr("fairing.judge.render.MOST_SOURCES", 2)
    few = Renderer(scene, scene.mesh.vertices)
    assert few.render(2).n_sources.max() == 2
    # The neighbours show the wall as this one does; those farther aside miss a part.
    assert few.render(0).n_sources.max() == 2
    assert few._sources(0) == [1, 2]


def test_exposure_is_ignored_by_default():
    scene = corner_scene()
    dark = (0.7 * scene.views[0].photo.load() + 5).astype(np.uint8)
    other = replace(scene, views=(replace(scene.views[0], photo=ArrayPhoto(dark)), *scene.views[1:]))
    matched, same = (leave_one_out(s, VERTICES, views=[0])[0] for s in (other, scene))
    plain = leave_one_out(other, VERTICES, views=[0], match_exposure=False)[0]
    # 0.7 of the contrast is 0.7 of the error: 3.1 dB more.
    assert matched.psnr[0] == pytest.approx(same.psnr[0] + 3.1, abs=0.3)
    assert plain.psnr[0] < same.psnr[0] - 3

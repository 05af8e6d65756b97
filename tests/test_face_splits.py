"""Face splits: subdivision keeps the surface, and only faces that all points contradict are divided."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields

import numpy as np
import pytest
from scipy.spatial import Delaunay

from fairing.errors import Cancelled
from fairing.features.points import FeaturePoints
from fairing.features.surface_sweep import SurfaceSweep
from fairing.geometry.closest_point import SurfaceTree
from fairing.geometry.decimate import decimate
from fairing.mesh import Mesh
from fairing.triangulation import FlipTrace, SplitRound, TriangulationOptions, triangulate
from fairing.triangulation.face_splits import split_faces
from fairing.triangulation.subdivision import subdivided
from tests.flip_records import grid_mesh, round_of_splits, split_by_hand
from tests.roof_scene import cameras, photo, views_of
from tests.wrong_cameras import exact_scene

pytestmark = pytest.mark.compiled

SQUARE = np.array([[0, -1, 0], [0, 1, 0], [-1, 0, 0], [1, 0, 0]], float)
FACES = np.array([[2, 0, 3], [2, 3, 1]])
FLAT = views_of(tuple(photo(camera, SQUARE, FACES) for camera in cameras()))
NOISE = 0.002  # a pixel of the photos covers 0.01


def edges_of(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Undirected edges (e, 2) and how many faces each has."""
    pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    return np.unique(pairs, axis=0, return_counts=True)


def area_vectors(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return np.cross(b - a, c - a) / 2


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 1.0])
def test_a_subdivided_surface_is_the_same_surface(share):
    rng = np.random.default_rng(5)
    plane = rng.uniform(size=(60, 2))
    vertices, faces = np.column_stack([plane, rng.normal(size=60)]), Delaunay(plane).simplices
    is_chosen = rng.uniform(size=len(faces)) < share
    new, parts, parent = subdivided(vertices, faces, is_chosen)
    np.testing.assert_array_equal(new[:60], vertices)
    assert len(np.unique(new, axis=0)) == len(new)
    for vector in range(3):  # each part lies in its face, turned alike
        total = np.bincount(parent, area_vectors(new, parts)[:, vector], minlength=len(faces))
        np.testing.assert_allclose(total, area_vectors(vertices, faces)[:, vector], atol=1e-12)
    assert (np.bincount(parent)[is_chosen] == 4).all()
    assert (edges_of(parts)[1] <= 2).all()
    # Border edges of the parts are those of the faces, whole or halved: an edge that ends within another would add one.
    (old_edges, old_count), (new_edges, new_count) = edges_of(faces), edges_of(parts)
    lengths = [
        np.linalg.norm(np.diff(x[e[n == 1]], axis=1), axis=2).sum()
        for x, e, n in ((vertices, old_edges, old_count), (new, new_edges, new_count))
    ]
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-12)


def points_over_the_square(height_of_photo) -> FeaturePoints:
    """Points over both faces, as many of each photo; height_of_photo(v, n): their heights over the second face."""
    rng = np.random.default_rng(6)
    n = 1600
    positions = np.zeros((n, 3))
    positions[:, 0], positions[:, 1] = rng.uniform(-0.9, 0.9, n), rng.uniform(-0.9, 0.9, n)
    positions = positions[np.abs(positions[:, :2]).sum(axis=1) < 0.9]
    photos = np.arange(len(positions)) % len(FLAT)
    # The hill's slopes begin at the edges of the second face.
    slope = np.minimum(positions[:, 1], 1 - np.abs(positions[:, 0]) - positions[:, 1]) / 0.4
    hill = np.clip(slope, 0, 1)
    positions[:, 2] = rng.normal(scale=NOISE, size=len(positions)) + hill * height_of_photo(photos, rng)
    count = len(positions)
    return FeaturePoints(
        positions, np.tile(NOISE**2 * np.eye(3), (count, 1, 1)), np.zeros((count, 3), np.uint8), np.arange(count + 1),
        photos, np.zeros((count, 2)), np.zeros(count), 0.3,
    )  # fmt: skip


def hill(photos, rng):
    return np.full(len(photos), 0.06)


CONTRADICTIONS = {
    "no point": lambda photos, rng: np.zeros(len(photos)),
    "the points that build alone": lambda photos, rng: np.where(photos % 2 == 0, 0.06, 0),
    "the points that judge alone": lambda photos, rng: np.where(photos % 2 == 1, 0.06, 0),
    "points that contradict each other": lambda photos, rng: rng.choice([-0.06, 0.06], len(photos)),
    "points less than half a pixel off": lambda photos, rng: np.full(len(photos), 0.003),
}


def split(monkeypatch: pytest.MonkeyPatch, points: FeaturePoints, smallest: float = 14.0) -> list[SplitRound]:
    monkeypatch.setattr(SurfaceSweep, "points", lambda *_: points)
    with ThreadPoolExecutor(1) as executor:
        return list(split_faces(FLAT, SQUARE, FACES, 2, smallest, executor))


def test_a_face_that_all_points_contradict_is_split_and_fitted(monkeypatch):
    points = points_over_the_square(hill)
    first, second = split(monkeypatch, points)
    vertices, faces = first.result()
    assert len(faces) > len(FACES)
    np.testing.assert_array_equal(second.vertices, vertices)
    np.testing.assert_array_equal(second.faces, faces)
    np.testing.assert_array_equal(vertices[0], SQUARE[0])  # no corner of the face
    on_first = (vertices[faces].mean(axis=1)[:, 1] < 0).sum()
    assert on_first == 2  # divided only so that no edge ends within another
    meshes = Mesh(SQUARE, FACES), Mesh(vertices, faces)
    left = [np.mean(SurfaceTree(mesh).distance(points.positions)) for mesh in meshes]
    assert left[1] < 0.6 * left[0], left
    assert first.chosen.tolist() == [1]
    assert (first.parts.tolist(), first.is_split.tolist()) == ([0], [True])
    assert 0.03 / 0.01 < first.offsets[0] < 0.06 / 0.01  # a pixel covers 0.01; the hill is 0.06 high and has slopes
    assert 100 < first.judges[0] < len(points.positions) / 2, "a quarter: half of the photos, and half of the square"
    # All of the photos that judge, those of the face, by distances along its normal.
    held_out = points.positions[(points.photos % 2 == 1) & (points.positions[:, 1] > 0)]
    assert first.judges[0] == pytest.approx(len(held_out), rel=0.1)
    sigma = np.hypot(NOISE, 0.2 * 0.01)
    expected = np.sqrt(np.mean(np.minimum((held_out[:, 2] / sigma) ** 2, 9)))
    assert first.errors[0, 0] == pytest.approx(expected, rel=0.1)
    assert first.errors[0, 1] < first.errors[0, 0]
    assert first.significance[0] > 3


@pytest.mark.parametrize("contradiction", CONTRADICTIONS)
def test_faces_that_points_do_not_contradict_together_stay(contradiction, monkeypatch):
    (done,) = split(monkeypatch, points_over_the_square(CONTRADICTIONS[contradiction]))
    assert not done.is_split.any()
    is_contradicted = contradiction == "the points that build alone"
    assert done.chosen.tolist() == [1] * is_contradicted, "candidates that are not split are recorded, too"
    np.testing.assert_array_equal(done.result()[0], SQUARE)
    np.testing.assert_array_equal(done.result()[1], FACES)


def test_small_faces_stay(monkeypatch):
    (done,) = split(monkeypatch, points_over_the_square(hill), 300.0)
    assert len(done.chosen) == 0


def test_parts_of_a_round_can_be_split_one_by_one():
    vertices, faces = grid_mesh(6)
    done = round_of_splits(vertices, faces, [[12], [0, 25], [30]], [9, 9, 9], [1.0, 1.2, 1.9])
    wanted, _, parent = subdivided(vertices, faces, np.isin(np.arange(len(faces)), [12]))
    (one, one_faces, one_parent), (whole, whole_faces, _) = (
        done.mesh_with(np.array(parts)) for parts in ([True, False, True], [True, True, True])
    )
    np.testing.assert_array_equal(one_parent, parent)
    np.testing.assert_array_equal(one[:, :2], wanted[:, :2])
    risen = np.unique(one_faces[one_parent == 12])
    np.testing.assert_array_equal(np.flatnonzero(one[:, 2] > 0), risen)
    np.testing.assert_array_equal(whole, done.after)
    assert {tuple(place) for place in one[one[:, 2] > 0].tolist()} < {tuple(place) for place in whole.tolist()}
    for mesh_faces in (one_faces, whole_faces):
        assert (edges_of(mesh_faces)[1] <= 2).all()
    np.testing.assert_array_equal(done.mesh_with(np.zeros(3, bool))[0], vertices)


def test_splits_are_recorded_and_read_again(tmp_path):
    trace = split_by_hand(*grid_mesh(5))
    trace.attach(tmp_path / "a.flips")
    trace.detach()
    loaded = FlipTrace.load(tmp_path / "a.flips")
    for before, after in zip(trace.splits, loaded.splits, strict=True):
        for field in fields(SplitRound):
            np.testing.assert_array_equal(getattr(before, field.name), getattr(after, field.name))
    np.testing.assert_array_equal(loaded.splits[-1].result()[0], loaded.vertices)


def samples_of(surface: Mesh) -> np.ndarray:
    """(k, 3) float: points spread over a surface."""
    rng, area = np.random.default_rng(8), np.linalg.norm(area_vectors(surface.vertices, surface.faces), axis=1)
    face = rng.choice(len(area), 5000, p=area / area.sum())
    return np.einsum("kc,kcx->kx", rng.dirichlet([1, 1, 1], 5000), surface.vertices[surface.faces[face]])


def test_photos_split_a_mesh_that_lacks_vertices_and_leave_a_true_one_alone(tmp_path):
    scene = exact_scene()
    assert scene.truth is not None
    assert scene.truth.vertices is not None
    true = scene.truth.vertices, scene.mesh.faces
    samples, options = samples_of(scene.truth.surface), TriangulationOptions(splits=2)
    kept = triangulate("true", scene.views, None, options, true)
    assert kept.report()["vertices_of_splits"] == [len(true[0])]
    coarse, lines = decimate(*true, np.zeros(len(true[0])), 26), []
    record = tmp_path / "coarse.flips"
    done = triangulate(
        "coarse", scene.views, None, options, coarse, record, on_progress=lambda part, line: lines.append((part, line))
    )
    vertices, faces = done.mesh()
    splits = FlipTrace.load(record).splits
    assert [len(each.after) for each in splits if each.is_split.any()] == done.report()["vertices_of_splits"][1:]
    np.testing.assert_array_equal(splits[-1].result()[0], done.scene.mesh.vertices)
    parts = [part for part, line in lines if "round 1 of 2: points" in line]
    assert len(parts) == 2 * len(scene.views), "one a task"
    assert 0 < min(parts) < max(parts) < min(part for part, line in lines if "flips" in line)
    assert done.report()["vertices_of_splits"][0] == 26
    assert len(vertices) == done.report()["vertices_of_splits"][-1] > 26
    before, after = (SurfaceTree(Mesh(*mesh)).distance(samples).mean() for mesh in (coarse, (vertices, faces)))
    assert after < 0.8 * before, (before, after)  # measured: 0.753


def test_a_stop_request_ends_the_search():
    done = triangulate("square", FLAT, None, TriangulationOptions(splits=1), (SQUARE, FACES), should_stop=lambda: True)
    assert done.trace.splits == ()

    def cancel() -> None:
        raise Cancelled

    with ThreadPoolExecutor(1) as executor, pytest.raises(Cancelled):
        list(split_faces(FLAT, SQUARE, FACES, 1, 14.0, executor, cancel))


def test_rounds_before_a_stop_remain(monkeypatch):
    points, reached = points_over_the_square(hill), []

    def sweep(sweeping: SurfaceSweep, *_) -> FeaturePoints:
        sweeping._check()
        return points

    monkeypatch.setattr(SurfaceSweep, "points", sweep)
    done = triangulate(
        *("square", FLAT, None, TriangulationOptions(splits=2), (SQUARE, FACES)),
        should_stop=lambda: len(reached) > 1, on_progress=lambda _, line: reached.append(line),
    )  # fmt: skip
    assert reached[0].startswith("face splits, round 1 of 2: splitting")
    assert [each.is_split.tolist() for each in done.trace.splits] == [[True]]
    assert done.summary.stop_reason == "stopped on request"
    assert len(done.scene.mesh.vertices) == len(done.trace.splits[0].after) > len(SQUARE)

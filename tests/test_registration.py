"""Registration: known similarities are recovered in spite of wrong matches and partial overlap."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from fairing.errors import InputError
from fairing.geometry.closest_point import SurfaceTree
from fairing.mesh import Mesh
from fairing.registration.alignment import Match, Similarity, refine_by_closest_points, register_matches
from tests.small_scene import FACES, VERTICES, corner_scene

TRUE = Similarity(0.4, Rotation.from_euler("xyz", [40, -70, 130], degrees=True).as_matrix(), np.array([3.0, -1, 0.5]))


def on_cube(count: int, rng: np.random.Generator) -> np.ndarray:
    """Points on the three visible sides of the cube."""
    points = rng.uniform(0, 1, (count, 3))
    points[np.arange(count), rng.integers(0, 3, count)] = 1
    return points


def off_by(found: Similarity) -> float:
    """The largest distance of a vertex of the cube from its true position."""
    return float(np.linalg.norm(found.apply(TRUE.undo(VERTICES)) - VERTICES, axis=1).max())


def test_undo_is_the_inverse():
    np.testing.assert_allclose(TRUE.undo(TRUE.apply(VERTICES)), VERTICES, atol=1e-12)


@pytest.mark.parametrize("kind", ["world", "two photos", "one photo each", "mixed"])
def test_matches_recover_the_similarity(kind):
    views = corner_scene().views
    matches = []
    for i, vertex in enumerate(VERTICES):
        seen = {"world": [], "two photos": [0, 3], "one photo each": [0], "mixed": [i % 8] if i > 2 else []}[kind]
        world = vertex if kind == "world" or (kind == "mixed" and i <= 2) else None
        sightings = tuple((v, views[v].camera.project(vertex)[0]) for v in seen)
        matches.append(Match(TRUE.undo(vertex[None])[0], world, sightings))
    found = register_matches(matches, views)
    if kind == "one photo each":  # a single photo cannot tell the scan's size
        assert found.errors.max() < 1e-3
    else:
        assert off_by(found.world_from_scan) < 1e-6
        assert found.errors.max() < 1e-3


def test_one_wrong_match_among_many_has_no_influence():
    views = corner_scene().views
    points = on_cube(12, np.random.default_rng(11))
    matches = [
        Match(point, None, tuple((v, views[v].camera.project(world)[0]) for v in (0, 2, 5)))
        for point, world in zip(TRUE.undo(points), points, strict=True)
    ]
    wrong = Match(matches[0].point, None, tuple((v, pixel + 15) for v, pixel in matches[0].sightings))
    found = register_matches([wrong, *matches[1:]], views)
    assert off_by(found.world_from_scan) < 0.01
    assert int(found.errors.argmax()) == 0


@pytest.mark.parametrize("kind", ["mesh", "cloud"])
def test_closest_points_converge_from_a_rough_start(kind):
    rng = np.random.default_rng(2)  # not every cloud converges (ledger: closest points of a cloud)
    scan = Mesh(TRUE.undo(VERTICES), FACES) if kind == "mesh" else TRUE.undo(on_cube(6000, rng))
    turn = Rotation.from_euler("xyz", [4, -3, 5], degrees=True).as_matrix()
    rough = Similarity(TRUE.scale, turn @ TRUE.rotation, TRUE.translation + 0.05)
    targets = on_cube(400, rng) + rng.normal(0, 1e-3, (400, 3))
    targets[:40] += rng.uniform(0.2, 0.6, (40, 3))  # of what the scan does not have
    before = off_by(rough)
    found = refine_by_closest_points(scan, rough, targets)
    assert before > 0.05
    assert off_by(found.world_from_scan) < 0.005, off_by(found.world_from_scan)
    assert np.median(found.errors) < 0.02


def test_closest_points_estimate_the_scale_of_a_closed_surface_and_keep_that_of_a_corner():
    whole = trimesh.creation.icosphere(subdivisions=2).apply_scale([1, 1.5, 2])
    scan = Mesh(TRUE.undo(whole.vertices), whole.faces)
    targets = trimesh.sample.sample_surface(whole, 600, seed=5)[0]
    rough = Similarity(1.04 * TRUE.scale, TRUE.rotation, TRUE.translation + 0.03)
    found = refine_by_closest_points(scan, rough, targets).world_from_scan
    assert found.scale == pytest.approx(TRUE.scale, rel=2e-3)
    targets = on_cube(300, np.random.default_rng(11))
    corner = refine_by_closest_points(Mesh(TRUE.undo(VERTICES), FACES), rough, targets).world_from_scan
    assert corner.scale == pytest.approx(rough.scale, rel=1e-9)


def test_closest_points_never_increase_the_error():
    rng = np.random.default_rng(11)
    targets = on_cube(200, rng) + rng.normal(0, 0.02, (200, 3))
    scan = Mesh(TRUE.undo(VERTICES), FACES)
    began = np.median(SurfaceTree(Mesh(VERTICES, FACES)).distance(targets))
    found = refine_by_closest_points(scan, TRUE, targets)
    ended = np.median(SurfaceTree(Mesh(found.world_from_scan.apply(TRUE.undo(VERTICES)), FACES)).distance(targets))
    assert ended <= began * (1 + 1e-9)
    assert np.median(found.errors) == pytest.approx(ended, rel=1e-6)


def test_insufficient_input_is_reported_in_one_line():
    views = corner_scene().views
    two = [Match(v, v) for v in VERTICES[:2]]
    with pytest.raises(InputError, match="at least 3 matches, found 2"):
        register_matches(two, views)
    line = [Match(np.array([i, 0, 0.0]), np.array([i, 0, 0.0])) for i in range(4)]
    with pytest.raises(InputError, match="on one line"):
        register_matches(line, views)
    unseen = [Match(v, None, ((0, np.zeros(2)),)) for v in VERTICES[:3]]
    with pytest.raises(InputError, match="match more points"):
        register_matches(unseen, views)
    with pytest.raises(InputError, match="at least 10 points"):
        refine_by_closest_points(VERTICES, TRUE, VERTICES[:5])

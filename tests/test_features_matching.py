"""Photo pairs, guided matching and tracks, judged by slow and obvious twins."""

import numpy as np
import pytest

from fairing.camera import Camera
from fairing.features.keypoints import Keypoints
from fairing.features.matching import Matches, match_pair
from fairing.features.options import FeatureOptions
from fairing.features.pairs import photo_pairs
from fairing.features.tracks import join_tracks
from tests.speckled_corner import camera_at

pytestmark = pytest.mark.compiled

OPTIONS = FeatureOptions()

PAIRS = {
    "sideways": (camera_at((0, 0, -6)), camera_at((1.2, 0.3, -5.8))),
    "the epipole in the photo": (camera_at((0.1, 0.2, -8)), camera_at((0.2, 0.1, -5))),
    "far apart": (camera_at((-3, 1, -5)), camera_at((3, -1, -4))),
}


def seen(camera: Camera, points: np.ndarray, descriptors: np.ndarray, rng: np.random.Generator, noise: float):
    """Keypoints at the projections of points, with noise in px, and the points they show."""
    uv, depth = camera.project(points)
    uv += rng.normal(0, noise, uv.shape)
    shown = np.flatnonzero((depth > 0) & (uv > 0).all(axis=1) & (uv < [319, 239]).all(axis=1))
    shown = shown[np.lexsort((uv[shown, 0], uv[shown, 1]))]
    n = len(shown)
    return Keypoints(uv[shown], np.ones(n), descriptors[shown], np.zeros((n, 3), np.uint8), np.ones(n)), shown


def photos(name: str, noise: float):
    rng = np.random.default_rng(3)
    points = rng.uniform(-2, 2, (700, 3))
    kinds = np.clip(np.abs(rng.normal(0, 45, (60, 128))), 0, 255)  # several points look alike
    descriptors = np.clip(kinds[rng.integers(0, 60, 700)] + rng.normal(0, 12, (700, 128)), 0, 255)
    cameras = PAIRS[name]
    changed = (np.clip(descriptors + rng.normal(0, 6, descriptors.shape), 0, 255).astype(np.uint8) for _ in cameras)
    return cameras, [seen(c, points, d, rng, noise) for c, d in zip(cameras, changed, strict=True)]


def slow_matches(a: Keypoints, b: Keypoints, camera_a: Camera, camera_b: Camera) -> set[tuple[int, int]]:
    """Every keypoint with every other; epipolar lines through projected points of the ray."""

    def line_distance(here: Camera, there: Camera, pixel: np.ndarray, others: np.ndarray) -> np.ndarray:
        ray = np.linalg.solve(here.image_from_world[:, :3], [*pixel, 1])
        P = there.image_from_world
        homogeneous = [P @ [*(here.center + t * ray), 1] for t in (0.0, 1.0)]
        line = np.cross(*homogeneous)
        return np.abs(others @ line[:2] + line[2]) / np.linalg.norm(line[:2])

    def parts(pixel_a: np.ndarray, pixel_b: np.ndarray) -> bool:
        """Whether the rays' nearest points lie behind a camera."""
        rays = [
            np.linalg.solve(c.image_from_world[:, :3], [*p, 1]) for c, p in ((camera_a, pixel_a), (camera_b, pixel_b))
        ]
        between = camera_b.center - camera_a.center
        return bool((np.linalg.lstsq(np.column_stack([rays[0], -rays[1]]), between, rcond=None)[0] <= 0).any())

    limit = OPTIONS.epipolar_distance
    d = ((a.descriptors[:, None].astype(float) - b.descriptors[None].astype(float)) ** 2).sum(axis=2)
    to_b = np.array([line_distance(camera_a, camera_b, p, b.pixels) for p in a.pixels])
    to_a = np.array([line_distance(camera_b, camera_a, p, a.pixels) for p in b.pixels]).T
    d[(to_b > limit) | (to_a > limit)] = np.inf
    for i, j in np.argwhere(np.isfinite(d)):
        if parts(a.pixels[i], b.pixels[j]):
            d[i, j] = np.inf
    found = set()
    for i in range(len(d)):
        j = int(d[i].argmin())
        if not np.isfinite(d[i, j]) or d[:, j].argmin() != i:
            continue
        rival = min(np.delete(d[i], j).min(), np.delete(d[:, j], i).min())
        if d[i, j] <= OPTIONS.ratio**2 * rival:
            found.add((i, j))
    return found


@pytest.mark.parametrize("name", PAIRS)
def test_matches_are_those_of_comparing_everything(name: str):
    (camera_a, camera_b), ((a, _), (b, _)) = photos(name, noise=0.3)
    found = {tuple(pair) for pair in match_pair(a, b, camera_a, camera_b, OPTIONS).indices.tolist()}
    expected = slow_matches(a, b, camera_a, camera_b)
    # Rays that are nearly parallel to the baseline are told apart by rounding alone; there were none.
    assert found == expected
    assert len(found) > 40


@pytest.mark.parametrize("name", PAIRS)
def test_nearly_all_matches_show_one_point(name: str):
    cameras, ((a, points_a), (b, points_b)) = photos(name, noise=0.2)
    indices = match_pair(a, b, *cameras, OPTIONS).indices
    right = points_a[indices[:, 0]] == points_b[indices[:, 1]]
    assert right.mean() > 0.95
    assert len(np.unique(indices[:, 0])) == len(np.unique(indices[:, 1])) == len(indices)


def test_exchanging_the_photos_changes_no_match():
    (camera_a, camera_b), ((a, _), (b, _)) = photos("sideways", noise=0.3)
    there = match_pair(a, b, camera_a, camera_b, OPTIONS)
    back = match_pair(b, a, camera_b, camera_a, OPTIONS)
    assert {(i, j) for i, j in there.indices.tolist()} == {(i, j) for j, i in back.indices.tolist()}


def test_photos_without_keypoints_have_no_matches():
    (camera_a, camera_b), ((a, _), _) = photos("sideways", noise=0)
    nothing = Keypoints(
        np.zeros((0, 2)), np.zeros(0), np.zeros((0, 128), np.uint8), np.zeros((0, 3), np.uint8), np.zeros(0)
    )
    assert len(match_pair(a, nothing, camera_a, camera_b, OPTIONS).indices) == 0
    assert len(match_pair(nothing, a, camera_a, camera_b, OPTIONS).indices) == 0


def test_photos_are_paired_with_the_nearest_of_a_similar_direction():
    eyes = [(6 * np.sin(t), 0.0, -6 * np.cos(t)) for t in np.radians(np.arange(0, 360, 20))]
    cameras = [camera_at(eye) for eye in eyes]
    pairs = {tuple(pair) for pair in photo_pairs(cameras, FeatureOptions(neighbors=6, axis_angle=50)).tolist()}
    steps = {min((b - a) % 18, (a - b) % 18) for a, b in pairs}
    assert steps == {1, 2}  # 60 degrees and more are too far, although six neighbours were allowed
    assert len(pairs) == 36
    assert all(a < b for a, b in pairs)


def test_photos_from_one_place_are_not_paired():
    turned = [camera_at((0, 0, -6), (x, 0, 0)) for x in (-0.5, 0, 0.5)]
    assert len(photo_pairs(turned, OPTIONS)) == 0
    assert len(photo_pairs([*turned, camera_at((1, 0, -6))], OPTIONS)) == 3


def matched(*triples: tuple[int, int, float]) -> Matches:
    return Matches(np.array([t[:2] for t in triples], int).reshape(-1, 2), np.array([t[2] for t in triples], float))


def as_sets(tracks) -> list[list[tuple[int, int]]]:
    flat = list(zip(tracks.photos.tolist(), tracks.keypoints.tolist(), strict=True))
    return [flat[a:b] for a, b in zip(tracks.offsets[:-1].tolist(), tracks.offsets[1:].tolist(), strict=True)]


def test_matches_are_joined_to_tracks():
    pairs = np.array([[0, 1], [1, 2], [0, 2]])
    matches = [matched((0, 1, 0.1), (1, 0, 0.1)), matched((1, 0, 0.1)), matched((2, 1, 0.1))]
    tracks = join_tracks([3, 2, 2], pairs, matches, 3)
    assert as_sets(tracks) == [[(0, 0), (1, 1), (2, 0)]]
    assert len(join_tracks([3, 2, 2], pairs, matches, 2)) == 3


def test_of_contradicting_matches_the_best_are_kept():
    # Keypoints 0 and 1 of photo 0 would both be joined to keypoint 0 of photo 2, one of them through photo 1.
    pairs = np.array([[0, 1], [0, 2], [1, 2]])
    matches = [matched((0, 0, 0.1)), matched((1, 0, 0.3)), matched((0, 0, 0.2))]
    assert as_sets(join_tracks([2, 1, 1], pairs, matches, 3)) == [[(0, 0), (1, 0), (2, 0)]]
    matches = [matched((0, 0, 0.3)), matched((1, 0, 0.1)), matched((0, 0, 0.2))]
    assert as_sets(join_tracks([2, 1, 1], pairs, matches, 3)) == [[(0, 1), (1, 0), (2, 0)]]


def test_no_track_has_two_keypoints_of_a_photo():
    rng = np.random.default_rng(5)
    counts = [40, 50, 45, 60, 30]
    pairs = np.array([[a, b] for a in range(5) for b in range(a + 1, 5)])
    matches = []
    for a, b in pairs:
        n = 25
        i, j = rng.permutation(counts[a])[:n], rng.permutation(counts[b])[:n]
        matches.append(Matches(np.stack([i, j], axis=1), rng.random(n)))
    tracks = join_tracks(counts, pairs, matches, 3)
    assert len(tracks) > 5
    used = set()
    for track in as_sets(tracks):
        assert len({photo for photo, _ in track}) == len(track) >= 3
        assert track == sorted(track)
        assert used.isdisjoint(track)
        used.update(track)


def test_no_matches_make_no_tracks():
    assert len(join_tracks([3, 3, 3], np.array([[0, 1], [1, 2]]), [matched(), matched()], 3)) == 0

"""Feature points from photos to covariances, judged by the exact surface of a rendered corner."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from demo_scenes import load_demo
from fairing.camera import Camera
from fairing.errors import Cancelled, InputError
from fairing.features import FeatureOptions, FeaturePoints, find_points
from fairing.geometry.closest_point import SurfaceTree
from fairing.photo import ArrayPhoto, FilePhoto, Mask
from tests.speckled_corner import HEIGHT, WIDTH, distance_to_surface, views


@pytest.fixture(scope="module")
def points() -> FeaturePoints:
    return find_points(views())


def same(one: FeaturePoints, other: FeaturePoints) -> bool:
    return all(
        np.asarray(getattr(one, name)).tobytes() == np.asarray(getattr(other, name)).tobytes()
        for name in ("positions", "covariance", "colors", "offsets", "photos", "pixels", "residual", "keypoint_sigma")
    )


def test_points_lie_on_the_surface(points: FeaturePoints):
    off = distance_to_surface(points.positions)
    assert len(points) > 250
    assert np.median(off) < 0.0025  # of the edge: 0.3 px, seen at 15 degrees to either side
    assert abs(np.median(points.positions.max(axis=1) - 1)) < 0.0005  # no bias
    assert np.mean(off < 0.01) > 0.92  # the rest: silhouettes, and chance agreements of three photos
    assert points.residual.mean() < 0.3
    assert points.n_views.min() == 3
    assert points.n_views.max() == len(views())
    for side in range(3):
        assert (points.positions.argmax(axis=1) == side).sum() > 40


def test_covariances_describe_the_distance_from_the_surface(points: FeaturePoints):
    side = points.positions.argmax(axis=1)
    each = np.arange(len(points))
    z = (points.positions[each, side] - 1) / np.sqrt(points.covariance[each, side, side])
    assert 0.6 < np.median(np.abs(z)) / 0.6745 < 1.5
    assert np.mean(np.abs(z) > 3) < 0.06
    assert (np.linalg.eigvalsh(points.covariance)[:, 0] > 0).all()


def test_observations_are_where_the_photos_show_the_point(points: FeaturePoints):
    row = np.repeat(np.arange(len(points)), points.n_views)
    for v, view in enumerate(views()):
        seen = points.photos == v
        uv, depth = view.camera.project(points.positions[row[seen]])
        assert (depth > 0).all()
        assert np.linalg.norm(uv - points.pixels[seen], axis=1).max() <= 1
        grey = view.photo.load()[..., 0].astype(float)
        u, w = np.round(points.pixels[seen]).astype(int).T
        assert np.corrcoef(grey[w, u], points.colors[row[seen], 0])[0, 1] > 0.9
    for start, end in zip(points.offsets[:-1], points.offsets[1:], strict=True):
        assert (np.diff(points.photos[start:end]) > 0).all()


def test_sparse_points_hold_the_same_observations(points: FeaturePoints):
    sparse = points.sparse_points()
    assert sparse.observations.shape == (len(points.photos), 2)
    np.testing.assert_array_equal(np.bincount(sparse.observations[:, 0]), points.n_views)
    np.testing.assert_array_equal(sparse.observations[:, 1], points.photos)
    np.testing.assert_array_equal(sparse.pixels, points.pixels)


def test_the_same_bytes_whatever_the_number_of_threads(points: FeaturePoints):
    assert same(find_points(views(), threads=1), points)
    assert same(find_points(views(), threads=5), points)


def test_the_size_and_place_of_the_world_change_nothing(points: FeaturePoints):
    place = np.eye(4)
    place[:3, :3] /= 1000
    place[:3, 3] = [-20, 5, 3]
    moved = [
        replace(view, camera=Camera(view.camera.image_from_world @ place, WIDTH, HEIGHT)) for view in views()
    ]  # fmt: skip
    found = find_points(moved)
    # A candidate on the very limit of a threshold may change sides by rounding.
    assert abs(len(found) - len(points)) <= 2
    back = found.positions / 1000 + [-20, 5, 3]
    nearest = np.linalg.norm(back[:, None] - points.positions, axis=2).min(axis=1)
    assert np.quantile(nearest, 0.98) < 1e-8


def test_masks_are_respected(tmp_path: Path):
    counts = np.full((HEIGHT, WIDTH), 255, np.uint8)
    counts[HEIGHT // 2 :] = 0
    Image.fromarray(counts).save(tmp_path / "mask.png")
    masked = [replace(view, mask=Mask(tmp_path / "mask.png")) for view in views()]
    found = find_points(masked)
    assert len(found) > 20
    assert found.pixels[:, 1].max() < HEIGHT // 2


def test_progress_counts_up_to_the_end():
    seen: list[tuple[int, int]] = []
    find_points(views(), on_progress=lambda done, count: seen.append((done, count)))
    done, counts = zip(*seen, strict=True)
    assert done[0] == 0
    assert done[-1] == counts[-1]
    assert list(done) == sorted(done)
    assert len(set(counts)) == 1


def test_a_cancellation_is_heard_within_a_second():
    class SlowPhoto(ArrayPhoto):
        def load(self) -> np.ndarray:
            time.sleep(3)
            return self.pixels

    slow = [replace(view, photo=SlowPhoto(view.photo.load())) for view in views()]
    began = time.monotonic()
    with pytest.raises(Cancelled):
        find_points(slow, threads=1, cancel_requested=lambda: time.monotonic() > began + 0.2)
    assert time.monotonic() - began < 1.2


def test_too_few_photos_give_no_points_and_the_reason():
    found = find_points(views()[:2])
    assert len(found) == 0
    assert found.reason == "expected at least 3 photos, found 2"
    assert len(found.sparse_points().positions) == 0


def test_photos_without_texture_give_no_points_and_the_reason():
    blank = ArrayPhoto(np.full((HEIGHT, WIDTH, 3), 120, np.uint8))
    found = find_points([replace(view, photo=blank) for view in views()])
    assert len(found) == 0
    assert "no texture" in found.reason


def test_photos_from_one_place_give_no_points_and_the_reason():
    found = find_points([replace(views()[0], name=f"{i}") for i in range(4)])
    assert len(found) == 0
    assert "different places" in found.reason


def test_photos_that_show_different_things_give_no_points_and_the_reason():
    rng = np.random.default_rng(0)
    noise = [rng.integers(0, 256, (HEIGHT, WIDTH, 1)).astype(np.uint8).repeat(3, axis=2) for _ in range(3)]
    found = find_points([replace(v, photo=ArrayPhoto(n)) for v, n in zip(views()[:3], noise, strict=True)])
    assert len(found) < 3  # chance
    assert len(found) > 0 or "check the cameras" in found.reason


def test_a_photo_that_cannot_be_read_is_named(tmp_path: Path):
    (tmp_path / "broken.png").write_bytes(b"no photo")
    broken = [replace(views()[0], photo=views()[0].photo), *views()[1:]]
    object.__setattr__(broken[0], "photo", FilePhoto(tmp_path / "broken.png"))
    with pytest.raises(InputError, match=r"broken\.png"):
        find_points(broken)


@pytest.mark.slow
def test_points_of_a_demo_lie_on_its_surface():
    scene = load_demo("archway")
    assert scene.truth is not None
    found = find_points(scene.views)
    off = 100 * SurfaceTree(scene.truth.surface).distance(found.positions) / scene.mesh.diagonal
    assert (off < 0.3).sum() > 12_000
    assert (off < 0.3).mean() > 0.85  # the photos show ground and background, which are no part of the truth
    assert np.median(off[off < 0.3]) < 0.015
    assert found.residual.mean() < 0.3


def test_more_options_change_the_points(points: FeaturePoints):
    assert len(find_points(views(), FeatureOptions(views=4))) < len(points)
    assert len(find_points(views(), FeatureOptions(contrast=0.05))) < len(points)

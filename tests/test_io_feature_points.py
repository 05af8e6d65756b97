"""Feature points in files: round trip, digest, damage."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from fairing.camera import Camera
from fairing.errors import InputError
from fairing.features import FeatureOptions, FeaturePoints, find_points
from fairing.io import feature_points, read_capture
from fairing.io.convert import write_capture
from fairing.io.feature_points import find_points_once, load_points, points_key, save_points
from fairing.io.point_cloud import write_point_cloud
from fairing.photo import FilePhoto, Mask
from tests.speckled_corner import HEIGHT, WIDTH, views

ARRAYS = ("positions", "covariance", "colors", "offsets", "photos", "pixels", "residual")


@pytest.fixture(scope="module")
def points() -> FeaturePoints:
    return find_points(views())


def assert_same(one: FeaturePoints, other: FeaturePoints) -> None:
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        assert getattr(one, name).dtype == getattr(other, name).dtype
    assert (one.keypoint_sigma, one.reason) == (other.keypoint_sigma, other.reason)


def test_points_are_read_as_they_were_written(points: FeaturePoints, tmp_path: Path):
    save_points(tmp_path / "points.npz", points, "digest")
    found, key = load_points(tmp_path / "points.npz")
    assert_same(found, points)
    assert key == "digest"
    assert os.listdir(tmp_path) == ["points.npz"]
    first = (tmp_path / "points.npz").read_bytes()
    save_points(tmp_path / "points.npz", points, "digest")
    assert (tmp_path / "points.npz").read_bytes() == first
    nothing = FeaturePoints.none("no texture")
    save_points(tmp_path / "points.npz", nothing, "digest")
    assert_same(load_points(tmp_path / "points.npz")[0], nothing)


def test_the_digest_changes_with_whatever_changes_the_points(tmp_path: Path):
    Image.fromarray(views()[0].photo.load()).save(tmp_path / "a.png")
    Image.fromarray(np.full((HEIGHT, WIDTH), 255, np.uint8)).save(tmp_path / "mask.png")
    options = FeatureOptions()
    base = [replace(views()[0], photo=FilePhoto(tmp_path / "a.png")), *views()[1:]]
    P = views()[1].camera.image_from_world.copy()
    P[0, 3] += 1e-9
    other = views()[1].photo.load().copy()
    other[5, 5, 1] ^= 1
    changed = [
        (base, replace(options, ratio=0.8)),
        ([base[0], replace(base[1], camera=Camera(P, WIDTH, HEIGHT)), *base[2:]], options),
        ([base[0], replace(base[1], photo=type(views()[1].photo)(other)), *base[2:]], options),  # pyright: ignore
        ([replace(base[0], mask=Mask(tmp_path / "mask.png")), *base[1:]], options),
        ([view.resized(WIDTH // 2, HEIGHT // 2) for view in base], options),
        ([base[1], base[0], *base[2:]], options),
        (base[:-1], options),
    ]
    keys = [points_key(base, options), *(points_key(*these) for these in changed)]
    stamp = (tmp_path / "a.png").stat().st_mtime_ns
    os.utime(tmp_path / "a.png", ns=(stamp, stamp + 1_000_000))
    keys.append(points_key(base, options))
    assert len(set(keys)) == len(keys)
    os.utime(tmp_path / "a.png", ns=(stamp, stamp))
    assert points_key(base, options) == keys[0]
    weighted = [replace(view, weight=0.5, name=f"other{i}") for i, view in enumerate(base)]
    assert points_key(weighted, options) == keys[0]  # neither changes the points


def test_points_are_found_once(points: FeaturePoints, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "points.npz"
    assert_same(find_points_once(views(), path), points)

    def never(*_: object) -> FeaturePoints:
        raise AssertionError("found again")

    monkeypatch.setattr(feature_points, "find_points", never)
    assert_same(find_points_once(views(), path), points)
    with pytest.raises(AssertionError, match="found again"):
        find_points_once(views(), path, FeatureOptions(ratio=0.8))


def test_a_damaged_file_is_replaced(points: FeaturePoints, tmp_path: Path):
    path = tmp_path / "points.npz"
    find_points_once(views(), path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="cannot be read"):
        load_points(path)
    assert_same(find_points_once(views(), path), points)
    assert path.read_bytes() == whole


def test_contents_that_contradict_each_other_are_refused(points: FeaturePoints, tmp_path: Path):
    for broken in (
        replace(points, photos=points.photos[:-1]),
        replace(points, covariance=points.covariance[:, 0]),
        replace(points, offsets=points.offsets[::-1]),
        replace(points, residual=points.residual.astype(int)),
    ):
        save_points(tmp_path / "points.npz", broken, "")
        with pytest.raises(InputError, match=r"points\.npz"):
            load_points(tmp_path / "points.npz")
    with pytest.raises(InputError, match="no such file"):
        load_points(tmp_path / "none.npz")
    with pytest.raises(InputError, match="create the folder"):
        save_points(tmp_path / "none" / "points.npz", points, "")


def test_other_programs_read_the_points(points: FeaturePoints, tmp_path: Path):
    write_point_cloud(tmp_path / "points.ply", points)
    cloud = trimesh.load(tmp_path / "points.ply")
    assert isinstance(cloud, trimesh.PointCloud)
    np.testing.assert_array_equal(cloud.vertices, points.positions)
    np.testing.assert_array_equal(cloud.colors[:, :3], points.colors)


def test_a_colmap_model_keeps_points_and_tracks(points: FeaturePoints, tmp_path: Path):
    write_capture(tmp_path, "colmap", views(), points.sparse_points())
    sparse = read_capture(tmp_path).sparse_points
    assert sparse is not None
    np.testing.assert_array_equal(sparse.positions, points.positions)
    np.testing.assert_array_equal(np.bincount(sparse.observations[:, 0]), points.n_views)
    order = np.lexsort((sparse.observations[:, 1], sparse.observations[:, 0]))
    np.testing.assert_allclose(sparse.pixels[order], points.pixels, rtol=0, atol=1e-9)

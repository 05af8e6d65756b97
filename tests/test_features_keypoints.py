"""Keypoints: exact places, masks, reduced photos."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fairing.camera import Camera
from fairing.features.keypoints import DESCRIPTOR_LENGTH, Keypoints, detect_keypoints
from fairing.features.options import FeatureOptions
from fairing.photo import ArrayPhoto, Mask
from fairing.scene import View
from tests import speckled_corner

WIDTH, HEIGHT = 320, 240


def view_of(grey: np.ndarray, mask: Mask | None = None) -> View:
    height, width = grey.shape
    camera = Camera(np.array([[300, 0, 150, 0], [0, 300, 120, 0], [0, 0, 1.0, 4]]), width, height)
    pixels = np.repeat(np.clip(np.round(grey), 0, 255).astype(np.uint8)[..., None], 3, axis=2)
    return View("blobs", camera, ArrayPhoto(pixels), mask)


def blobs(sigma: float, spacing: float = 32) -> tuple[np.ndarray, np.ndarray]:
    """Grey levels with bright Gaussian blobs at known places (n, 2) between the pixels."""
    rng = np.random.default_rng(1)
    x, y = np.meshgrid(np.arange(spacing, WIDTH - spacing, spacing), np.arange(spacing, HEIGHT - spacing, spacing))
    places = np.column_stack([x.ravel(), y.ravel()]) + rng.uniform(-0.5, 0.5, (x.size, 2))
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    grey = np.full((HEIGHT, WIDTH), 60.0)
    for u, v in places:
        grey += 120 * np.exp(-((columns - u) ** 2 + (rows - v) ** 2) / (2 * sigma**2))
    return grey, places


def errors(found: Keypoints, places: np.ndarray) -> np.ndarray:
    """(k, 2) px: of the keypoints within a pixel of a blob."""
    off = found.pixels[:, None] - places
    nearest = np.abs(off).max(axis=2).argmin(axis=1)
    off = off[np.arange(len(off)), nearest]
    return off[np.abs(off).max(axis=1) < 1]


@pytest.mark.parametrize("sigma", [1.2, 2.0, 3.5])
def test_keypoints_lie_on_the_centres_of_blobs(sigma: float):
    grey, places = blobs(sigma)
    off = errors(detect_keypoints(view_of(grey), FeatureOptions()), places)
    assert len(off) >= len(places)
    assert np.abs(off.mean(axis=0)).max() < 0.005  # OpenCV's default: 0.25
    assert np.sqrt((off**2).mean()) < 0.02


def test_keypoints_of_a_reduced_photo_lie_at_the_places_of_the_full_one():
    grey, places = blobs(3.5)
    options = FeatureOptions(max_megapixels=WIDTH * HEIGHT / 1e6 / 2)
    found = detect_keypoints(view_of(grey), options)
    off = errors(found, places)
    assert len(off) >= len(places)
    assert np.abs(off.mean(axis=0)).max() < 0.02
    near = np.abs(found.pixels[:, None] - places).max(axis=2).min(axis=1) < 1
    full = detect_keypoints(view_of(grey), FeatureOptions())
    near_full = np.abs(full.pixels[:, None] - places).max(axis=2).min(axis=1) < 1
    assert np.median(found.scale[near]) == pytest.approx(np.median(full.scale[near_full]), rel=0.1)


def test_no_keypoint_lies_on_or_near_what_a_mask_excludes(tmp_path: Path):
    grey, _ = blobs(2.0)
    counts = np.full((HEIGHT, WIDTH), 255, np.uint8)
    counts[:, : WIDTH // 2] = 0
    Image.fromarray(counts).save(tmp_path / "mask.png")
    free = detect_keypoints(view_of(grey), FeatureOptions())
    found = detect_keypoints(view_of(grey, Mask(tmp_path / "mask.png")), FeatureOptions())
    clear = free.pixels[:, 0] - 2 * free.scale > WIDTH // 2
    assert 0 < clear.sum() < len(free)
    assert (found.pixels[:, 0] - 2 * found.scale > WIDTH // 2 - 1.5).all()
    assert {tuple(p) for p in free.pixels[clear]} <= {tuple(p) for p in found.pixels}
    Image.fromarray(np.zeros_like(counts)).save(tmp_path / "nothing.png")
    assert len(detect_keypoints(view_of(grey, Mask(tmp_path / "nothing.png")), FeatureOptions())) == 0
    Image.fromarray(np.full_like(counts, 255)).save(tmp_path / "all.png")
    same = detect_keypoints(view_of(grey, Mask(tmp_path / "all.png")), FeatureOptions())
    np.testing.assert_array_equal(same.pixels, free.pixels)


def test_a_photo_without_texture_has_no_keypoints():
    found = detect_keypoints(view_of(np.full((HEIGHT, WIDTH), 128.0)), FeatureOptions())
    assert len(found) == 0
    assert found.descriptors.shape == (0, 128)


def test_descriptors_are_roots_of_shares_of_the_sum():
    found = detect_keypoints(speckled_corner.views()[0], FeatureOptions())
    assert len(found) > 300
    length = np.linalg.norm(found.descriptors.astype(float), axis=1)
    assert np.abs(length / DESCRIPTOR_LENGTH - 1).max() < 0.02
    rows = found.pixels[:, 1]
    assert (np.diff(rows) >= 0).all()


def test_the_strongest_keypoints_are_the_same_with_all_descriptors_and_without(tmp_path: Path):
    grey, _ = blobs(2.0)
    grey = grey + np.random.default_rng(2).normal(0, 12, grey.shape)
    Image.fromarray(np.full(grey.shape, 255, np.uint8)).save(tmp_path / "all.png")
    everywhere, excluding_none = view_of(grey), view_of(grey, Mask(tmp_path / "all.png"))
    every = detect_keypoints(everywhere, FeatureOptions())
    strongest = detect_keypoints(everywhere, FeatureOptions(), 40)
    assert 40 <= len(strongest) < 60 < len(every)
    assert strongest.contrast.min() == np.sort(every.contrast)[-40]
    for other in (every.strongest(40), detect_keypoints(excluding_none, FeatureOptions(), 40)):
        for values, others in zip(vars(strongest).values(), vars(other).values(), strict=True):
            np.testing.assert_array_equal(values, others)
    assert every.strongest(len(every)) is every

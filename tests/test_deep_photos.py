"""Photos of 16 bits in the engine: used at full depth, in grey and in colour, and kept by conversions."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from fairing.cells.scale_space import LUMA, ScaleSpace
from fairing.io import prepare_output_folder
from fairing.io.convert import write_capture
from fairing.lens import Lens
from fairing.photo import FilePhoto, ResizedPhoto
from fairing.run.session import Session
from fairing.scene import Scene, View
from tests.small_scene import HEIGHT, WIDTH, corner_scene, small_options


def with_files(scene: Scene, folder: Path, factor: int, dtype: type) -> Scene:
    """The scene with its photos, times a factor, in PNG files."""
    views = []
    for view in scene.views:
        path = folder / f"{view.name}-{np.dtype(dtype).itemsize}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), (view.photo.load().astype(dtype) * dtype(factor))[..., ::-1])
        views.append(replace(view, photo=FilePhoto(path)))
    return replace(scene, views=tuple(views))


def planes_of(scene: Scene, color: bool) -> np.ndarray:
    """(channels, h, w) float: planes of the first photo as the engine uses them, grey levels."""
    found = []
    photos = ScaleSpace(scene, color)
    with ThreadPoolExecutor(1) as pool:
        photos.for_each([0], lambda view, photo: found.append(photo * photos.grey_levels), pool)
    return found[0]


@pytest.mark.parametrize("color", [False, True])
def test_the_engine_uses_all_16_bits(tmp_path: Path, color: bool):
    scene = corner_scene()
    samples = np.random.default_rng(1).integers(0, 65536, (HEIGHT, WIDTH, 3), dtype=np.uint16)
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), samples[..., ::-1])
    deep = replace(scene, views=(replace(scene.views[0], photo=FilePhoto(path)), *scene.views[1:]))
    levels = samples / 257
    exact = levels.transpose(2, 0, 1) if color else (levels @ LUMA)[None]
    # float32 of numbers up to 255; one step of 16 bits is 4e-3.
    np.testing.assert_allclose(planes_of(deep, color), exact, atol=1e-4)


@pytest.mark.parametrize("color", [False, True])
def test_photos_of_16_bits_that_hold_8_give_the_same_mesh(tmp_path: Path, color: bool):
    ends = []
    for factor, dtype in ((1, np.uint8), (257, np.uint16)):
        session = Session(with_files(corner_scene(), tmp_path, factor, dtype), small_options(cells={"color": color}))
        session.run()
        ends.append(session.vertices)
    # The luma of 8 bits is rounded to eighths of a grey level, of 16 bits it is not.
    np.testing.assert_allclose(ends[1], ends[0], rtol=0, atol=1e-6 if color else 2e-3)


def test_conversion_keeps_16_bits_of_undistorted_and_reduced_photos(tmp_path: Path):
    samples = cv2.GaussianBlur(
        np.random.default_rng(1).integers(0, 65536, (HEIGHT, WIDTH, 3), dtype=np.uint16), (0, 0), 2
    )
    cv2.imwrite(str(tmp_path / "a.png"), samples[..., ::-1])
    camera = corner_scene().views[0].camera
    lens = Lens(camera.K, np.array([-0.1, 0.02]), WIDTH, HEIGHT)
    bent = FilePhoto(tmp_path / "a.png", lens)
    half = ResizedPhoto(FilePhoto(tmp_path / "a.png"), (WIDTH // 2, HEIGHT // 2))
    views = [View("bent", camera, bent), View("half", camera.resized(WIDTH // 2, HEIGHT // 2), half)]
    prepare_output_folder(tmp_path / "out")
    write_capture(tmp_path / "out", "scene.json", views)
    for view in views:
        written = cv2.imread(str(tmp_path / "out" / "images" / f"{view.name}.png"), cv2.IMREAD_UNCHANGED)
        assert written is not None
        assert written.dtype == np.uint16
        np.testing.assert_array_equal(written[..., ::-1], view.photo.full_depth())
        np.testing.assert_array_equal(
            FilePhoto(tmp_path / "out" / "images" / f"{view.name}.png").load(), view.photo.load()
        )

"""Photos stored turned, with an orientation tag: all eight, against Pillow, and what decides where both ways fit."""

import io
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageOps, TiffImagePlugin

from fairing.errors import InputError
from fairing.io import read_capture
from fairing.io.capture import Capture
from fairing.io.convert import write_capture
from fairing.photo import FilePhoto
from fairing.util.orientation import INVERSE, TAG, turned, turned_size
from tests.foreign_formats import ForeignCapture, write_scene
from tests.synthetic_capture import HEIGHT, WIDTH

CAPTURE = ForeignCapture(n_points=60)
SIDE = 72


def picture(capture: ForeignCapture, i: int, width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
    """A photo in which every pixel has the brightness of the nearest point."""
    brightness = np.random.default_rng(99).integers(0, 256, len(capture.points), dtype=np.uint8)
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    distances = np.linalg.norm(np.stack([columns, rows], axis=-1)[:, :, None] - capture.pixels[i], axis=-1)
    return np.repeat(brightness[distances.argmin(axis=-1)][..., None], 3, axis=-1)


def save(path: Path, pixels: np.ndarray, orientation: int) -> None:
    exif = Image.Exif()
    exif[TAG] = orientation
    Image.fromarray(pixels).save(path, exif=exif)


def write(
    folder: Path,
    orientation: int | list[int],
    is_turned: bool = True,
    writer: str = "COLMAP",
    suffix: str = ".png",
    square: bool = False,
) -> list[np.ndarray]:
    """A capture whose files have the tag: calibrated on the upright picture, or `is_turned` = False on the stored one."""
    capture = ForeignCapture(names=tuple(f"{name}{suffix}" for name in "abcd"), n_points=60)
    width = SIDE if square else WIDTH
    if square:
        capture.center = ((SIDE - 1) / 2, (SIDE - 1) / 2)
        capture.__post_init__()
    write_scene(capture, folder, writer)
    if square:
        file = folder / "sparse" / "cameras.txt"
        file.write_text(file.read_text().replace(f" {WIDTH} {HEIGHT} ", f" {SIDE} {SIDE} "))
    meant = []
    for i, name in enumerate(capture.names):
        tag = orientation if isinstance(orientation, int) else orientation[i]
        meant.append(picture(capture, i, width))
        save(folder / "images" / name, turned(meant[i], INVERSE[tag]) if is_turned else meant[i], tag)
    return meant


def drop_points(folder: Path) -> None:
    file = folder / "sparse" / "images.txt"
    lines = file.read_text().splitlines()
    file.write_text("\n".join(line if k % 2 or line.startswith("#") else "" for k, line in enumerate(lines)) + "\n")
    (folder / "sparse" / "points3D.txt").write_text("# none\n")


def assert_shows(capture: Capture, meant: list[np.ndarray]) -> None:
    for view, pixels in zip(capture.views, meant, strict=True):
        np.testing.assert_array_equal(view.photo.load(), pixels)
        assert view.photo.size == (view.camera.width, view.camera.height)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_every_orientation_turns_as_pillow_does(orientation: int):
    pixels = np.random.default_rng(0).integers(0, 256, (3, 5, 3), dtype=np.uint8)
    image = Image.fromarray(pixels)
    image.getexif()[TAG] = orientation
    upright = np.asarray(ImageOps.exif_transpose(image))
    np.testing.assert_array_equal(turned(pixels, orientation), upright)
    assert turned_size((5, 3), orientation) == upright.shape[1::-1]
    np.testing.assert_array_equal(turned(upright, INVERSE[orientation]), pixels)


@pytest.mark.parametrize("writer", ["COLMAP", "nerfstudio", "OpenMVG", "Meshroom", "Strecha"])
@pytest.mark.parametrize("orientation", [5, 6, 7, 8])
def test_a_photo_that_fits_only_upright_is_turned(tmp_path: Path, orientation: int, writer: str):
    meant = write(tmp_path / "scene", orientation, writer=writer)
    capture = read_capture(tmp_path / "scene")
    assert_shows(capture, meant)
    assert "photos turned upright by their orientation tag: 4 (a.png, b.png, c.png, d.png)" in capture.warnings
    for i, view in enumerate(capture.views):
        np.testing.assert_allclose(view.camera.image_from_world, CAPTURE.matrix(i), rtol=0, atol=1e-9)


@pytest.mark.parametrize("orientation", [5, 6, 7, 8])
def test_a_photo_that_fits_only_as_stored_is_not_turned(tmp_path: Path, orientation: int):
    meant = write(tmp_path / "scene", orientation, is_turned=False)
    drop_points(tmp_path / "scene")
    capture = read_capture(tmp_path / "scene")
    assert_shows(capture, meant)
    assert not any("turned" in warning for warning in capture.warnings)


@pytest.mark.parametrize("is_turned", [True, False])
@pytest.mark.parametrize("orientation", [2, 3, 4])
def test_points_decide_where_a_photo_fits_both_ways(tmp_path: Path, orientation: int, is_turned: bool):
    meant = write(tmp_path / "scene", orientation, is_turned)
    assert_shows(read_capture(tmp_path / "scene"), meant)


@pytest.mark.parametrize("is_turned", [True, False])
@pytest.mark.parametrize("orientation", [3, 5, 6, 7, 8])
def test_points_decide_for_square_photos(tmp_path: Path, orientation: int, is_turned: bool):
    meant = write(tmp_path / "scene", orientation, is_turned, square=True)
    assert_shows(read_capture(tmp_path / "scene"), meant)


@pytest.mark.parametrize("is_turned", [True, False])
def test_photos_whose_size_leaves_no_choice_decide_for_the_others(tmp_path: Path, is_turned: bool):
    meant = write(tmp_path / "scene", [6, 3, 1, 3], is_turned)
    drop_points(tmp_path / "scene")
    assert_shows(read_capture(tmp_path / "scene"), meant)


@pytest.mark.parametrize(("orientation", "square"), [(3, False), (6, True)])
def test_without_points_one_line_asks(tmp_path: Path, orientation: int, square: bool):
    write(tmp_path / "scene", orientation, square=square)
    drop_points(tmp_path / "scene")
    with pytest.raises(
        InputError, match=rf"photo a\.png: .*tag {orientation}, and it fits .*mogrify.*exiftool"
    ) as error:
        read_capture(tmp_path / "scene")
    assert "\n" not in str(error.value)


def test_points_decide_for_formats_that_state_no_sizes(tmp_path: Path):
    meant = write(tmp_path / "stored", 6, is_turned=False, writer="Bundler")
    assert_shows(read_capture(tmp_path / "stored"), meant)
    write(tmp_path / "upright", 6, writer="Bundler")
    with pytest.raises(InputError, match=r"photo a\.png: its file has the orientation tag 6"):
        read_capture(tmp_path / "upright")


@pytest.mark.parametrize("suffix", [".tif", ".webp", ".jpg"])
@pytest.mark.parametrize("is_turned", [True, False])
@pytest.mark.parametrize("orientation", [3, 6, 8])
def test_other_files_are_turned_too(tmp_path: Path, suffix: str, is_turned: bool, orientation: int):
    """Newer versions of Pillow turn TIFF files themselves. Lossy files are compared by their mean error, grey levels."""
    meant = write(tmp_path / "scene", orientation, is_turned, suffix=suffix)
    for view, pixels in zip(read_capture(tmp_path / "scene").views, meant, strict=True):
        error = np.abs(view.photo.load().astype(float) - pixels).mean()
        assert error < (1e-9 if suffix == ".tif" else 20)  # another orientation differs by 40 and more


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_a_damaged_tag_is_no_tag(tmp_path: Path, suffix: str):
    meant = write(tmp_path / "scene", 1, suffix=suffix)
    for name, tag in ((f"a{suffix}", 77), (f"b{suffix}", 0)):
        save(tmp_path / "scene" / "images" / name, meant["abcd".index(name[0])], tag)
    assert_shows(read_capture(tmp_path / "scene"), meant)


def test_turned_photos_are_converted_upright(tmp_path: Path):
    meant = write(tmp_path / "scene", 6, suffix=".jpg")
    (tmp_path / "out").mkdir()
    capture = read_capture(tmp_path / "scene")
    write_capture(tmp_path / "out", "colmap", capture.views, capture.sparse_points)
    for name, view in zip("abcd", capture.views, strict=True):
        with Image.open(tmp_path / "out" / "images" / f"{name}.png") as image:
            np.testing.assert_array_equal(np.asarray(image), view.photo.load())
            assert image.size == meant[0].shape[1::-1]


def tiff(pixels: np.ndarray, orientation: int) -> bytes:
    """An uncompressed TIFF, whose tag Pillow and OpenCV obey when they decode it. Pillow writes no colour of 16 bits."""
    info = TiffImagePlugin.ImageFileDirectory_v2()
    info[TAG] = orientation
    buffer = io.BytesIO()
    if pixels.ndim == 2 or pixels.dtype == np.uint8:
        Image.fromarray(pixels).save(buffer, format="TIFF", tiffinfo=info)
        return buffer.getvalue()
    height, width = pixels.shape[:2]
    data = pixels.astype("<u2").tobytes()
    entries = [(256, 3, [width]), (257, 3, [height]), (258, 3, [16] * 3), (259, 3, [1]), (262, 3, [2]),
               (273, 4, [8]), (TAG, 3, [orientation]), (277, 3, [3]), (278, 4, [height]), (279, 4, [len(data)])]  # fmt: skip
    extra = 8 + len(data) + 2 + 12 * len(entries) + 4
    directory = struct.pack("<H", len(entries))
    for tag, kind, values in entries:
        packed = struct.pack(f"<{len(values)}{'H' if kind == 3 else 'I'}", *values)
        field = packed.ljust(4, b"\0") if len(packed) <= 4 else struct.pack("<I", extra)
        directory += struct.pack("<HHI", tag, kind, len(values)) + field
    return b"II*\0" + struct.pack("<I", 8 + len(data)) + data + directory + b"\0" * 4 + struct.pack("<3H", 16, 16, 16)


@pytest.mark.parametrize("kind", ["colour", "grey", "colour of 16 bits", "grey of 16 bits"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_tiff_files_are_decoded_upright_and_can_be_turned_back(tmp_path: Path, orientation: int, kind: str):
    shape = (6, 9) if "grey" in kind else (6, 9, 3)
    high, dtype = (1 << 16, np.uint16) if "16" in kind else (1 << 8, np.uint8)
    stored = np.random.default_rng(5).integers(0, high, shape).astype(dtype)
    (tmp_path / "a.tif").write_bytes(tiff(stored, orientation))
    upright = turned(stored, orientation)
    photo = FilePhoto(tmp_path / "a.tif")
    assert photo.size == upright.shape[1::-1]
    np.testing.assert_array_equal(photo.full_depth()[..., 0], upright if upright.ndim == 2 else upright[..., 0])
    back = replace(photo, orientation=photo.other_orientation)
    assert back.size == (9, 6)
    np.testing.assert_array_equal(back.full_depth()[..., 0], stored if stored.ndim == 2 else stored[..., 0])


# ---------------------------------------------------------------------- masks


def mask_of(height: int, width: int) -> np.ndarray:
    """(height, width) uint8 without any symmetry."""
    drawn = np.full((height, width), 255, dtype=np.uint8)
    drawn[: height // 3, : width // 2] = 0
    drawn[-2:, 1] = 0
    return drawn


def masks(capture: Capture) -> list[np.ndarray]:
    found = []
    for view in capture.views:
        assert view.mask is not None
        assert view.mask.size == view.photo.size
        found.append(view.mask.load())
    return found


@pytest.mark.parametrize("made_of", ["upright", "stored"])
@pytest.mark.parametrize("is_turned", [True, False])
@pytest.mark.parametrize("orientation", [5, 6, 7, 8])
def test_masks_fit_their_photos_by_their_size(tmp_path: Path, orientation: int, is_turned: bool, made_of: str):
    """Masks of the stored pixels and of the upright picture, of cameras that were calibrated on either."""
    meant = write(tmp_path / "scene", orientation, is_turned)
    if not is_turned:
        drop_points(tmp_path / "scene")
    drawn = mask_of(*meant[0].shape[:2])
    as_made = drawn
    if is_turned and made_of == "stored":
        as_made = turned(drawn, INVERSE[orientation])
    if not is_turned and made_of == "upright":
        as_made = turned(drawn, orientation)
    (tmp_path / "scene" / "masks").mkdir()
    for name in "abcd":
        Image.fromarray(as_made).save(tmp_path / "scene" / "masks" / f"{name}.png")
    for found in masks(read_capture(tmp_path / "scene")):
        np.testing.assert_array_equal(found, drawn > 0)


@pytest.mark.parametrize("has_tag", [True, False])
def test_masks_that_fit_both_ways_turn_by_their_own_tag_else_are_noted(tmp_path: Path, has_tag: bool):
    meant = write(tmp_path / "scene", 3)
    drawn = mask_of(*meant[0].shape[:2])
    (tmp_path / "scene" / "masks").mkdir()
    for name in "abcd":
        save(tmp_path / "scene" / "masks" / f"{name}.png", turned(drawn, 3) if has_tag else drawn, 3 if has_tag else 1)
    capture = read_capture(tmp_path / "scene")
    for found in masks(capture):
        np.testing.assert_array_equal(found, drawn > 0)
    noted = "masks of turned photos, taken as made of the upright picture: 4 (a.png, b.png, c.png, d.png)"
    assert (noted in capture.warnings) == (not has_tag)


@pytest.mark.parametrize("with_mask", [True, False])
@pytest.mark.parametrize("orientation", [3, 6])
def test_transparent_pixels_turn_with_their_photo(tmp_path: Path, orientation: int, with_mask: bool):
    meant = write(tmp_path / "scene", orientation)
    opaque = mask_of(*meant[0].shape[:2])
    for i, name in enumerate("abcd"):
        with_alpha = np.dstack([meant[i], opaque])
        save(tmp_path / "scene" / "images" / f"{name}.png", turned(with_alpha, INVERSE[orientation]), orientation)
    expected = opaque > 0
    if with_mask:
        drawn = np.full_like(opaque, 255)
        drawn[:, -5:] = 0
        expected = expected & (drawn > 0)
        (tmp_path / "scene" / "masks").mkdir()
        for name in "abcd":
            Image.fromarray(drawn).save(tmp_path / "scene" / "masks" / f"{name}.png")
    for found in masks(read_capture(tmp_path / "scene")):
        np.testing.assert_array_equal(found, expected)


def test_turned_photos_keep_16_bits(tmp_path: Path):
    pixels = np.random.default_rng(1).integers(0, 1 << 16, (4, 7)).astype(np.uint16)
    Image.fromarray(pixels).save(tmp_path / "a.png")
    photo = FilePhoto(tmp_path / "a.png", orientation=6)
    assert photo.full_depth().dtype == np.uint16
    np.testing.assert_array_equal(photo.full_depth()[..., 0], turned(pixels, 6))

"""Image files: which are read, to which samples, and what is said of the others."""

import io
import subprocess
import sys
import warnings
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from fairing.errors import InputError
from fairing.image_file import FORMATS, PHOTO_SUFFIXES, decode_image, read_header
from fairing.io import read_capture, read_mesh
from fairing.io.scan_file import read_scan
from fairing.io.textured_mesh import write_textured
from fairing.mesh import Mesh
from fairing.photo import FilePhoto, Mask, ResizedPhoto, grey_levels
from fairing.texture import TexturedModel
from tests.image_files import png, tiff
from tests.small_scene import write_corner

RNG = np.random.default_rng(5)
DEEP = RNG.integers(0, 65536, (6, 8, 4), dtype=np.uint16)
RGB16, GREY16, ALPHA16 = DEEP[..., :3], DEEP[..., 0], DEEP[..., 3]
RGB8 = (RGB16 >> 8).astype(np.uint8)
GREY8 = RGB8[..., 0]


def written(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def encoded(image: Image.Image, format: str, **options: object) -> bytes:
    file = io.BytesIO()
    image.save(file, format, **options)
    return file.getvalue()


def ppm16(samples: np.ndarray, largest: int = 65535) -> bytes:
    kind = 6 if samples.ndim == 3 else 5
    return b"P%d\n# a comment\n8 6 %d\n" % (kind, largest) + samples.astype(">u2").tobytes()


def test_every_suffix_belongs_to_a_format_that_is_enabled():
    Image.init()
    assert {Image.EXTENSION[suffix] for suffix in PHOTO_SUFFIXES} == set(FORMATS)


# 16 bits


def test_colour_of_16_bits_is_read_at_full_depth(tmp_path):
    contents = {
        "a.png": png(RGB16, 2),
        "b.tif": tiff((RGB16, {})),
        "c.tif": tiff((RGB16, {}), big_endian=True),
        "d.tif": cv2.imencode(".tif", RGB16[..., ::-1])[1].tobytes(),  # LZW with a predictor
        "e.ppm": ppm16(RGB16),
        "f.png": png(DEEP, 6),
        "g.tif": tiff((DEEP, {338: 2})),
    }
    for name, content in contents.items():
        photo = FilePhoto(written(tmp_path, name, content))
        np.testing.assert_array_equal(photo.full_depth(), RGB16, err_msg=name)
        # Nearest grey level of 65535 / 255 = 257 units.
        np.testing.assert_array_equal(photo.load(), np.round(RGB16 / 257).astype(np.uint8), err_msg=name)


def test_grey_of_16_bits_is_read_at_full_depth(tmp_path):
    contents = {
        "a.png": png(GREY16, 0),
        "b.tif": tiff((GREY16, {})),
        "c.tif": tiff((GREY16, {}), big_endian=True),
        "d.pgm": ppm16(GREY16),
        "e.tif": tiff((65535 - GREY16, {262: 0})),  # white is zero
        "f.png": png(np.dstack([GREY16, ALPHA16]), 4),
    }
    for name, content in contents.items():
        photo = FilePhoto(written(tmp_path, name, content))
        np.testing.assert_array_equal(photo.full_depth(), GREY16[..., None].repeat(3, axis=2), err_msg=name)


def test_samples_of_10_bits_fill_the_range(tmp_path):
    samples = RGB16 >> 6
    expected = np.round(samples / 1023 * 65535)
    np.testing.assert_array_equal(decode_image(written(tmp_path, "a.ppm", ppm16(samples, 1023))).pixels, expected)
    grey = decode_image(written(tmp_path, "b.pgm", ppm16(samples[..., 0], 1023))).pixels
    np.testing.assert_allclose(grey, expected[..., 0], atol=1)  # Pillow's rounding


def test_grey_levels_are_those_of_8_bits_with_fractions(tmp_path):
    photo = FilePhoto(written(tmp_path, "a.png", png(RGB16, 2)))
    levels = grey_levels(photo.full_depth())
    assert levels.dtype == np.float32
    np.testing.assert_allclose(levels, RGB16 / 257, rtol=3e-7)  # two roundings of float32
    eight = FilePhoto(written(tmp_path, "b.png", png(RGB8, 2)))
    assert grey_levels(eight.full_depth()) is eight.full_depth()


def test_reduced_photos_keep_16_bits(tmp_path):
    photo = ResizedPhoto(FilePhoto(written(tmp_path, "a.png", png(RGB16, 2))), (4, 3))
    means = RGB16.reshape(3, 2, 4, 2, 3).mean(axis=(1, 3))
    assert np.abs(photo.full_depth() - means).max() <= 0.5
    assert photo.load().dtype == np.uint8


REFUSED_16 = {
    "separate planes": (tiff((RGB16, {284: 2})), "separate planes"),
    "premultiplied alpha": (tiff((DEEP, {338: 1})), "premultiplied alpha"),
    "CMYK": (tiff((DEEP, {262: 5})), "colours other than RGB"),
    "colour of floats": (tiff((RGB16.astype(np.float32), {339: (3, 3, 3)})), "float samples is not read"),
    "signed": (tiff((GREY16, {339: 2})), "16 signed bits"),
    "32 bits": (tiff((GREY16.astype(np.uint32), {})), "32 unsigned bits"),
    "float": (tiff((GREY16.astype(np.float32), {339: 3})), "float samples is not read; convert it to a PNG of 16 bits"),
    "text": (b"P3 1 1 65535 1 2 3", "as text"),
}


@pytest.mark.parametrize("case", REFUSED_16)
def test_deep_samples_that_are_not_read_are_named(tmp_path, case):
    content, reason = REFUSED_16[case]
    with pytest.raises(InputError, match=rf"photo .*a\.(tif|ppm).*{reason}"):
        FilePhoto(written(tmp_path, "a.ppm" if content[:1] == b"P" else "a.tif", content)).full_depth()


# 8 bits


def test_colour_of_8_bits_is_exact(tmp_path):
    palette = Image.fromarray(RGB8).quantize(48, dither=Image.Dither.NONE)
    contents = {
        "a.png": png(RGB8, 2),
        "b.png": png(np.dstack([RGB8, GREY8]), 6),
        "c.png": encoded(palette, "PNG"),
        "d.tif": tiff((RGB8, {})),
        "e.tif": tiff((RGB8, {}), big_endian=True),
        "f.tif": tiff((RGB8, {284: 2})),
        "g.bmp": encoded(Image.fromarray(RGB8), "BMP"),
        "h.ppm": encoded(Image.fromarray(RGB8), "PPM"),
        "i.webp": encoded(Image.fromarray(RGB8), "WEBP", lossless=True),
        "j.tif": encoded(Image.fromarray(RGB8), "TIFF", compression="tiff_lzw"),
    }
    assert len(np.unique(RGB8.reshape(-1, 3), axis=0)) == 48, "the palette holds all colours"
    for name, content in contents.items():
        np.testing.assert_array_equal(FilePhoto(written(tmp_path, name, content)).load(), RGB8, err_msg=name)


def test_grey_of_8_bits_and_1_bit_is_exact(tmp_path):
    black_and_white = Image.fromarray(GREY8 > 127)
    contents = {
        "a.png": (png(GREY8, 0), GREY8),
        "b.png": (png(np.dstack([GREY8, GREY8]), 4), GREY8),
        "c.tif": (tiff((255 - GREY8, {262: 0})), GREY8),
        "d.pgm": (encoded(Image.fromarray(GREY8), "PPM"), GREY8),
        "e.png": (encoded(black_and_white, "PNG"), 255 * (GREY8 > 127)),
        "f.tif": (encoded(black_and_white, "TIFF", compression="group4"), 255 * (GREY8 > 127)),
    }
    for name, (content, grey) in contents.items():
        photo = FilePhoto(written(tmp_path, name, content)).load()
        np.testing.assert_array_equal(photo, grey[..., None].repeat(3, axis=2), err_msg=name)


def smooth_picture() -> np.ndarray:
    x, y = np.meshgrid(np.linspace(0, 1, 64), np.linspace(0, 1, 48))
    return np.round(255 * np.stack([x, y, 1 - x], axis=2)).astype(np.uint8)


def test_progressive_and_cmyk_jpeg_show_the_picture(tmp_path):
    picture = Image.fromarray(smooth_picture())
    contents = {
        "a.jpg": encoded(picture, "JPEG", quality=95, progressive=True),
        "b.jpg": encoded(picture.convert("CMYK"), "JPEG", quality=95),
        "c.jpg": encoded(picture.convert("L"), "JPEG", quality=95),
    }
    for name, content in contents.items():
        path = written(tmp_path, name, content)
        other = cv2.imread(str(path), cv2.IMREAD_COLOR)
        assert other is not None
        off = np.abs(FilePhoto(path).load().astype(int) - other[..., ::-1])
        # Two decoders differ by the rounding of their inverse transforms and, of CMYK, of a product of two channels.
        assert off.max() <= 3, f"{name}: {off.max()} grey levels"


# Not read


@pytest.mark.parametrize(
    ("name", "head", "line"),
    [
        (
            "a.heic",
            b"\0\0\0\x18ftypheic",
            r"HEIC is not read; install pillow-heif .*, or convert it to JPEG or PNG, e\.g\. `magick a\.heic a\.jpg`",
        ),
        ("a.jpg", b"\0\0\0\x18ftypmif1", r"HEIC is not read"),
        ("a.avif", b"\0\0\0\x18ftypavif", r"AVIF is not read"),
        ("a.exr", b"\x76\x2f\x31\x01\2\0\0\0", r"OpenEXR is not read; convert it to a PNG of 16 bits"),
        ("a.hdr", b"#?RADIANCE\n", r"Radiance HDR is not read"),
        ("a.cr3", b"\0\0\0\x18ftypcrx ", r"a camera raw file is not read; develop it to JPEG"),
        ("a.cr2", b"II*\0\x10\0\0\0CR\2\0", r"a camera raw file is not read"),
        ("a.NEF", b"MM\0*\0\0\0\x08", r"a camera raw file is not read"),
        ("a.raf", b"FUJIFILMCCD-RAW 0201", r"a camera raw file is not read"),
        ("a.jp2", b"\0\0\0\x0cjP  \r\n\x87\n", r"JPEG 2000 is not read"),
        ("a.jxl", b"\xff\x0a\xfa\x1f", r"JPEG XL is not read"),
        ("a.png", b"GIF89a\1\0\1\0", r"GIF is not read"),
        ("a.png", b"%!PS-Adobe-3.0 EPSF-3.0\n", r"PostScript is not read"),
        ("a.psd", b"8BPS\0\1", r"a Photoshop document is not read"),
        (
            "a.jpg",
            b"version https://git-lfs.github.com/spec/v1\n",
            r"a Git LFS pointer.* fetch the photos with `git lfs",
        ),
        ("a.jpg", b"", r"is empty"),
        (
            "a.jpg",
            b"\x0a\x05\x01\x08" + bytes(124),
            r"is not an image file of a format that is read \(JPEG, PNG",
        ),  # PCX
    ],
)
def test_other_kinds_of_files_are_named(tmp_path, name, head, line):
    path = written(tmp_path, name, head and head.ljust(200, b"\0"))
    for read in (read_header, decode_image):
        with pytest.raises(InputError, match=rf"^photo .*{name}: {line}"):
            read(path)


def test_photos_of_a_kind_that_is_not_read_are_named_in_a_capture(tmp_path):
    write_corner(tmp_path)
    for photo in (tmp_path / "images").glob("*.png"):
        photo.unlink()
        written(tmp_path / "images", f"{photo.stem}.heic", b"\0\0\0\x18ftypheic".ljust(200, b"\0"))
    with pytest.raises(InputError, match=r"photo0\.heic: HEIC is not read; install pillow-heif"):
        read_capture(tmp_path)


def test_textures_of_meshes_and_scans_are_not_opened(tmp_path, monkeypatch):
    model = TexturedModel(np.eye(3), np.array([[0, 1, 2]]), np.zeros((1, 3, 2)), RGB8)
    for suffix in (".glb", ".obj", ".ply"):
        write_textured(tmp_path / f"m{suffix}", model)
    monkeypatch.setattr(Image, "open", lambda *a, **k: pytest.fail("an image was opened"))
    for suffix in (".glb", ".obj", ".ply"):
        assert read_mesh(tmp_path / f"m{suffix}")[0].shape == (3, 3)
        assert isinstance(read_scan(tmp_path / f"m{suffix}"), Mesh)


def test_dng_is_a_camera_raw_file_whatever_its_suffix(tmp_path):
    for tags in ({50706: 0x01040000}, {262: 32803}):
        with pytest.raises(InputError, match="a camera raw file is not read"):
            read_header(written(tmp_path, "a.tif", tiff((GREY16, tags))))


def test_an_eps_named_png_starts_no_program(tmp_path):
    path = written(tmp_path, "a.png", b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 640 480\n%%EndComments\nshowpage\n")
    code = (
        "import subprocess, sys, pathlib\n"
        "def refuse(*a, **k): print('started', a); raise SystemExit(3)\n"
        "subprocess.Popen = subprocess.check_call = subprocess.run = refuse\n"
        "from fairing.photo import FilePhoto, Mask\n"
        "for item in (FilePhoto, Mask):\n"
        "    try: item(pathlib.Path(sys.argv[1])).load()\n"
        "    except ValueError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    assert done.stdout.count("PostScript is not read") == 2
    assert "started" not in done.stdout


# Pages


def test_tiff_of_several_pictures_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"expected a TIFF of one page, found several"):
        read_header(written(tmp_path, "a.tif", tiff((RGB8, {}), (RGB8, {}))))


def test_thumbnails_and_masks_behind_the_photo_are_ignored(tmp_path):
    small = RGB8[:3, :4]
    for second in ((small, {}), (small, {254: 1}), (RGB8, {254: 4})):
        photo = FilePhoto(written(tmp_path, "a.tif", tiff((RGB8, {}), second)))
        assert photo.size == (8, 6)
        np.testing.assert_array_equal(photo.load(), RGB8)


def test_a_thumbnail_before_the_photo_is_not_taken_for_it(tmp_path):
    with pytest.raises(InputError, match="first page is a thumbnail"):
        read_header(written(tmp_path, "a.tif", tiff((RGB8[:3], {254: 1}), (RGB8, {}))))


@pytest.mark.parametrize("format", ["PNG", "WEBP"])
def test_animations_are_refused(tmp_path, format):
    frames = [Image.fromarray(RGB8), Image.fromarray(255 - RGB8)]
    content = encoded(frames[0], format, save_all=True, append_images=frames[1:], duration=40)
    with pytest.raises(InputError, match="an animation is not read"):
        read_header(written(tmp_path, f"a.{format.lower()}", content))


def test_the_further_pictures_of_a_phone_photo_are_ignored(tmp_path):
    picture = Image.fromarray(smooth_picture())
    several = encoded(picture, "MPO", save_all=True, append_images=[picture.resize((16, 12))])
    photo = FilePhoto(written(tmp_path, "a.jpg", several))
    assert photo.size == (64, 48)
    assert np.abs(photo.load().astype(int) - smooth_picture()).max() < 40


# Alpha


def test_alpha_is_declared_and_decoded(tmp_path):
    alpha = np.where(np.arange(8) < 4, 255, 0).astype(np.uint8) * np.ones((6, 1), np.uint8)
    indexed = Image.fromarray((np.arange(8) // 4 * np.ones((6, 1))).astype(np.uint8))
    indexed.putpalette([10, 20, 30, 40, 50, 60])
    keyed = np.where(alpha[..., None] > 0, RGB8 | 1, 0).astype(np.uint8)
    deep_keyed = np.where(alpha[..., None] > 0, RGB16 | 1, 0).astype(np.uint16)
    deep_grey = np.where(alpha > 0, GREY16 | 1, 0).astype(np.uint16)
    contents = {
        "a.png": png(np.dstack([RGB8, alpha]), 6),
        "b.png": png(np.dstack([GREY8, alpha]), 4),
        "c.png": encoded(indexed, "PNG", transparency=b"\xff\x00"),
        "d.png": png(keyed, 2, (b"tRNS", bytes(6))),
        "e.png": png(deep_keyed, 2, (b"tRNS", bytes(6))),
        "f.png": png(deep_grey, 0, (b"tRNS", bytes(2))),
        "g.png": png(np.dstack([RGB16, alpha.astype(np.uint16) * 257]), 6),
        "h.webp": encoded(Image.fromarray(np.dstack([RGB8, alpha])), "WEBP", lossless=True),
        "i.tif": tiff((np.dstack([RGB8, alpha]), {338: 2})),
    }
    for name, content in contents.items():
        path = written(tmp_path, name, content)
        assert read_header(path).has_alpha, name
        found = decode_image(path).alpha
        assert found is not None, name
        np.testing.assert_array_equal(found, alpha, err_msg=name)
    assert not read_header(written(tmp_path, "z.png", png(RGB8, 2))).has_alpha


def test_a_mask_counts_where_the_image_is_not_black_and_the_photo_is_opaque(tmp_path):
    alpha = np.tile(np.array([0, 100, 127, 128, 200, 255, 255, 255], np.uint8), (6, 1))
    drawn = np.tile(np.array([255, 255, 255, 255, 255, 1, 0, 255], np.uint8), (6, 1))
    photo = written(tmp_path, "a.png", png(np.dstack([RGB8, alpha]), 6))
    image = written(tmp_path, "m.png", png(drawn, 0))
    np.testing.assert_array_equal(Mask(None, alpha=photo).load(), alpha >= 128)
    np.testing.assert_array_equal(Mask(image).load(), drawn > 0)
    np.testing.assert_array_equal(Mask(image, alpha=photo).load(), (alpha >= 128) & (drawn > 0))
    assert Mask(None, alpha=photo).size == (8, 6)


def test_the_noise_of_a_jpeg_mask_is_black(tmp_path):
    is_used = np.hypot(*np.meshgrid(np.arange(-32, 32), np.arange(-24, 24))) < 15
    mask = written(tmp_path, "m.jpg", encoded(Image.fromarray(np.uint8(255) * is_used), "JPEG", quality=60))
    assert (np.asarray(Image.open(mask))[~is_used] > 0).any(), "the file has noise"
    wrong = Mask(mask).load() != is_used
    assert wrong.sum() <= 4, f"{wrong.sum()} pixels, only at the edge"


# Sizes


def test_large_photos_are_read_without_a_warning(tmp_path):
    path = written(tmp_path, "a.png", encoded(Image.new("1", (20_000, 10_000), 1), "PNG"))
    with warnings.catch_warnings(record=True) as caught:
        assert read_header(path).size == (20_000, 10_000)
    assert not caught
    code = "import pathlib, sys; from fairing.image_file import read_header; read_header(pathlib.Path(sys.argv[1]))"
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    assert done.stderr == ""


@pytest.mark.slow
def test_a_photo_of_200_megapixels_is_decoded(tmp_path):
    path = written(tmp_path, "a.jpg", encoded(Image.new("RGB", (16_320, 12_240), (10, 200, 90)), "JPEG"))
    photo = FilePhoto(path).load()
    assert photo.shape == (12_240, 16_320, 3)
    assert np.abs(photo[::997, ::991].astype(int) - (10, 200, 90)).max() <= 2


def test_bombs_are_refused_by_their_declared_size(tmp_path):
    whole = png(np.zeros((1, 1), np.uint8), 0)
    bomb = bytearray(whole)
    bomb[16:24] = (60_000).to_bytes(4, "big") * 2
    bomb[29:33] = zlib.crc32(bytes(bomb[12:29])).to_bytes(4, "big")
    with pytest.raises(InputError, match=r"at most 500 million pixels, found (60000x60000|more than twice as many)"):
        read_header(written(tmp_path, "a.png", bytes(bomb)))

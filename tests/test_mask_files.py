"""Masks as programs name them, and photos whose alpha channel is a mask."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.cli.main import run
from fairing import FilePhoto, Mask
from fairing.errors import InputError
from fairing.io import PhotoChoice, read_capture
from tests.synthetic_capture import HEIGHT, WIDTH, SyntheticCapture

LEFT, TOP = np.s_[:, :30], np.s_[:20, :]


def write_capture(folder: Path, names: tuple[str, ...] = ("a.jpg", "b.jpg", "c.jpg", "d.jpg")) -> SyntheticCapture:
    """Photos in images/, cameras as matrices in cameras/."""
    capture = SyntheticCapture(names=names)
    (folder / "images").mkdir(parents=True)
    (folder / "cameras").mkdir()
    for i, name in enumerate(names):
        Image.fromarray(np.full((HEIGHT, WIDTH, 3), 90 + 20 * i, np.uint8)).save(folder / "images" / name)
        np.savetxt(folder / "cameras" / f"{Path(name).stem}.txt", capture.matrix(i))
    return capture


def write_mask(path: Path, left_out: tuple[slice, slice] = LEFT) -> np.ndarray:
    counts = np.full((HEIGHT, WIDTH), 255, dtype=np.uint8)
    counts[left_out] = 0
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(counts).save(path, **({"quality": 95} if path.suffix == ".jpg" else {}))
    return counts > 0


@pytest.mark.parametrize(
    "name",
    [
        "masks/b.jpg.png", "masks/b.png", "masks/b.jpg", "masks/b.jpg.jpg", "masks/b_mask.png", "masks/b.mask.png",
        "masks/images/b.jpg.png", "masks/B.PNG".replace("B", "b"), "images/b_mask.png", "images/b_mask.jpg",
        "images/b.mask.png", "images/b.jpg.mask.png",
    ],
)  # fmt: skip
def test_masks_are_found_by_the_names_that_programs_give_them(tmp_path: Path, name: str):
    write_capture(tmp_path)
    counts = write_mask(tmp_path / name)
    capture = read_capture(tmp_path)
    assert [view.name for view in capture.views] == ["a.jpg", "b.jpg", "c.jpg", "d.jpg"]
    assert [view.mask is not None for view in capture.views] == [False, True, False, False]
    found = capture.views[1].mask
    assert found is not None
    # A JPEG of a sharp edge may be off by a pixel beside it.
    np.testing.assert_array_equal(found.load()[:, [*range(28), *range(32, WIDTH)]], np.delete(counts, np.s_[28:32], 1))
    assert sum("masks: 1 of 4 photos have one" in warning for warning in capture.warnings) == 1


def test_a_mask_by_stem_belongs_to_no_photo_if_two_photos_have_the_stem(tmp_path: Path):
    write_capture(tmp_path, ("left.jpg", "b.jpg", "c.jpg", "d.jpg"))
    for folder in ("x", "y"):  # the same file names in two folders
        (tmp_path / "masks" / folder).mkdir(parents=True)
        write_mask(tmp_path / "masks" / folder / "b.jpg.png")
    capture = read_capture(tmp_path)
    assert all(view.mask is None for view in capture.views)
    assert any(warning.startswith("masks that belong to no photo: 2") for warning in capture.warnings)


def test_paths_of_photos_and_masks_may_be_text(tmp_path: Path):
    write_capture(tmp_path)
    file = tmp_path / "masks" / "b.png"
    counts = write_mask(file)
    assert np.array_equal(Mask(str(file)).load(), counts)  # pyright: ignore[reportArgumentType]
    photo = FilePhoto(str(tmp_path / "images" / "b.jpg"))  # pyright: ignore[reportArgumentType]
    assert photo.load().shape == (HEIGHT, WIDTH, 3)
    with pytest.raises(InputError, match=r"nothing\.png"):
        Mask("nothing.png").load()  # pyright: ignore[reportArgumentType]


def test_a_png_is_preferred_to_a_jpeg(tmp_path: Path):
    write_capture(tmp_path)
    write_mask(tmp_path / "masks" / "b.jpg", LEFT)
    counts = write_mask(tmp_path / "masks" / "b.png", TOP)
    mask = read_capture(tmp_path).views[1].mask
    assert mask is not None
    np.testing.assert_array_equal(mask.load(), counts)


@pytest.mark.parametrize("folder", ["mask", "Masks", "images/masks"])
def test_masks_that_lie_elsewhere_are_noted(tmp_path: Path, folder: str):
    write_capture(tmp_path)
    write_mask(tmp_path / folder / "b.jpg.png")
    capture = read_capture(tmp_path)
    if (tmp_path / "masks").exists():  # a file system that ignores case
        return
    assert all(view.mask is None for view in capture.views)
    place = tmp_path / folder
    assert f"masks of 1 photos lie in {place} and are not used; use them with --masks {place}" in capture.warnings
    assert read_capture(tmp_path, PhotoChoice(masks=place)).views[1].mask is not None


def test_masks_of_photos_left_out_are_not_reported(tmp_path: Path):
    write_capture(tmp_path)
    write_mask(tmp_path / "masks" / "b.jpg.png")
    warnings = read_capture(tmp_path, PhotoChoice(leave_out=("b.jpg",))).warnings
    assert not any("belong to no photo" in warning for warning in warnings)


# Alpha


def with_alpha(path: Path, alpha: np.ndarray) -> None:
    Image.fromarray(np.dstack([np.asarray(Image.open(path).convert("RGB")), alpha])).save(path)


def transparent(part: tuple[slice, slice]) -> np.ndarray:
    alpha = np.full((HEIGHT, WIDTH), 255, np.uint8)
    alpha[part] = 0
    return alpha


PNGS = ("a.png", "b.png", "c.png", "d.png")


def test_transparent_pixels_are_masked_and_noted_once(tmp_path: Path):
    write_capture(tmp_path, PNGS)
    for name in ("a.png", "b.png"):
        with_alpha(tmp_path / "images" / name, transparent(LEFT))
    with_alpha(tmp_path / "images" / "c.png", transparent(np.s_[:0, :]))
    capture = read_capture(tmp_path)
    assert capture.warnings == ("masks: transparent pixels of 2 of 4 photos are ignored",)
    assert [view.mask is not None for view in capture.views] == [True, True, False, False]
    mask = capture.views[0].mask
    assert mask is not None
    np.testing.assert_array_equal(mask.load(), transparent(LEFT) > 0)


def test_alpha_and_a_mask_both_exclude(tmp_path: Path):
    write_capture(tmp_path, PNGS)
    with_alpha(tmp_path / "images" / "a.png", transparent(LEFT))
    counts = write_mask(tmp_path / "masks" / "a.png.png", TOP)
    mask = read_capture(tmp_path).views[0].mask
    assert mask is not None
    np.testing.assert_array_equal(mask.load(), counts & (transparent(LEFT) > 0))


def test_alpha_that_leaves_nothing_is_not_used(tmp_path: Path):
    write_capture(tmp_path, PNGS)
    with_alpha(tmp_path / "images" / "a.png", transparent(np.s_[:, :]))
    capture = read_capture(tmp_path)
    assert capture.views[0].mask is None
    assert capture.warnings == ("photos that are transparent everywhere: 1 (a.png); their alpha is not used",)


def test_the_alpha_of_photos_left_out_is_not_decoded(tmp_path: Path):
    write_capture(tmp_path, PNGS)
    path = tmp_path / "images" / "a.png"
    with_alpha(path, transparent(LEFT))
    path.write_bytes(path.read_bytes()[:90])
    with pytest.raises(InputError, match=r"a\.png: cannot be decoded"):
        read_capture(tmp_path)
    assert len(read_capture(tmp_path, PhotoChoice(leave_out=("a.png",))).views) == 3


@pytest.mark.parametrize("format", ["colmap", "scene.json"])
def test_masks_of_alpha_survive_a_conversion(tmp_path: Path, format: str):
    source = tmp_path / "in"
    write_capture(source, PNGS)
    with_alpha(source / "images" / "a.png", transparent(LEFT))
    assert run(["convert", str(source), "--out", str(tmp_path / "out"), "--format", format]) == 0
    mask = read_capture(tmp_path / "out").views[0].mask
    assert mask is not None
    np.testing.assert_array_equal(mask.load(), transparent(LEFT) > 0)

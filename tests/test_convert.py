"""Conversion to COLMAP and scene.json, and what of the photos counts: left out, masked, weighed."""

import json
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.cli.main import run
from app.files.scene_source import SceneSource
from fairing.errors import InputError
from fairing.io import PhotoChoice, load_scene, prepare_output_folder, read_capture
from fairing.io import convert as convert_module
from fairing.io.capture import Capture
from fairing.io.convert import write_capture
from fairing.scene import View
from tests.foreign_formats import WRITERS, ForeignCapture, transforms, write_scene
from tests.program_formats import PROGRAM_WRITERS
from tests.small_scene import corner_scene
from tests.synthetic_capture import CUBE_FACES, CUBE_VERTICES, HEIGHT, WIDTH

PLAIN = ForeignCapture()
BROWN = ForeignCapture(lens=(-0.15, 0.05, 0.002, -0.003, -0.01))
FORMATS = ("colmap", "scene.json")


def assert_same(one: Capture, other: Capture) -> None:
    """Names without suffix, photos to the byte, projections to 1e-6 px, points with their observations."""
    assert [Path(v.name).stem for v in one.views] == [Path(v.name).stem for v in other.views]
    for view, twin in zip(one.views, other.views, strict=True):
        assert np.abs(view.camera.project(PLAIN.points)[0] - twin.camera.project(PLAIN.points)[0]).max() < 1e-6
        np.testing.assert_array_equal(view.photo.load(), twin.photo.load())
    assert (one.sparse_points is None) == (other.sparse_points is None)
    if one.sparse_points is not None and other.sparse_points is not None:
        np.testing.assert_array_equal(one.sparse_points.positions, other.sparse_points.positions)
        np.testing.assert_array_equal(one.sparse_points.colors, other.sparse_points.colors)
        seen = [
            sorted(zip(p.observations.tolist(), p.pixels.tolist(), strict=True))
            for p in (one.sparse_points, other.sparse_points)
        ]
        assert [key for key, _ in seen[0]] == [key for key, _ in seen[1]]
        np.testing.assert_allclose([xy for _, xy in seen[0]], [xy for _, xy in seen[1]], rtol=0, atol=1e-9)


@pytest.mark.parametrize("to", FORMATS)
@pytest.mark.parametrize("name", WRITERS | PROGRAM_WRITERS)
def test_every_format_converts_to_the_same_scene(tmp_path: Path, name: str, to: str):
    source = write_scene(PLAIN, tmp_path / "scene", (WRITERS | PROGRAM_WRITERS)[name])
    assert run(["convert", str(source), "--out", str(tmp_path / "out"), "--format", to]) == 0
    assert_same(read_capture(source), read_capture(tmp_path / "out"))
    for photo in PLAIN.names:
        assert (tmp_path / "out" / "images" / photo).read_bytes() == (source / "images" / photo).read_bytes()
    scene = load_scene(tmp_path / "out")
    np.testing.assert_array_equal(scene.mesh.vertices, CUBE_VERTICES)
    np.testing.assert_array_equal(scene.original_faces, CUBE_FACES)


@pytest.mark.parametrize("to", FORMATS)
@pytest.mark.parametrize("name", ["COLMAP", "OpenMVG", "nerfstudio"])
def test_bent_photos_are_written_straight(tmp_path: Path, name: str, to: str):
    source = write_scene(BROWN, tmp_path / "scene", name)
    assert run(["convert", str(source), "--out", str(tmp_path / "out"), "--format", to]) == 0
    assert_same(read_capture(source), read_capture(tmp_path / "out"))
    assert (tmp_path / "out" / "images" / "a.png").read_bytes() != (source / "images" / "a.png").read_bytes()


def test_photos_of_one_lens_share_a_camera(tmp_path: Path):
    source = write_scene(PLAIN, tmp_path / "scene", "matrices")
    assert run(["convert", str(source), "--out", str(tmp_path / "out")]) == 0
    lines = (tmp_path / "out" / "sparse" / "cameras.txt").read_text().splitlines()
    assert [line for line in lines if not line.startswith("#")] == ["1 PINHOLE 96 72 110.0 110.0 48.0 36.0"]


@pytest.mark.parametrize("to", FORMATS)
def test_a_scene_in_memory_is_written(tmp_path: Path, to: str):
    scene = corner_scene()
    prepare_output_folder(tmp_path)
    write_capture(tmp_path, to, scene.views, None, (scene.mesh.vertices, scene.mesh.faces))
    twin = load_scene(tmp_path)
    for view, other in zip(scene.views, twin.views, strict=True):
        pixels = view.camera.project(scene.mesh.vertices)[0]
        assert np.abs(pixels - other.camera.project(scene.mesh.vertices)[0]).max() < 1e-6
        np.testing.assert_array_equal(view.photo.load(), other.photo.load())


def test_a_skew_camera_fits_scene_json_but_not_colmap(tmp_path: Path):
    source = write_scene(PLAIN, tmp_path / "scene", "matrices")
    shear = np.array([[1, 0.01, 0], [0, 1, 0], [0, 0, 1]])
    np.savetxt(source / "cameras" / "b.txt", shear @ PLAIN.matrix(1), fmt="%.17g")
    assert run(["convert", str(source), "--out", str(tmp_path / "a"), "--format", "scene.json"]) == 0
    assert_same(read_capture(source), read_capture(tmp_path / "a"))
    with pytest.raises(InputError, match=r"photo b\.png: its camera has a skew.*convert to scene\.json"):
        write_capture(tmp_path / "b", "colmap", read_capture(source).views)


def test_an_interrupted_conversion_is_not_taken_for_a_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    source, out = write_scene(PLAIN, tmp_path / "scene", "COLMAP"), tmp_path / "out"
    assert run(["convert", str(source), "--out", str(out)]) == 0
    write_photo = convert_module._write_photo

    def fail(view: View, path: Path) -> None:
        if path.name == "c.png":
            raise KeyboardInterrupt
        write_photo(view, path)

    monkeypatch.setattr(convert_module, "_write_photo", fail)
    assert run(["convert", str(source), "--out", str(out)]) == 130
    with pytest.raises(InputError, match="expected one of"):
        read_capture(out)


def test_convert_overwrites_nothing_of_others(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    source = write_scene(PLAIN, tmp_path / "scene", "COLMAP")
    before = {path: path.stat().st_mtime_ns for path in source.rglob("*")}
    assert run(["convert", str(source), "--out", str(source)]) == 1
    assert "expected an empty or new folder" in capsys.readouterr().err
    assert {path: path.stat().st_mtime_ns for path in source.rglob("*")} == before


def write_mask(path: Path, left_out: tuple[slice, slice]) -> np.ndarray:
    counts = np.full((HEIGHT, WIDTH), 255, dtype=np.uint8)
    counts[left_out] = 0
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(counts).save(path)
    return counts > 0


@pytest.mark.parametrize("to", FORMATS)
def test_masks_are_found_by_colmap_s_names_and_converted(tmp_path: Path, to: str):
    source = write_scene(PLAIN, tmp_path / "scene", "COLMAP")
    counts = write_mask(source / "masks" / "b.png.png", np.s_[10:20, :30])
    capture = read_capture(source)
    assert [view.mask is not None for view in capture.views] == [False, True, False, False]
    assert f"masks: 1 of 4 photos have one in {source / 'masks'}" in capture.warnings
    assert run(["convert", str(source), "--out", str(tmp_path / "out"), "--format", to]) == 0
    mask = read_capture(tmp_path / "out").views[1].mask
    assert mask is not None
    np.testing.assert_array_equal(mask.load(), counts)


def test_a_mask_is_bent_back_with_its_photo(tmp_path: Path):
    source = write_scene(BROWN, tmp_path / "scene", "nerfstudio")
    write_mask(source / "elsewhere" / "a.png.png", np.s_[:, :24])
    (view, *_) = read_capture(source, PhotoChoice(masks=source / "elsewhere")).views
    assert view.mask is not None
    lens = view.photo.lens
    border = lens.undistort(np.array([[23.5, y] for y in range(5, HEIGHT - 5)]))
    counts = view.mask.load()
    for x, y in border:
        assert not counts[round(y), : int(x - 1)].any()
        assert counts[round(y), int(x + 2) :].all()


def test_masks_that_a_format_names_are_used(tmp_path: Path):
    content = transforms(PLAIN)
    content["frames"][2]["mask_path"] = "masks/c.png"
    source = write_scene(
        PLAIN, tmp_path / "scene", lambda _, folder: (folder / "transforms.json").write_text(json.dumps(content))
    )
    counts = write_mask(source / "masks" / "c.png", np.s_[:9, :])
    capture = read_capture(source)
    mask = capture.views[2].mask
    assert mask is not None
    np.testing.assert_array_equal(mask.load(), counts)
    assert capture.warnings == ()


def test_photos_left_out_and_weights_take_names_and_patterns(tmp_path: Path):
    source = write_scene(PLAIN, tmp_path / "scene", "COLMAP")
    capture = read_capture(source, PhotoChoice(leave_out=("b.*",), photo_weights=("a.png=0.5", "[cd].png=2")))
    assert [(view.name, view.weight) for view in capture.views] == [("a.png", 0.5), ("c.png", 2.0), ("d.png", 2.0)]
    assert capture.warnings[0] == "photos left out on request: 1 (b.png)"
    points = capture.sparse_points
    assert points is not None
    for v, view in enumerate(capture.views):
        mine = points.observations[:, 1] == v
        assert mine.sum() == len(PLAIN.points)
        pixels, _ = view.camera.project(points.positions[points.observations[mine, 0]])
        assert np.abs(pixels - points.pixels[mine]).max() < 1e-6


def test_weights_survive_in_scene_json_and_are_said_to_be_lost_in_colmap(tmp_path: Path, capsys):
    source = write_scene(PLAIN, tmp_path / "scene", "COLMAP")
    for to in FORMATS:
        out = str(tmp_path / to)
        assert run(["convert", str(source), "--out", out, "--format", to, "--photo-weights", "a.png=0.5"]) == 0
        said = " ".join(capsys.readouterr().err.split())
        assert ("weights are not kept" in said) == (to == "colmap")
    assert read_capture(tmp_path / "scene.json").views[0].weight == 0.5


@pytest.mark.parametrize("name", ["COLMAP", "OpenMVG"])
def test_photos_at_half_their_size_show_points_at_the_same_places(tmp_path: Path, name: str):
    source = write_scene(BROWN, tmp_path / "scene", name)
    write_mask(source / "masks" / "b.png.png", np.s_[10:21, :30])
    whole, half = read_capture(source), read_capture(source, PhotoChoice(photo_scale=0.5))
    for view, small in zip(whole.views, half.views, strict=True):
        assert (small.camera.width, small.camera.height) == (WIDTH // 2, HEIGHT // 2) == small.photo.size
        uv, _ = view.camera.project(BROWN.points)
        np.testing.assert_allclose(small.camera.project(BROWN.points)[0], (uv + 0.5) / 2 - 0.5, atol=1e-9)
        squares = view.photo.load().reshape(HEIGHT // 2, 2, WIDTH // 2, 2, 3).mean(axis=(1, 3))
        assert np.abs(small.photo.load() - squares).max() <= 0.51
    masks = whole.views[1].mask, half.views[1].mask
    assert masks[0] is not None
    assert masks[1] is not None
    squares = masks[0].load().reshape(HEIGHT // 2, 2, WIDTH // 2, 2).all(axis=(1, 3))
    np.testing.assert_array_equal(masks[1].load(), squares)
    points = half.sparse_points
    assert points is not None
    for v, view in enumerate(half.views):
        mine = points.observations[:, 1] == v
        pixels, _ = view.camera.project(points.positions[points.observations[mine, 0]])
        assert np.abs(pixels - points.pixels[mine]).max() < 1e-6


def test_an_odd_size_is_rounded_and_its_camera_scaled_to_match(tmp_path: Path):
    source = write_scene(PLAIN, tmp_path / "scene", "COLMAP")
    view = read_capture(source, PhotoChoice(photo_scale=0.33)).views[0]
    assert view.photo.load().shape == (24, 32, 3)
    np.testing.assert_allclose(np.diag(view.camera.K)[:2], [PLAIN.focal * 32 / 96, PLAIN.focal * 24 / 72])


CHOICES = {
    "scale of nothing": (PhotoChoice(photo_scale=0.0), r"--photo-scale: expected 0\.05 to 1, found 0"),
    "enlarged": (PhotoChoice(photo_scale=2.0), r"--photo-scale: expected 0\.05 to 1, found 2"),
    "unknown photo": (PhotoChoice(leave_out=("z.png",)), r"--leave-out z\.png: no photo has this name.*a\.png"),
    "too many": (PhotoChoice(leave_out=("*",)), "expected at least 3 photos, found 0"),
    "unknown weight": (PhotoChoice(photo_weights=("z=1",)), "--photo-weights z: no photo has this name"),
    "no number": (PhotoChoice(photo_weights=("a.png",)), r"--photo-weights a\.png: expected a photo's name, =, and"),
    "zero": (PhotoChoice(photo_weights=("a.png=0",)), r"a number of 1e-06 to 1e\+06"),
    "infinite": (PhotoChoice(photo_weights=("a.png=inf",)), r"a number of 1e-06 to 1e\+06"),
    "no folder": (PhotoChoice(masks=Path("nowhere")), "--masks nowhere: expected a folder"),
}


@pytest.mark.parametrize("what", CHOICES)
def test_a_choice_that_cannot_be_met_is_one_clear_line(tmp_path: Path, what: str):
    choice, said = CHOICES[what]
    with pytest.raises(InputError, match=said):
        load_scene(write_scene(PLAIN, tmp_path / "scene", "COLMAP"), choice=choice)


def test_a_mask_of_another_size_or_of_no_photo_is_said(tmp_path: Path):
    source = write_scene(PLAIN, tmp_path / "scene", "COLMAP")
    write_mask(source / "masks" / "z.png", np.s_[:9, :])
    assert "masks that belong to no photo: 1 (z.png)" in read_capture(source).warnings[-1]
    Image.new("L", (10, 10)).save(source / "masks" / "b.png.png")
    with pytest.raises(InputError, match=r"mask .*b\.png\.png: expected the photo's 96x72 pixels, found 10x10"):
        read_capture(source)


def test_a_run_remembers_what_of_its_photos_counted(tmp_path: Path):
    source = write_scene(PLAIN, tmp_path / "scene", "COLMAP")
    write_mask(source / "other" / "b.png.png", np.s_[:9, :])
    choice = PhotoChoice(leave_out=("a.png",), masks=source / "other", photo_weights=("b.png=2",), photo_scale=0.5)
    header: dict = {}
    SceneSource.typed(str(source), None, choice).note_in(header)
    scene = SceneSource.of_run(json.loads(json.dumps(header)), tmp_path).load()
    assert [(v.name, v.weight, v.mask is not None) for v in scene.views] == [
        ("b.png", 2.0, True), ("c.png", 1.0, False), ("d.png", 1.0, False),
    ]  # fmt: skip
    assert scene.views[0].camera.width == WIDTH // 2


def test_a_replay_takes_the_photos_of_its_run_unless_told_otherwise(tmp_path: Path):
    source = write_scene(PLAIN, tmp_path / "scene", "COLMAP")
    choice = PhotoChoice(leave_out=("a.png",))
    recorded = SceneSource.typed(str(source), None, choice)
    header: dict = {}
    recorded.note_in(header)
    moved = write_scene(PLAIN, tmp_path / "moved", "COLMAP")

    def replayed(scene: str | None, photos: PhotoChoice) -> SceneSource:
        return SceneSource.of_replay(header, tmp_path, scene, None, photos)

    assert replayed(None, PhotoChoice()) == recorded
    assert replayed(str(moved), PhotoChoice()) == SceneSource(str(moved), None, choice)
    other = PhotoChoice(leave_out=("b.png",))
    assert replayed(str(moved), other) == SceneSource(str(moved), None, other)
    assert SceneSource.of_replay({}, tmp_path, str(moved), None, other).choice == other
    with pytest.raises(InputError, match="give it with --scene"):
        SceneSource.of_replay({}, tmp_path, None, None, other)


def test_a_conversion_is_the_same_to_the_byte_on_another_day(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    source = write_scene(PLAIN, tmp_path / "scene", "COLMAP")
    assert run(["convert", str(source), "--out", str(tmp_path / "one"), "--format", "scene.json"]) == 0
    day = time.localtime(time.time() + 86400)
    monkeypatch.setattr(time, "localtime", lambda *_: day)
    assert run(["convert", str(source), "--out", str(tmp_path / "two"), "--format", "scene.json"]) == 0
    files = [path.relative_to(tmp_path / "one") for path in (tmp_path / "one").rglob("*.*") if path.is_file()]
    assert Path("points.npz") in files
    for file in files:
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes(), file


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda arrays: arrays.pop("pixels"), "expected the arrays"),
        (lambda arrays: arrays.update(positions=np.zeros((5, 2))), "positions: expected 3 columns"),
        (lambda arrays: arrays.update(positions=arrays["positions"] * np.nan), "positions: expected finite"),
        (lambda arrays: arrays.update(observations=arrays["observations"] + 9), "observations: expected points and views"),
        (lambda arrays: arrays.update(pixels=arrays["pixels"][:3]), "as many observations as pixels"),
        (None, "cannot be read"),
    ],
)  # fmt: skip
def test_a_damaged_file_of_points_is_one_clear_line(tmp_path: Path, change, said: str):
    source = write_scene(PLAIN, tmp_path / "scene", "COLMAP")
    assert run(["convert", str(source), "--out", str(tmp_path / "out"), "--format", "scene.json"]) == 0
    file = tmp_path / "out" / "points.npz"
    if change is None:
        file.write_bytes(file.read_bytes()[:-200])
    else:
        arrays = dict(np.load(file))
        change(arrays)
        np.savez(file, **arrays)
    with pytest.raises(InputError, match=rf"points\.npz: {said}|points\.npz: .*{said}") as error:
        load_scene(tmp_path / "out")
    assert "\n" not in str(error.value)


def test_a_straightened_photo_is_made_once_and_cannot_be_written_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    view = read_capture(write_scene(BROWN, tmp_path / "scene", "COLMAP")).views[0]
    first = view.photo.load()
    monkeypatch.setattr("fairing.lens.cv2.remap", lambda *_, **__: pytest.fail("straightened again"))
    assert view.photo.load() is first
    with pytest.raises(ValueError, match="read-only"):
        first[0, 0] = 0

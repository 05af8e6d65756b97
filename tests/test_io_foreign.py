"""Formats of other programs: all conventions against each other, and one clear line for whatever is wrong."""

import json
import re
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from fairing.errors import InputError
from fairing.io import load_scene, read_capture
from tests.foreign_formats import (
    WRITERS,
    ForeignCapture,
    alicevision,
    openmvg,
    transforms,
    write_alicevision,
    write_bundler,
    write_middlebury,
    write_nerf,
    write_openmvg,
    write_scene,
    write_strecha,
    write_transforms,
)
from tests.synthetic_capture import HEIGHT, WIDTH

PLAIN = ForeignCapture()
BARREL = ForeignCapture(lens=(-0.12, 0.02, 0.0, 0.0, 0.0))
BROWN = ForeignCapture(lens=(-0.15, 0.05, 0.002, -0.003, -0.01))
CAPTURES = Path(__file__).parents[2] / "shared" / "captures"


@pytest.mark.parametrize("name", WRITERS)
def test_the_same_scene_projects_alike_through_every_format(tmp_path: Path, name: str):
    scene = load_scene(write_scene(PLAIN, tmp_path / "scene", name))
    assert [view.name for view in scene.views] == list(PLAIN.names)
    for i, view in enumerate(scene.views):
        expected = cv2.projectPoints(PLAIN.points, PLAIN.rvecs[i], PLAIN.tvecs[i], PLAIN.K, None)[0][:, 0]
        pixels, depth = view.camera.project(PLAIN.points)
        assert np.abs(pixels - expected).max() < 1e-6
        assert depth.min() > 0


@pytest.mark.parametrize("name", ["COLMAP", "Bundler", "OpenMVG", "Meshroom"])
def test_sparse_points_of_every_format_lie_where_the_photos_saw_them(tmp_path: Path, name: str):
    capture = BARREL if name == "Bundler" else BROWN
    scene = load_scene(write_scene(capture, tmp_path / "scene", name))
    points = scene.sparse_points
    assert points is not None
    assert len(points.observations) == len(capture.points) * len(capture.names)
    order = np.argsort(points.positions[:, 0])
    np.testing.assert_array_equal(points.positions[order], capture.points[np.argsort(capture.points[:, 0])])
    for v, view in enumerate(scene.views):
        mine = points.observations[:, 1] == v
        pixels, _ = view.camera.project(points.positions[points.observations[mine, 0]])
        assert np.abs(pixels - points.pixels[mine]).max() < 1e-6


@pytest.mark.parametrize("name", ["nerfstudio", "Bundler", "OpenMVG", "Meshroom"])
def test_a_photo_is_straightened_alike_through_every_format(tmp_path: Path, name: str):
    capture = BARREL if name == "Bundler" else BROWN
    one = load_scene(write_scene(capture, tmp_path / "colmap", "COLMAP"))
    other = load_scene(write_scene(capture, tmp_path / "other", name))
    for view, twin in zip(one.views, other.views, strict=True):
        np.testing.assert_allclose(twin.camera.image_from_world, view.camera.image_from_world, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(twin.photo.load(), view.photo.load())


@pytest.mark.parametrize("version", [(1, 0, 0), (1, 2, 0), (1, 2, 1), (1, 2, 2), (1, 2, 5), (1, 2, 6)])
def test_meshroom_files_of_all_versions_mean_the_same(tmp_path: Path, version: tuple[int, int, int]):
    def write(capture: ForeignCapture, folder: Path) -> None:
        (folder / "old.sfm").write_text(json.dumps(alicevision(capture, version)))

    scene = load_scene(write_scene(BROWN, tmp_path / "scene", write))
    for i, view in enumerate(scene.views):
        np.testing.assert_allclose(view.camera.image_from_world, BROWN.matrix(i), rtol=0, atol=1e-9)


@pytest.mark.parametrize(("version", "ratio"), [((1, 2, 4), 2.0), ((1, 2, 5), 0.5)])
def test_meshroom_turned_its_pixel_ratio_over(tmp_path: Path, version: tuple[int, int, int], ratio: float):
    content = alicevision(PLAIN, version)
    content["intrinsics"][0] |= {"pixelRatio": repr(ratio)}
    scene = load_scene(write_scene(PLAIN, tmp_path / "scene", as_file("a.sfm", content)))
    assert scene.views[0].camera.K[1, 1] == pytest.approx(PLAIN.focal / 2)


def as_file(name: str, content: Any) -> Callable[[ForeignCapture, Path], None]:
    def write(_: ForeignCapture, folder: Path) -> None:
        (folder / name).write_text(json.dumps(content))

    return write


def test_intrinsics_of_a_frame_win_over_those_of_the_file(tmp_path: Path):
    content = transforms(PLAIN)
    content["frames"][2] |= {"fl_x": 120.0, "fl_y": 121.0, "cx": 50.0, "cy": 30.0}
    scene = load_scene(write_scene(PLAIN, tmp_path / "scene", as_file("transforms.json", content)))
    np.testing.assert_allclose(scene.views[2].camera.K, [[120, 0, 49.5], [0, 121, 29.5], [0, 0, 1]], atol=1e-9)
    np.testing.assert_allclose(scene.views[1].camera.K, PLAIN.K, atol=1e-9)


def test_both_angles_of_view_give_two_focal_lengths(tmp_path: Path):
    content = transforms(PLAIN)
    del content["fl_x"], content["fl_y"]
    content |= {"camera_angle_x": 2 * np.arctan(WIDTH / 2 / 90), "camera_angle_y": 2 * np.arctan(HEIGHT / 2 / 95)}
    scene = load_scene(write_scene(PLAIN, tmp_path / "scene", as_file("transforms.json", content)))
    assert np.diag(scene.views[0].camera.K)[:2] == pytest.approx((90, 95))


def test_photos_kept_at_half_size_scale_their_cameras(tmp_path: Path):
    """A camera file for twice the size, as with Strecha's photos."""

    def write(capture: ForeignCapture, folder: Path) -> None:
        write_strecha(capture, folder)
        for file in folder.glob("*.camera"):
            words = file.read_text().split()
            f, cx, cy = (float(words[i]) for i in (0, 2, 5))
            words[0], words[4] = repr(2 * f), repr(2 * f)
            words[2], words[5] = repr(2 * (cx + 0.5) - 0.5), repr(2 * (cy + 0.5) - 0.5)
            file.write_text(" ".join([*words[:-2], str(2 * WIDTH), str(2 * HEIGHT)]))

    scene = load_scene(write_scene(PLAIN, tmp_path / "scene", write))
    for i, view in enumerate(scene.views):
        np.testing.assert_allclose(view.camera.image_from_world, PLAIN.matrix(i), rtol=0, atol=1e-9)
    assert "another size than calibrated, cameras scaled with them: 4" in scene.warnings[0]


def test_photos_without_a_pose_are_left_out_and_counted(tmp_path: Path):
    content = openmvg(PLAIN)
    del content["extrinsics"][1]
    capture = read_capture(write_scene(PLAIN, tmp_path / "scene", as_file("sfm_data.json", content)))
    assert [view.name for view in capture.views] == ["a.png", "c.png", "d.png"]
    assert capture.warnings == ("photos left out, without a pose: 1 (b.png)",)
    assert capture.sparse_points is not None
    assert len(capture.sparse_points.observations) == 3 * len(PLAIN.points)


def test_cameras_alone_give_way_to_a_model_with_points_and_can_still_be_chosen(tmp_path: Path):
    folder = write_scene(PLAIN, tmp_path / "scene", "COLMAP")
    write_middlebury(PLAIN, folder)
    capture = read_capture(folder)
    assert capture.sparse_points is not None
    assert "also holds middlebury (4 photos): choose with --format" in capture.warnings[0]
    assert read_capture(folder / "small_par.txt").sparse_points is None


def dumped(make: Callable[[ForeignCapture], dict[str, Any]], name: str, *keys: Any, to: Any) -> Callable[[Path], None]:
    """Damage: a value of a JSON file replaced, or taken away where `to` is ...."""

    def damage(folder: Path) -> None:
        content = make(PLAIN)
        item: Any = content
        for key in keys[:-1]:
            item = item[key]
        if to is ...:
            del item[keys[-1]]
        else:
            item[keys[-1]] = to
        (folder / name).write_text(json.dumps(content))

    return damage


def word(name: str, line: int, index: int, to: str) -> Callable[[Path], None]:
    """Damage: a word of a text file replaced."""

    def damage(folder: Path) -> None:
        lines = (folder / name).read_text().splitlines()
        words = lines[line].split()
        words[index] = to
        lines[line] = " ".join(words)
        (folder / name).write_text("\n".join(lines))

    return damage


def cut(name: str, share: float = 0.6) -> Callable[[Path], None]:
    """Damage: the end of a file is lost."""

    def damage(folder: Path) -> None:
        data = (folder / name).read_bytes()
        (folder / name).write_bytes(data[: int(share * len(data))])

    return damage


nerf = partial(dumped, transforms, "transforms.json")
mvg = partial(dumped, openmvg, "sfm_data.json")
sfm = partial(dumped, alicevision, "cameras.sfm")
PINHOLE = ("intrinsics", 0, "value", "ptr_wrapper", "data")
DAMAGE: dict[str, tuple[Callable[[ForeignCapture, Path], None], Callable[[Path], object], str]] = {
    "nerf cut": (write_transforms, cut("transforms.json"), r"transforms\.json: line 1: expected JSON"),
    "nerf no frames": (write_transforms, nerf("frames", to=...), r"transforms\.json: the file: expected frames"),
    "nerf frames no list": (write_transforms, nerf("frames", to=3), r"frames: expected a list, found 3"),
    "nerf empty": (write_transforms, nerf("frames", to=[]), r"transforms\.json: expected photos with cameras"),
    "nerf frame no object": (write_transforms, nerf("frames", 1, to=[]), r"frames\[1\]: expected an object"),
    "nerf no pose": (
        write_transforms,
        nerf("frames", 1, "transform_matrix", to=...),
        r"frames\[1\]: expected transform_matrix",
    ),
    "nerf short pose": (
        write_transforms,
        nerf("frames", 1, "transform_matrix", to=[[1, 2]]),
        r"frames\[1\]\.transform_matrix: expected 4x4 numbers",
    ),
    "nerf NaN pose": (
        write_transforms,
        nerf("frames", 1, "transform_matrix", 0, 0, to=float("nan")),
        r"photo b\.png: camera: expected finite",
    ),
    "nerf no rotation": (
        write_transforms,
        nerf("frames", 1, "transform_matrix", to=[[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]),
        r"photo b\.png: camera: R is not a rotation",
    ),
    "nerf panorama": (write_transforms, nerf("camera_model", to="EQUIRECTANGULAR"), "EQUIRECTANGULAR is not supported"),
    "nerf vr": (write_transforms, nerf("camera_model", to="VR180_L"), "VR180_L is not supported"),
    "ngp ftheta": (write_transforms, nerf("ftheta_p0", to=0.0), "camera model ftheta_p0 is not supported"),
    "ngp latlong": (write_transforms, nerf("latlong", to=True), "camera model latlong is not supported"),
    "ngp panorama": (write_transforms, nerf("equirectangular", to=True), "camera model equirectangular is not supported"),
    "ngp orthographic": (write_transforms, nerf("frames", 1, "orthographic", to=True), "orthographic is not supported"),
    "ngp mitsuba": (write_transforms, nerf("from_mitsuba", to=True), "from_mitsuba is not supported"),
    "nerf k5": (write_transforms, nerf("k5", to=0.1), "distortion k5 is not supported"),
    "nerf last row": (
        write_transforms,
        nerf("frames", 1, "transform_matrix", 3, to=[0, 0, 0.001, 1]),
        r"frames\[1\]\.transform_matrix: expected 0 0 0 1 as the last row of a pose, found 0 0 0\.001 1",
    ),
    "nerf scaled": (
        write_transforms,
        nerf("frames", 1, "transform_matrix", 3, to=[0, 0, 0, 2]),
        r"expected 0 0 0 1 as the last row of a pose, found 0 0 0 2",
    ),
    "nerf no points": (write_transforms, nerf("ply_file_path", to="gone.ply"), r"gone\.ply: expected a scan, found no"),
    "nerf applied": (
        write_transforms,
        nerf("applied_transform", to=[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 2]]),
        r"applied_transform: expected 0 0 0 1 as the last row of a pose, found 0 0 0 2",
    ),
    "nerf text": (write_transforms, nerf("fl_x", to="110"), r'fl_x: expected a number, found "110"'),
    "nerf infinite": (write_transforms, nerf("fl_x", to=float("inf")), r"fl_x: expected a finite number"),
    "nerf huge": (write_transforms, nerf("fl_x", to=10**400), r"fl_x: expected a finite number"),
    "nerf width": (write_transforms, nerf("w", to=0), r"w: expected a positive whole number, found 0"),
    "nerf other width": (write_transforms, nerf("w", to=100), r"photo a\.png: .*expects 100x72"),
    "nerf no photo": (write_transforms, nerf("frames", 0, "file_path", to="gone.png"), r"photo gone\.png: expected"),
    "nerf zero byte": (write_transforms, nerf("frames", 0, "file_path", to="a\0.png"), r"frames\[0\]\.file_path .*without NUL"),
    "nerf angle": (
        write_nerf,
        lambda folder: (folder / "transforms.json").write_text(
            (folder / "transforms.json").read_text().replace('"camera_angle_x": 0.', '"camera_angle_x": 4.')
        ),
        "field of view between 0 and pi radians",
    ),
    "middlebury cut": (write_middlebury, cut("small_par.txt"), r"small_par\.txt: expected .*it is incomplete"),
    "middlebury word": (write_middlebury, word("small_par.txt", 2, 3, "x"), r"line 3: expected K, R and t of b\.png"),
    "middlebury NaN": (write_middlebury, word("small_par.txt", 2, 3, "nan"), r"line 3: .*instead of a finite number"),
    "middlebury count": (write_middlebury, word("small_par.txt", 0, 0, "-4"), r"line 1: expected the number of photos"),
    "middlebury absurd": (write_middlebury, word("small_par.txt", 0, 0, "9" * 15), r"end of the file; it is incomplete"),
    "middlebury more": (write_middlebury, word("small_par.txt", 0, 0, "3"), r"expected the end of the file"),
    "middlebury photo": (write_middlebury, word("small_par.txt", 1, 0, "z.png"), r"^photo z\.png: .*--leave-out z\.png"),
    "middlebury mirrored": (
        write_middlebury,
        word("small_par.txt", 1, 10, "-0.99"),
        r"photo a\.png: camera: R is (not a rotation|mirrored)",
    ),
    "strecha cut": (write_strecha, cut("b.png.camera"), r"b\.png\.camera: expected .*it is incomplete"),
    "strecha word": (write_strecha, word("b.png.camera", 1, 1, "f"), r"b\.png\.camera: line 2: expected K, found 'f'"),
    "strecha distorted": (write_strecha, word("b.png.camera", 3, 0, "0.1"), r"expected three zeros after K"),
    "strecha photo": (write_strecha, lambda f: (f / "images/b.png").unlink(), r"photo b\.png: expected an image file"),
    "strecha size": (write_strecha, word("b.png.camera", 8, 0, "95"), r"photo b\.png: .*expects 95x72"),
    "bundler cut": (write_bundler, cut("bundle.out"), r"bundle\.out: expected .*it is incomplete"),
    "bundler no list": (write_bundler, lambda f: (f / "list.txt").unlink(), r"expected the list of its photos"),
    "bundler short list": (write_bundler, cut("list.txt", 0.45), r"expected 2 cameras .* found 4"),
    "bundler cameras": (write_bundler, word("bundle.out", 1, 0, "9" * 15), r"expected 4 cameras .* found 9999"),
    "bundler points": (write_bundler, word("bundle.out", 1, 1, "9" * 15), r"end of the file; it is incomplete"),
    "bundler observations": (write_bundler, word("bundle.out", 24, 0, "9" * 15), r"bundle\.out: line \d+: expected"),
    "bundler camera": (write_bundler, word("bundle.out", 24, 1, "9"), r"line 25: expected a camera below 4, found 9"),
    "bundler NaN": (write_bundler, word("bundle.out", 22, 1, "nan"), r"line 23: .*instead of a finite number"),
    "bundler negative": (write_bundler, word("bundle.out", 2, 0, "-110"), r"camera 0: lens: .*positive focal"),
    "openmvg cut": (write_openmvg, cut("sfm_data.json"), r"sfm_data\.json: line 1: expected JSON"),
    "openmvg no poses": (write_openmvg, mvg("extrinsics", to=[]), r"sfm_data\.json: expected poses \(extrinsics\)"),
    "openmvg no intrinsics": (write_openmvg, mvg("intrinsics", to=...), r"the file: expected intrinsics"),
    "openmvg spherical": (
        write_openmvg,
        mvg("intrinsics", 0, "value", "polymorphic_name", to="spherical"),
        r"intrinsics\[0\]\.value: camera model spherical is not supported",
    ),
    "openmvg lens": (write_openmvg, mvg(*PINHOLE, "disto_t2", to=[1]), r"disto_t2: expected 5 numbers, found \[1\]"),
    "openmvg rotation": (
        write_openmvg,
        mvg("extrinsics", 0, "value", "rotation", 1, to=[0, 0]),
        r"extrinsics\[0\]\.value\.rotation: expected 3x3 numbers, found rows of different",
    ),
    "openmvg key": (write_openmvg, mvg("extrinsics", 0, "key", to="a"), r'extrinsics\[0\]\.key: expected a whole .*"a"'),
    "openmvg NaN point": (
        write_openmvg,
        mvg("structure", 0, "value", "X", 0, to=float("nan")),
        r"sfm_data\.json: sparse points: expected finite positions",
    ),
    "openmvg observation": (
        write_openmvg,
        mvg("structure", 0, "value", "observations", 0, "value", "x", to=[1, 2, 3]),
        r"structure\[0\]\.value\.observations\[0\]\.value\.x: expected 2 numbers",
    ),
    "meshroom cut": (write_alicevision, cut("cameras.sfm"), r"cameras\.sfm: line 1: expected JSON"),
    "meshroom no JSON": (write_alicevision, lambda f: (f / "cameras.sfm").write_bytes(b"\xff\xfe"), "UTF-8"),
    "meshroom version": (write_alicevision, sfm("version", to="new"), r"version: expected 3 numbers"),
    "meshroom no poses": (write_alicevision, sfm("poses", to=""), r"cameras\.sfm: expected poses"),
    "meshroom fisheye": (
        write_alicevision,
        sfm("intrinsics", 0, "type", to="equidistant"),
        "camera model equidistant is not supported",
    ),
    "meshroom anamorphic": (
        write_alicevision,
        sfm("intrinsics", 0, "distortionType", to="3deanamorphic4"),
        "camera model 3deanamorphic4 is not supported",
    ),
    "meshroom word": (write_alicevision, sfm("intrinsics", 0, "focalLength", to="far"), r"focalLength: expected a number"),
    "meshroom sensor": (write_alicevision, sfm("intrinsics", 0, "sensorWidth", to="-1"), "positive sensorWidth"),
    "meshroom rotation": (
        write_alicevision,
        sfm("poses", 0, "pose", "transform", "rotation", to=["1"] * 8),
        r"rotation: expected 9 numbers",
    ),
    "meshroom NaN": (
        write_alicevision,
        sfm("poses", 0, "pose", "transform", "center", to=["nan", "0", "0"]),
        r"photo a\.png: camera: expected finite",
    ),
    "meshroom photo": (write_alicevision, sfm("views", 0, "path", to="/x/gone.jpg"), r"photo /x/gone\.jpg: expected"),
}  # fmt: skip


@pytest.mark.parametrize("what", DAMAGE)
def test_damaged_files_of_every_format_are_one_clear_line(tmp_path: Path, what: str):
    write, damage, said = DAMAGE[what]
    folder = write_scene(PLAIN, tmp_path / "scene", write)
    damage(folder)
    with pytest.raises(InputError, match=said) as error:
        load_scene(folder)
    assert "\n" not in str(error.value)


FILES = {
    "nerfstudio": "transforms.json", "NeRF": "transforms.json", "Middlebury": "small_par.txt",
    "Strecha": "b.png.camera", "Bundler": "bundle.out", "OpenMVG": "sfm_data.json", "Meshroom": "cameras.sfm",
    "scene.json": "scene.json",
}  # fmt: skip
VALUES = [b"nan", b"1e400", b"-1", b"99999999999999999999", b"0", b"null", b"[]", b'"x"', b"1e308", b"1e-320"]


@pytest.mark.parametrize("name", FILES)
@pytest.mark.filterwarnings("error")
def test_whatever_is_damaged_is_read_or_refused_in_one_line(tmp_path: Path, name: str):
    capture = ForeignCapture(n_points=5, lens=(-0.1, 0.01, 0.0, 0.0, 0.0))
    folder = write_scene(capture, tmp_path / "scene", name)
    file = folder / FILES[name]
    whole, rng = file.read_bytes(), np.random.default_rng(3)
    numbers = list(re.finditer(rb"-?\d+\.?\d*(e-?\d+)?", whole))
    for kind in range(24):
        damaged = bytearray(whole)
        if kind % 3 == 0:
            damaged[rng.integers(len(damaged))] = rng.integers(256)
        elif kind % 3 == 1:
            start = rng.integers(len(damaged))
            del damaged[start : start + 40]
        else:
            found = numbers[rng.integers(len(numbers))]
            damaged[found.start() : found.end()] = VALUES[rng.integers(len(VALUES))]
        file.write_bytes(damaged)
        with suppress(InputError):  # whose message is always one line; anything else fails
            load_scene(folder)


@pytest.mark.captures
@pytest.mark.skipif(not CAPTURES.exists(), reason="real captures are not part of this repository")
def test_original_camera_files_of_real_captures_agree_with_their_models():
    for model, original, tolerance in (
        (CAPTURES / "fountain-P11", CAPTURES / "fountain-P11" / "strecha", 0.01),
        (CAPTURES / "templeSparseRing", CAPTURES / "templeSparseRing" / "templeSR_par.txt", 0.7),
    ):
        one, other = read_capture(model), read_capture(original)
        points = one.sparse_points
        assert points is not None
        for v, (view, twin) in enumerate(zip(one.views, other.views, strict=True)):
            seen = points.positions[points.observations[points.observations[:, 1] == v, 0]]
            assert view.name == twin.name
            assert np.abs(view.camera.project(seen)[0] - twin.camera.project(seen)[0]).max() < tolerance

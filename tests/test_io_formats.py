"""Plain matrices and scene.json, the choice among formats and meshes, and the output folder."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from app.cli.main import run
from fairing.errors import InputError
from fairing.io import PhotoChoice, load_scene, prepare_output_folder
from fairing.io.load import READERS
from fairing.io.photo_choice import SceneFormat
from tests.synthetic_capture import HEIGHT, WIDTH, SyntheticCapture, write_colmap_capture

CAPTURE = SyntheticCapture()


def write_matrix_scene(folder: Path, matrices: str = "cameras", photos: str = "images") -> None:
    CAPTURE.write_photos(folder / photos)
    CAPTURE.write_matrices(folder / matrices)
    CAPTURE.write_mesh(folder / "mesh.obj")


@pytest.mark.parametrize(
    ("matrices", "photos"), [("cameras", "images"), (".", "."), ("images", "images"), (".", "images")]
)
def test_matrices_are_read_as_they_are(tmp_path: Path, matrices: str, photos: str):
    write_matrix_scene(tmp_path, matrices, photos)
    scene = load_scene(tmp_path)
    assert [view.name for view in scene.views] == list(CAPTURE.names)
    for i, view in enumerate(scene.views):
        np.testing.assert_allclose(view.camera.image_from_world, CAPTURE.matrix(i), rtol=1e-12)
        assert (view.camera.width, view.camera.height) == (WIDTH, HEIGHT)


def test_photos_without_a_matrix_are_left_out_and_counted(tmp_path: Path):
    write_matrix_scene(tmp_path)
    (tmp_path / "cameras" / "c.txt").unlink()
    scene = load_scene(tmp_path)
    assert len(scene.views) == 3
    assert scene.warnings == ("photos left out because they have no matrix: 1 (c.png)",)


def test_notes_beside_the_matrices_are_ignored(tmp_path: Path):
    write_matrix_scene(tmp_path)
    (tmp_path / "README.txt").write_text("taken in May")
    assert len(load_scene(tmp_path).views) == 4


def written(file: str, content: str) -> Callable[[Path], object]:
    return lambda folder: (folder / file).write_text(content)


UPSIDE_DOWN = np.array([[1, 0, 0], [0, -1, HEIGHT - 1], [0, 0, 1]])
MIRRORED = " ".join(map(repr, (UPSIDE_DOWN @ CAPTURE.matrix(1)).ravel().tolist()))
MATRIX_DAMAGE = {
    "eleven numbers": (written("cameras/b.txt", "1 2 3 4 5 6 7 8 9 10 11"), r"b\.txt: expected 12 numbers, found 11"),
    "a word": (written("cameras/b.txt", "P = 1"), r"b\.txt: expected 12 numbers, found P, =, 1"),
    "NaN": (written("cameras/b.txt", "nan " * 12), r"b\.txt: camera matrix: expected finite"),
    "singular": (written("cameras/b.txt", "1 " * 12), r"b\.txt: camera matrix: .*singular"),
    "missing photo": (lambda f: (f / "images/b.png").unlink(), r"b\.txt: expected a photo of the same stem"),
    "empty photo": (written("images/b.png", ""), r"photo .*b\.png"),
    "two of a stem": (written("b.txt", "1 " * 12), r"expected one file of this stem"),
    "not UTF-8": (lambda f: (f / "cameras/b.txt").write_bytes(b"\xff\xfe"), r"b\.txt: .*UTF-8"),
    "mirrored": (written("cameras/b.txt", MIRRORED), r"photo b\.png: .*mirrored"),
}


@pytest.mark.parametrize("what", MATRIX_DAMAGE)
def test_damaged_matrix_scene_is_one_clear_line(tmp_path: Path, what: str):
    write_matrix_scene(tmp_path)
    damage, said = MATRIX_DAMAGE[what]
    damage(tmp_path)
    with pytest.raises(InputError, match=said) as error:
        load_scene(tmp_path)
    assert "\n" not in str(error.value)


def scene_description() -> dict[str, Any]:
    views: list[dict[str, Any]] = [
        {"photo": f"images/{name}", "width": WIDTH, "height": HEIGHT, "image_from_world": CAPTURE.matrix(i).tolist()}
        for i, name in enumerate(CAPTURE.names)
    ]
    views[1]["name"] = "second"
    Rt = np.linalg.solve(CAPTURE.K, views[2].pop("image_from_world"))
    views[2] |= {"K": CAPTURE.K.tolist(), "R": Rt[:, :3].tolist(), "t": Rt[:, 3].tolist()}
    return {"mesh": "mesh.obj", "views": views}


def write_json_scene(folder: Path, description: Any) -> None:
    CAPTURE.write_photos(folder / "images")
    CAPTURE.write_mesh(folder / "mesh.obj")
    CAPTURE.write_mesh(folder / "other.obj")
    (folder / "scene.json").write_text(json.dumps(description))


def test_scene_json_gives_mesh_photos_and_cameras(tmp_path: Path):
    write_json_scene(tmp_path, scene_description())
    for scene in (load_scene(tmp_path), load_scene(tmp_path / "scene.json")):
        assert [view.name for view in scene.views] == ["images/a.png", "second", "images/c.png", "images/d.png"]
        for i, view in enumerate(scene.views):
            np.testing.assert_allclose(view.camera.image_from_world, CAPTURE.matrix(i), rtol=1e-9, atol=1e-9)


def changed(*keys: Any, to: Any) -> Callable[[dict[str, Any]], None]:
    def change(description: dict[str, Any]) -> None:
        item: Any = description
        for key in keys[:-1]:
            item = item[key]
        item[keys[-1]] = to

    return change


def without(*keys: Any) -> Callable[[dict[str, Any]], None]:
    def change(description: dict[str, Any]) -> None:
        item: Any = description
        for key in keys[:-1]:
            item = item[key]
        del item[keys[-1]]

    return change


JSON_DAMAGE = {
    "no views": (without("views"), "the file: expected views"),
    "views no list": (changed("views", to=3), "views: expected a list, found 3"),
    "view no object": (changed("views", 1, to="a.png"), r"views\[1\]: expected an object"),
    "misspelt key": (changed("views", 1, "widht", to=3), r"views\[1\]: expected only .*, found widht"),
    "matrix and pose": (changed("views", 1, "K", to=3), r"views\[1\]: expected only .*, found K"),
    "no photo": (without("views", 1, "photo"), r"views\[1\]: expected photo"),
    "no camera": (without("views", 1, "image_from_world"), r"views\[1\]: expected K \(or image_from_world\)"),
    "photo no text": (changed("views", 1, "photo", to=7), r"views\[1\]\.photo: expected a text, found 7"),
    "width no integer": (changed("views", 1, "width", to=9.5), r"views\[1\]\.width: expected a positive whole number"),
    "width of another photo": (changed("views", 1, "width", to=95), r"views\[1\]: photo second: .*95x72"),
    "matrix short": (
        changed("views", 1, "image_from_world", to=[[1, 2]]),
        r"views\[1\]\.image_from_world: expected 3x4",
    ),
    "matrix ragged": (changed("views", 1, "image_from_world", to=[[1, 2], [1]]), r"views\[1\]\..*different lengths"),
    "matrix of texts": (changed("views", 1, "image_from_world", to=[["1"] * 4] * 3), r"views\[1\]\.image_from_world"),
    "NaN": (changed("views", 1, "image_from_world", 0, 0, to=float("nan")), r"views\[1\]: camera matrix: .*NaN"),
    "mirrored": (changed("views", 2, "R", to=[[1, 0, 0], [0, -1, 0], [0, 0, 1]]), r"views\[2\]: camera: R is mirrored"),
    "K lower": (changed("views", 2, "K", 2, 0, to=1), r"views\[2\]\.K: expected an upper triangular"),
    "photo missing": (
        changed("views", 2, "photo", to="images/z.png"),
        r"^photo images/z\.png: expected an image file, found none",
    ),
    "zero byte": (changed("views", 2, "photo", to="\0"), r"views\[2\]\.photo .*without NUL"),
    "zero byte in mesh": (changed("mesh", to="\0.ply"), "mesh .*without NUL"),
    "name twice": (changed("views", 2, "name", to="second"), "two photos are named second"),
    "two views": (without("views", slice(2, None)), "at least 3 photos, found 2"),
    "mesh missing": (changed("mesh", to="gone.ply"), r"gone\.ply: expected a mesh, found no such file"),
    "mesh no text": (changed("mesh", to=None), "mesh: expected a text"),
}


@pytest.mark.parametrize("what", JSON_DAMAGE)
def test_damaged_scene_json_names_the_item(tmp_path: Path, what: str):
    change, said = JSON_DAMAGE[what]
    description = scene_description()
    change(description)
    write_json_scene(tmp_path, description)
    with pytest.raises(InputError, match=said) as error:
        load_scene(tmp_path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "[" * 100_000, '{"views": [NaN]}', "\ufeff{}", "{} {}"])
def test_json_that_is_no_scene_is_one_clear_line(tmp_path: Path, text: str):
    (tmp_path / "scene.json").write_text(text)
    with pytest.raises(InputError, match=r"scene\.json") as error:
        load_scene(tmp_path)
    assert "\n" not in str(error.value)


def test_nothing_supported_lists_what_is_and_what_was_found(tmp_path: Path):
    (tmp_path / "notes.md").write_text("hello")
    with pytest.raises(InputError, match=r"COLMAP model.*plain matrices.*scene\.json.*found notes\.md"):
        load_scene(tmp_path)


def write_three_models(folder: Path) -> None:
    """COLMAP with sparse points, matrices of three photos, and a scene.json without points."""
    capture = write_colmap_capture(folder)
    capture.write_matrices(folder / "cameras")
    (folder / "cameras" / "c.txt").unlink()
    description = scene_description()
    description["mesh"] = "mesh.obj"
    (folder / "scene.json").write_text(json.dumps(description))


def test_the_most_complete_of_several_models_is_read_and_the_others_are_named(tmp_path: Path):
    write_three_models(tmp_path)
    scene = load_scene(tmp_path)
    assert len(scene.views) == 4
    assert scene.sparse_points is not None
    assert (
        "read as colmap (4 photos); it also holds matrices (3 photos), scene.json (4 photos): choose with --format"
        in scene.warnings
    )


def test_more_photos_are_more_complete_than_sparse_points(tmp_path: Path):
    write_colmap_capture(tmp_path, SyntheticCapture(names=("a.png", "b.png", "c.png")))
    CAPTURE.write_photos(tmp_path / "images")
    CAPTURE.write_matrices(tmp_path / "cameras")
    assert len(load_scene(tmp_path).views) == 4


@pytest.mark.parametrize(("format", "photos"), [("colmap", 4), ("matrices", 3), ("scene.json", 4)])
def test_the_format_can_be_chosen(tmp_path: Path, format: SceneFormat, photos: int):
    write_three_models(tmp_path)
    scene = load_scene(tmp_path, choice=PhotoChoice(format=format))
    assert len(scene.views) == photos
    assert (scene.sparse_points is not None) == (format == "colmap")
    assert not any("it also holds" in warning for warning in scene.warnings)


def test_the_commands_take_the_format(tmp_path: Path, capsys: pytest.CaptureFixture):
    """`convert --format` is the format it writes, so the one it reads is `--from-format`."""
    write_three_models(tmp_path / "scene")
    command = ["convert", str(tmp_path / "scene"), "--out", str(tmp_path / "out"), "--format", "scene.json"]
    assert run([*command, "--from-format", "matrices"]) == 0
    assert "3 photos, 0 sparse points" in capsys.readouterr().err
    assert run(["check", str(tmp_path / "scene"), "--format", "bundler"]) == 1
    assert "--format bundler: expected" in capsys.readouterr().err


def test_a_format_that_is_not_there_is_refused(tmp_path: Path):
    write_colmap_capture(tmp_path)
    with pytest.raises(InputError, match=r"--format bundler: expected a Bundler .*found images/, mesh\.obj, sparse/"):
        load_scene(tmp_path, choice=PhotoChoice(format="bundler"))


def test_every_format_can_be_named():
    assert {reader.NAME for reader in READERS} == set(get_args(SceneFormat))


@pytest.mark.parametrize(
    "foreign",
    [
        '{"scene": {"objects": []}}',
        '{"views": [{"id": 1, "path": "a.png"}]}',
        "[]",
        "{",
    ],
)
def test_a_foreign_scene_json_is_no_candidate(tmp_path: Path, foreign: str):
    write_colmap_capture(tmp_path)
    (tmp_path / "scene.json").write_text(foreign)
    (tmp_path / "transforms.json").write_text(foreign)
    scene = load_scene(tmp_path)
    assert scene.sparse_points is not None
    assert scene.warnings == ()


def test_a_damaged_model_beside_a_readable_one_is_named(tmp_path: Path):
    write_three_models(tmp_path)
    with (tmp_path / "sparse" / "images.txt").open("a") as file:
        file.write("nonsense\n")
    scene = load_scene(tmp_path)
    (note,) = (warning for warning in scene.warnings if "it also holds" in warning)
    assert note.startswith("read as scene.json (4 photos)")
    assert "colmap (not readable: " in note
    assert "images.txt: line" in note


def test_missing_folder_and_other_file_are_refused(tmp_path: Path):
    with pytest.raises(InputError, match="nowhere: expected a scene"):
        load_scene(tmp_path / "nowhere")
    (tmp_path / "movie.mp4").write_text("")
    with pytest.raises(InputError, match=r"movie\.mp4: expected one of"):
        load_scene(tmp_path / "movie.mp4")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="an empty folder"):
        load_scene(tmp_path / "empty")


def test_several_meshes_must_be_chosen_from(tmp_path: Path):
    capture = write_colmap_capture(tmp_path)
    capture.write_mesh(tmp_path / "other.obj")
    with pytest.raises(InputError, match=r"found mesh\.obj, other\.obj; choose with --mesh"):
        load_scene(tmp_path)
    assert len(load_scene(tmp_path, mesh=tmp_path / "other.obj").mesh.faces) == 12


def test_findings_about_the_mesh_become_warnings(tmp_path: Path):
    write_colmap_capture(tmp_path)
    with (tmp_path / "mesh.obj").open("a") as file:
        file.write("\nf 1 1 2\nv 0 0 0\n")
    assert load_scene(tmp_path).warnings == (
        "mesh: degenerate faces: 1 (first: 12); they take no part",
        "mesh: vertices of no face: 1 (first: 8); they stay where they are",
    )


@pytest.mark.parametrize(
    ("mesh", "said"),
    [
        ("v 0 0 0\nv 1 0 0\nf 1 2 3", r"mesh\.obj: mesh: face 0 uses vertices"),
        ("v 0 0 nan\nv 1 0 0\nv 1 1 0\nf 1 2 3", r"mesh\.obj: mesh: vertex 0 is not finite"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3", r"mesh\.obj: mesh: .*all 1 faces have no area"),
        ("v 90 0 0\nv 91 0 0\nv 91 1 0\nf 1 2 3", "none of its 3 vertices lies inside any of the 4 photos"),
    ],
)
def test_unusable_mesh_of_a_scene_is_one_clear_line(tmp_path: Path, mesh: str, said: str):
    write_colmap_capture(tmp_path)
    (tmp_path / "mesh.obj").write_text(mesh)
    with pytest.raises(InputError, match=said) as error:
        load_scene(tmp_path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("item", [".", "images/a.png", "sparse/cameras.txt", "mesh.obj"])
def test_missing_permission_is_one_clear_line(tmp_path: Path, item: str):
    write_colmap_capture(tmp_path)
    (tmp_path / item).chmod(0)
    if os.access(tmp_path / item, os.R_OK):
        pytest.skip("this user may read everything")
    try:
        with pytest.raises(InputError, match=r"(?i)permission denied"):
            load_scene(tmp_path)
    finally:
        (tmp_path / item).chmod(0o755)


def test_file_system_failure_while_reading_is_one_clear_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    write_colmap_capture(tmp_path)

    def refuse(self: Path) -> bytes:
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(InputError, match=r"cameras\.txt: .*Permission denied"):
        load_scene(tmp_path)


def test_output_folder_is_made_and_may_be_used_again(tmp_path: Path):
    folder = tmp_path / "deep" / "out"
    prepare_output_folder(folder)
    (folder / "mesh.ply").write_text("result")
    prepare_output_folder(folder)
    assert (folder / "mesh.ply").read_text() == "result"
    (tmp_path / "empty").mkdir()
    prepare_output_folder(tmp_path / "empty")


def test_output_folder_with_other_content_is_refused_and_untouched(tmp_path: Path):
    (tmp_path / "mesh.ply").write_text("somebody's work")
    with pytest.raises(InputError, match=r"found mesh\.ply; choose another"):
        prepare_output_folder(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mesh.ply"]
    with pytest.raises(InputError, match="found a file"):
        prepare_output_folder(tmp_path / "mesh.ply")
    with pytest.raises(InputError, match="could not be created"):
        prepare_output_folder(tmp_path / "mesh.ply" / "out")

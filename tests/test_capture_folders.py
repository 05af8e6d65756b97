"""Folders as programs leave them: missing photos, keys and numbers that mean something else, points without observations."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.files.scene_source import SceneSource
from fairing.errors import InputError
from fairing.io import PhotoChoice, load_scene, read_capture
from fairing.scene import View
from tests.foreign_formats import WRITERS, ForeignCapture, alicevision, write_scene
from tests.program_formats import PROGRAM_WRITERS

PLAIN = ForeignCapture()
ALL_WRITERS = WRITERS | PROGRAM_WRITERS
# Their cameras are found beside photos, so that one without a photo is an error of its own.
BY_PHOTO = ("matrices",)


@pytest.mark.parametrize("name", [name for name in ALL_WRITERS if name not in BY_PHOTO])
def test_a_missing_photo_is_refused_by_name_and_can_be_left_out(tmp_path: Path, name: str):
    folder = write_scene(PLAIN, tmp_path / "scene", ALL_WRITERS[name])
    whole = read_capture(folder)
    (folder / "images" / "b.png").unlink()
    with pytest.raises(
        InputError, match=r"photo .*b.*: expected an image file, found none .*--leave-out (b|images/b)"
    ) as error:
        read_capture(folder)
    hint = str(error.value).rsplit(maxsplit=1)[-1]
    capture = read_capture(folder, PhotoChoice(leave_out=(hint,)))
    assert [view.name for view in capture.views] == [view.name for view in whole.views if "b.png" not in view.name]
    for view in capture.views:
        twin = next(other for other in whole.views if other.name == view.name)
        np.testing.assert_array_equal(view.camera.image_from_world, twin.camera.image_from_world)


def test_a_folder_of_a_demos_name_that_holds_a_capture_is_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    assert SceneSource.typed("cube", None).scene == "cube"
    (tmp_path / "cube").mkdir()
    assert SceneSource.typed("cube", None).scene == "cube"  # an output folder, say
    write_scene(PLAIN, tmp_path / "cube", "COLMAP")
    assert SceneSource.typed("cube", None).scene == str(tmp_path / "cube")
    assert [view.name for view in load_scene("cube").views] == list(PLAIN.names)
    run = {"source": {"scene": "cube", "points": "given"}}
    # A run of the demo is never of the folder, unless the command line names it.
    assert SceneSource.of_replay(run, tmp_path / "run.trace", None, None, PhotoChoice()).scene == "cube"
    with pytest.raises(InputError, match="the demo cube takes all its photos"):
        SceneSource.of_replay(run, tmp_path / "run.trace", None, None, PhotoChoice(leave_out=("a.png",)))
    assert SceneSource.of_replay(run, tmp_path / "run.trace", "cube", None, PhotoChoice()).scene == str(
        tmp_path / "cube"
    )


# ---------------------------------------------------------------------- keys and numbers


def test_a_second_model_of_meshroom_is_refused_by_name(tmp_path: Path):
    content = alicevision(PLAIN)
    content["intrinsics"][0] |= {"undistortionType": "3deanamorphic4", "undistortionParams": ["0.1"] * 14}

    def write(_: ForeignCapture, folder: Path) -> None:
        (folder / "cameras.sfm").write_text(json.dumps(content))

    folder = write_scene(PLAIN, tmp_path / "scene", write)
    with pytest.raises(InputError, match=r"cameras\.sfm: .*undistortionType 3deanamorphic4 is not supported"):
        read_capture(folder)
    content["intrinsics"][0]["undistortionType"] = "none"
    write(PLAIN, folder)
    assert len(read_capture(folder).views) == 4


def repeated(file: str, key: str) -> Callable[[Path], None]:
    """Writes a key of a JSON file a second time, at its first place."""

    def damage(folder: Path) -> None:
        text = (folder / file).read_text()
        assert f'"{key}": ' in text
        (folder / file).write_text(text.replace(f'"{key}": ', f'"{key}": null, "{key}": ', 1))

    return damage


@pytest.mark.parametrize(
    ("name", "file", "key"),
    [
        ("nerfstudio", "transforms.json", "fl_x"),
        ("nerfstudio", "transforms.json", "transform_matrix"),
        ("OpenMVG", "sfm_data.json", "rotation"),
        ("Meshroom", "cameras.sfm", "focalLength"),
        ("OpenSfM", "reconstruction.json", "translation"),
        ("scene.json", "scene.json", "K"),
    ],
)
def test_a_key_given_twice_is_refused(tmp_path: Path, name: str, file: str, key: str):
    folder = write_scene(PLAIN, tmp_path / "scene", ALL_WRITERS[name])
    repeated(file, key)(folder)
    with pytest.raises(InputError, match=rf'{file}: expected each key of an object once, found "{key}" twice'):
        read_capture(folder)


@pytest.mark.parametrize("weight", [1e299, 1e7, 1e-7, 0, -1, float("nan"), float("inf")])
def test_weights_beyond_all_use_are_refused(tmp_path: Path, weight: float):
    view = read_capture(write_scene(PLAIN, tmp_path / "scene", "scene.json")).views[0]
    with pytest.raises(InputError, match=r"photo .*a\.png: expected a weight of 1e-06 to 1e\+06, found"):
        View(view.name, view.camera, view.photo, weight=weight)
    with pytest.raises(
        InputError, match=r"--photo-weights .*: expected a photo's name, =, and a number of 1e-06 to 1e\+06"
    ):
        read_capture(tmp_path / "scene", PhotoChoice(photo_weights=(f"*a.png={weight}",)))


def test_a_weight_in_scene_json_is_bounded(tmp_path: Path):
    folder = write_scene(PLAIN, tmp_path / "scene", "scene.json")
    content: dict[str, Any] = json.loads((folder / "scene.json").read_text())
    content["views"][1]["weight"] = 1e299
    (folder / "scene.json").write_text(json.dumps(content))
    with pytest.raises(
        InputError, match=r"views\[1\]: photo b\.png: expected a weight of 1e-06 to 1e\+06, found 1e\+299"
    ):
        load_scene(folder)


# ---------------------------------------------------------------------- points without observations


def test_points_that_no_two_photos_observe_are_not_counted(tmp_path: Path):
    points = read_capture(write_scene(PLAIN, tmp_path / "scene", "COLMAP")).sparse_points
    assert points is not None
    assert points.n_observed == 40
    in_one = points.observations[:, 1] == 0
    for kept in (in_one, np.zeros(len(in_one), dtype=bool)):
        assert replace(points, observations=points.observations[kept], pixels=points.pixels[kept]).n_observed == 0


def test_a_run_of_a_demo_is_of_the_demo_wherever_it_is_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    header: dict[str, Any] = {}
    SceneSource.typed("cube", None).note_in(header)
    write_scene(PLAIN, tmp_path / "cube", "COLMAP")
    monkeypatch.chdir(tmp_path)
    assert SceneSource.of_replay(header, tmp_path / "run.trace", None, None, PhotoChoice()).scene == "cube"

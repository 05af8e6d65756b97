"""What is exported shows no photo from outside the capture folder in silence."""

import json
import shutil
from pathlib import Path

import pytest

from app.cli.main import run
from app.files.outside_photos import capture_folder, outside_photos
from fairing.io import read_capture
from tests.small_scene import HEIGHT, WIDTH, cameras, write_corner

QUICK = ["--schedule.blur", "2", "--schedule.max-sweeps", "1", "--cells.size", "16"]
LINE = "1 photos lie outside the capture folder"


def capture(folder: Path, photo: str | None = None) -> Path:
    """The capture `capture` in a folder. Its last photo lies beside the capture if its path there is given."""
    write_corner(folder / "capture")
    described = [
        {"name": f"photo{i}", "photo": f"images/photo{i}.png", "width": WIDTH, "height": HEIGHT,
         "image_from_world": camera.image_from_world.tolist()}
        for i, camera in enumerate(cameras())
    ]  # fmt: skip
    if photo is not None:
        shutil.move(folder / "capture" / "images" / "photo7.png", folder / "private.png")
        described[7]["photo"] = photo
    for matrix in (folder / "capture" / "images").glob("*.txt"):
        matrix.unlink()
    (folder / "capture" / "scene.json").write_text(json.dumps({"mesh": "mesh.obj", "views": described}))
    return folder / "capture"


def line_of(path: Path) -> str:
    return outside_photos(str(path), read_capture(path).views)


@pytest.mark.parametrize("is_file", [False, True])
def test_photos_in_the_capture_folder_are_not_mentioned(tmp_path: Path, is_file: bool):
    folder = capture(tmp_path)
    assert line_of(folder / "scene.json" if is_file else folder) == ""


@pytest.mark.parametrize("kind", ["relative", "absolute", "link", "link of the folder"])
def test_photos_from_elsewhere_are_named(tmp_path: Path, kind: str):
    photo = {"relative": "../private.png", "absolute": str(tmp_path / "private.png")}.get(kind, "linked/x.png")
    folder = capture(tmp_path, photo)
    if kind == "link":
        (folder / "linked").mkdir()
        (folder / "linked" / "x.png").symlink_to(tmp_path / "private.png")
    elif kind == "link of the folder":
        (tmp_path / "elsewhere").mkdir()
        shutil.copy(tmp_path / "private.png", tmp_path / "elsewhere" / "x.png")
        (folder / "linked").symlink_to(tmp_path / "elsewhere")
    line = line_of(folder)
    assert line.startswith(f"{LINE} {folder.resolve()} (")
    assert Path(photo).name in line


def test_a_link_to_the_capture_is_the_capture(tmp_path: Path):
    folder = capture(tmp_path / "real")
    (tmp_path / "link").symlink_to(folder)
    assert line_of(tmp_path / "link") == ""


@pytest.mark.parametrize("part", ["sparse", "sparse/0", "cameras", "dense/0/sparse"])
def test_a_part_of_the_capture_stands_for_the_capture(tmp_path: Path, part: str):
    (tmp_path / "c" / part).mkdir(parents=True)
    (tmp_path / "c" / part / "cameras.txt").touch()
    assert capture_folder(tmp_path / "c" / part) == (tmp_path / "c").resolve()
    assert capture_folder(tmp_path / "c" / part / "cameras.txt") == (tmp_path / "c").resolve()


def test_every_command_that_writes_photos_prints_the_line_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    folder, out = capture(tmp_path, "../private.png"), tmp_path / "run"
    assert run(["fair", str(folder), "--out", str(out), *QUICK]) == 0
    assert LINE not in capsys.readouterr().err, "mesh and record hold no photos"
    for command in (
        ["export", str(out), "--out", str(tmp_path / "a.html")],
        ["export", str(out), "--out", str(tmp_path / "r.html"), "--report"],
        ["export", str(out), "--out", str(tmp_path / "a.png")],
        ["texture", str(folder), "--out", str(tmp_path / "a.glb"), "--size", "256"],
        ["convert", str(folder), "--out", str(tmp_path / "copy")],
        ["check", str(folder), "--out", str(tmp_path / "check")],
    ):
        assert run(command) == 0, command
        shown = capsys.readouterr()
        assert (shown.out + shown.err).count(LINE) == 1, command
    # The copy is complete in itself.
    assert run(["texture", str(tmp_path / "copy"), "--out", str(tmp_path / "b.glb"), "--size", "256"]) == 0
    assert LINE not in capsys.readouterr().err

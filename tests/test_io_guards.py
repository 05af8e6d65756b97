"""Guards where files enter: pipes, damaged archives, implausible numbers, names, and what killed runs leave behind."""

import errno
import io
import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.cli.main import run
from app.debugger.bookmarks import Bookmarks, read_bookmarks, write_bookmarks
from app.files.scene_source import SceneSource
from fairing.camera import Camera
from fairing.errors import InputError
from fairing.io import load_scene, prepare_output_folder, read_mesh, write_atomically, write_mesh
from fairing.io.points_file import read_points, write_points
from fairing.io.scan_file import read_matches, read_scan
from fairing.lens import Lens
from fairing.mesh import Mesh
from fairing.photo import FilePhoto, Mask
from fairing.registration.alignment import register_matches
from fairing.scene import View
from fairing.trace import Trace
from fairing.triangulation import FlipTrace
from tests.foreign_formats import ForeignCapture, alicevision, openmvg, write_scene
from tests.small_scene import sparse_points
from tests.synthetic_capture import CUBE_FACES, CUBE_VERTICES, HEIGHT, WIDTH, write_colmap_capture

CAPTURE = ForeignCapture(n_points=5)


def refused(call: Callable[[], Any], said: str) -> None:
    with pytest.raises(InputError, match=said) as error:
        call()
    assert "\n" not in str(error.value)


# ---------------------------------------------------------------------- pipes


READERS_OF_FILES: dict[str, Callable[[Path], Any]] = {
    "photo": lambda path: FilePhoto(path).load(),
    "photo size": lambda path: FilePhoto(path).size,
    "mask": lambda path: Mask(path).load(),
    "mesh.obj": read_mesh,
    "mesh.ply": read_mesh,
    "scan.ply": read_scan,
    "matches": lambda path: read_matches(path, ()),
    "points.npz": lambda path: read_points(path, 3),
    "run.trace": Trace.load,
    "mesh.flips": FlipTrace.load,
    "scene.json": load_scene,
    "run.bookmarks.json": lambda path: read_bookmarks(path, 9),
}


@pytest.mark.parametrize("name", READERS_OF_FILES)
def test_a_pipe_is_refused_at_once(tmp_path: Path, name: str):
    """Opening a pipe without a writer would block for ever."""
    os.mkfifo(tmp_path / name)
    refused(lambda: READERS_OF_FILES[name](tmp_path / name), f"{name}: expected .*(pipe|expected one of)")


def test_a_pipe_among_the_photos_is_refused(tmp_path: Path):
    write_colmap_capture(tmp_path)
    (tmp_path / "images" / "b.png").unlink()
    os.mkfifo(tmp_path / "images" / "b.png")
    refused(lambda: load_scene(tmp_path), r"b\.png: expected an image file, found a pipe")


# ---------------------------------------------------------------------- archives of points


def archive(path: Path, **changes: Any) -> Path:
    points = sparse_points(CUBE_VERTICES)
    arrays = {name: getattr(points, name) for name in ("positions", "colors", "observations", "pixels")} | changes
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, array in arrays.items():
            buffer = io.BytesIO()
            if isinstance(array, bytes):
                buffer.write(array)
            else:
                np.save(buffer, array)
            file.writestr(f"{name}.npy", buffer.getvalue())
    return path


def declaring(shape: str, descr: str = "<f8") -> bytes:
    """A .npy file whose header declares a shape that no data follows."""
    header = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header


def test_every_flipped_bit_of_a_points_file_is_read_or_refused(tmp_path: Path):
    write_points(tmp_path / "points.npz", sparse_points(CUBE_VERTICES))
    whole = (tmp_path / "points.npz").read_bytes()
    refusals = []
    for bit in range(0, 8 * len(whole), 7):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        (tmp_path / "points.npz").write_bytes(damaged)
        try:
            read_points(tmp_path / "points.npz", 3)
        except InputError as error:
            refusals.append(str(error))
    assert len(refusals) > 100
    assert all("points.npz: " in line for line in refusals)


ARCHIVES = {
    "2^44 points": (declaring("(17592186044416, 3)"), r"declares shape \(17592186044416, 3\), holds"),
    "2^80 points": (declaring(f"({2**80}, 3)"), "declares shape"),
    "negative": (declaring("(-1, 3)"), "declares shape"),
    "objects": (declaring("(0, 3)", "|O"), "expected numbers, found object"),
    "texts": (declaring("(0, 3)", "<U9"), "expected numbers, found <U9"),
    "no array": (b"hello", "magic string"),
    "long header": (b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 65535, "cannot be read"),
    "version 9": (b"\x93NUMPY\x09\x00", "cannot be read"),
}


@pytest.mark.parametrize("what", ARCHIVES)
def test_an_array_that_declares_nonsense_is_refused(tmp_path: Path, what: str):
    content, said = ARCHIVES[what]
    path = archive(tmp_path / "points.npz", positions=content)
    refused(lambda: read_points(path, 3), rf"points\.npz: expected sparse points, cannot be read \(.*{said}|{said}")


def test_points_that_lie_too_far_away_are_refused(tmp_path: Path):
    path = archive(tmp_path / "points.npz", positions=np.full((8, 3), 1e101))
    refused(lambda: read_points(path, 3), r"expected coordinates of at most 1e\+100 in size, found 1e\+101")


# ---------------------------------------------------------------------- other formats


def test_an_obj_index_of_20_digits_is_refused(tmp_path: Path):
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n")
    refused(lambda: read_mesh(tmp_path / "m.obj"), r"m\.obj: line 4: expected `v x y z` or `f a b c`")


@pytest.mark.parametrize("version", [["Infinity", "2", "1"], ["1e300", "2", "1"], ["nan", "2", "1"]])
def test_an_infinite_meshroom_version_is_refused(tmp_path: Path, version: list[str]):
    content = alicevision(CAPTURE) | {"version": version}
    folder = write_scene(CAPTURE, tmp_path, as_json("cameras.sfm", content))
    refused(lambda: load_scene(folder), r"cameras\.sfm: version: expected 3 numbers such as 1\.2\.14")


@pytest.mark.parametrize("root", [7, ["a"], {"a": 1}, None, "a\0b", "\ud800"])
def test_an_openmvg_root_path_that_is_no_path_is_refused(tmp_path: Path, root: Any):
    folder = write_scene(CAPTURE, tmp_path, as_json("sfm_data.json", openmvg(CAPTURE) | {"root_path": root}))
    refused(lambda: load_scene(folder), r"sfm_data\.json: root_path.*: expected")


@pytest.mark.parametrize("size", [10**7, 10**30, 10**400, 1e300])
def test_a_huge_photo_with_a_lens_is_refused(tmp_path: Path, size: float):
    content = openmvg(ForeignCapture(n_points=5, lens=(-0.1, 0.0, 0.0, 0.0, 0.0)))
    pinhole = content["intrinsics"][0]["value"]["ptr_wrapper"]["data"]["value0"]
    folder = write_scene(CAPTURE, tmp_path, as_json("sfm_data.json", content | {}))
    pinhole["width"] = size
    (folder / "sfm_data.json").write_text(json.dumps(content))
    refused(lambda: load_scene(folder), "expected a (photo size of 1 to 1000000 px|positive whole number below 2\\^63)")


def as_json(name: str, content: Any) -> Callable[[ForeignCapture, Path], None]:
    return lambda _, folder: (folder / name).write_text(json.dumps(content)) and None


@pytest.mark.parametrize("number", ["1e308", "-1.7e308", "1e101", "inf", "nan"])
def test_matches_of_implausible_size_are_refused(tmp_path: Path, number: str):
    (tmp_path / "matches.txt").write_text(f"0 0 0 1 1 1\n1 0 {number} 2 1 1\n0 1 0 3 3 3\n")
    refused(lambda: read_matches(tmp_path / "matches.txt", ()), r"matches\.txt: line 2: expected `x y z X Y Z`")


def test_the_largest_matches_register_or_are_refused(tmp_path: Path):
    (tmp_path / "matches.txt").write_text("0 0 0 1 1 1\n1e100 0 0 1e100 1 1\n0 1e100 0 3 1e100 3\n0 0 1e100 0 0 1e99\n")
    views = load_scene(write_scene(CAPTURE, tmp_path / "scene", "scene.json")).views
    matches = read_matches(tmp_path / "matches.txt", views)
    with suppress(InputError):  # anything else fails
        register_matches(matches, views)


# ---------------------------------------------------------------------- implausible numbers


@pytest.mark.parametrize("size", [1e101, 1e155, 1.7e308])
def test_coordinates_whose_products_overflow_are_refused(size: float):
    refused(lambda: Mesh(CUBE_VERTICES * size, CUBE_FACES), r"mesh: expected coordinates of at most 1e\+100")


def test_coordinates_of_any_plausible_unit_are_accepted():
    for size in (1e-9, 1e-3, 1e3, 1e9, 1e30):
        assert Mesh(CUBE_VERTICES * size, CUBE_FACES).diagonal == pytest.approx(size * np.sqrt(12))


def pinhole(focal_length: float) -> np.ndarray:
    return np.array([[focal_length, 0, 47.5], [0, focal_length, 35.5], [0, 0, 1]])


@pytest.mark.parametrize("ratio", [0.0099, 1.1e7, 1e-300, 1e200])
def test_implausible_focal_lengths_are_refused(ratio: float):
    K = pinhole(ratio * WIDTH)
    said = r"expected focal lengths of 0\.01 to 1e\+07 image widths \(96 px\), found"
    refused(lambda: Camera.from_krt(K, np.eye(3), np.zeros(3), WIDTH, HEIGHT), f"camera: {said}")
    refused(lambda: Lens(K, np.array([0.1]), WIDTH, HEIGHT), f"lens: {said}")


@pytest.mark.parametrize("ratio", [0.011, 0.5, 1, 100, 0.9e7])
def test_plausible_focal_lengths_are_accepted(ratio: float):
    assert Camera.from_krt(pinhole(ratio * WIDTH), np.eye(3), np.zeros(3), WIDTH, HEIGHT).K[0, 0] == pytest.approx(
        ratio * WIDTH
    )


def test_a_camera_beyond_the_world_is_refused():
    refused(
        lambda: Camera.from_krt(pinhole(100), np.eye(3), np.array([1e120, 0, 0]), WIDTH, HEIGHT),
        r"camera centre: expected coordinates",
    )


# ---------------------------------------------------------------------- names


@pytest.mark.parametrize("name", ["a\0.png", "a\ud800.png"])
def test_names_that_no_file_can_have_are_refused(tmp_path: Path, name: str):
    write_colmap_capture(tmp_path)
    view = load_scene(tmp_path).views[0]
    refused(lambda: View(name, view.camera, view.photo), "photo .*: expected a name")


@pytest.mark.parametrize("name", ["a\0.png", "a\ud800.png"])
def test_check_refuses_names_it_could_not_write(tmp_path: Path, capsys: pytest.CaptureFixture, name: str):
    folder = write_scene(CAPTURE, tmp_path / "scene", "scene.json")
    content = json.loads((folder / "scene.json").read_text())
    content["views"][1]["name"] = name
    (folder / "scene.json").write_text(json.dumps(content))
    assert run(["check", str(folder), "--out", str(tmp_path / "out")]) == 1
    assert "views[1].name" in capsys.readouterr().err


def test_a_photo_whose_file_name_is_no_utf_8_is_refused(tmp_path: Path):
    folder = write_scene(CAPTURE, tmp_path / "scene", "matrices")
    for old, new in (("images/a.png", b"images/\xff.png"), ("cameras/a.txt", b"cameras/\xff.txt")):
        (folder / old).rename(os.fsdecode(os.fsencode(folder) + b"/" + new))
    refused(lambda: load_scene(folder), "expected a name in valid UTF-8")


# ---------------------------------------------------------------------- bookmarks and sources


BOOKMARKS = {
    "nested": "[" * 100_000,
    "nested inside": '{"bookmarks": [{"moment": ' + "[" * 900 + "]" * 900 + ', "at": "1:1:1:1", "note": ""}]}',
    "infinity": '{"bookmarks": [{"moment": Infinity, "at": "1:1:1:1", "note": ""}]}',
    "huge": '{"bookmarks": [{"moment": 1' + "0" * 5000 + ', "at": "1:1:1:1", "note": ""}]}',
    "negative": '{"bookmarks": [{"moment": -1, "at": "1:1:1:1", "note": ""}]}',
    "note a number": '{"bookmarks": [{"moment": 1, "at": "1:1:1:1", "note": 3}]}',
    "note a surrogate": '{"bookmarks": [{"moment": 1, "at": "1:1:1:1", "note": "\\ud800"}]}',
    "no list": '{"bookmarks": 3}',
    "a list": "[]",
    "no JSON": "bookmarks",
    "bytes": b"\xff\xfe",
}


@pytest.mark.parametrize("what", BOOKMARKS)
def test_damaged_bookmarks_are_refused(tmp_path: Path, what: str):
    path, content = tmp_path / "run.bookmarks.json", BOOKMARKS[what]
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    refused(lambda: read_bookmarks(path, 10), r"run\.bookmarks\.json: ")


def test_a_note_that_utf_8_cannot_hold_is_written_without_it(tmp_path: Path):
    path = tmp_path / "run.bookmarks.json"
    write_bookmarks(path, Bookmarks().added(1, 3, "1:1:1:1", "odd \ud800 edge").items)
    (kept,) = read_bookmarks(path, 10).items
    assert (kept.moment, kept.note) == (3, "odd ? edge")


@pytest.mark.parametrize(
    "source",
    [
        {"scene": "cube", "mesh": 3},
        {"scene": "/a", "photos": 3},
        {"scene": "/a", "photos": {"leave_out": "a"}},
        {"scene": "/a", "photos": {"leave_out": [3]}},
        {"scene": "/a", "photos": {"masks": 3}},
        {"scene": "/a", "photos": {"scale": "half"}},
        {"scene": "/a", "photos": {"format": "pdf"}},
        {"scene": "/a\0"},
        {"scene": "/a", "mesh": "\ud800"},
    ],
)
def test_a_crafted_source_in_a_header_is_refused(source: dict[str, Any]):
    refused(lambda: SceneSource.of_run({"source": source}, Path("run.trace")), r"run\.trace: .*expected")


def test_the_chosen_format_is_found_again_in_a_run(tmp_path: Path):
    write_colmap_capture(tmp_path)
    from fairing.io import PhotoChoice

    source = SceneSource.typed(str(tmp_path), None, PhotoChoice(format="colmap", leave_out=("a.png",)))
    header: dict[str, Any] = {}
    source.note_in(header)
    assert SceneSource.of_run(json.loads(json.dumps(header)), Path("run.trace")) == source


# ---------------------------------------------------------------------- part files


def dead_process() -> int:
    """The id of a process that has ended."""
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    return child.pid


def test_part_files_of_killed_runs_are_removed_by_the_next_run(tmp_path: Path):
    prepare_output_folder(tmp_path / "out")
    dead, ours = dead_process(), os.getppid()
    (tmp_path / "out" / "sparse").mkdir()
    left_over = [
        f".mesh.ply.{dead}.part",
        f".run.trace.{dead}.part",
        "run.trace.part",
        f"sparse/.images.txt.{dead}.part",
    ]
    others = [f".mesh.ply.{ours}.part", "film.part", ".mesh.ply.part", "mesh.ply.1.part", "mesh.ply"]
    for name in (*left_over, *others):
        (tmp_path / "out" / name).write_text("half")
    prepare_output_folder(tmp_path / "out")
    assert sorted(path.name for path in (tmp_path / "out").rglob("*") if path.is_file()) == sorted(
        [*others, ".eigenfairing"]
    )


def test_part_files_in_a_folder_that_is_not_ours_stay(tmp_path: Path):
    part = tmp_path / f".mesh.ply.{dead_process()}.part"
    part.write_text("half")
    refused(lambda: prepare_output_folder(tmp_path), "expected an empty or new folder")
    assert part.exists()


def test_writing_a_file_removes_what_killed_runs_left_of_it_and_nothing_else(tmp_path: Path):
    dead = dead_process()
    for name in (f".mesh.ply.{dead}.part", f".other.ply.{dead}.part"):
        (tmp_path / name).write_text("half")
    write_mesh(tmp_path / "mesh.ply", CUBE_VERTICES, CUBE_FACES)
    assert sorted(path.name for path in tmp_path.iterdir()) == [f".other.ply.{dead}.part", "mesh.ply"]


def test_a_failed_write_leaves_no_part_file(tmp_path: Path):
    def fail(_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    refused(lambda: write_atomically(tmp_path / "a.txt", fail), r"a\.txt: could not be written \(No space left")
    assert list(tmp_path.iterdir()) == []

"""`--points`: the sparse points of a scene, given with the capture or found in its photos."""

import io
import json
import shutil
import signal
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from rich.console import Console

from app.cli.loading import SHOW_EVERY, load_with_bar
from app.cli.main import run
from app.files.scene_source import SceneSource
from demo_scenes import load_demo, photography
from fairing.camera import Camera
from fairing.features import find_points
from fairing.io import feature_points, read_capture, write_mesh
from fairing.io.convert import write_capture
from fairing.io.points_choice import are_enough
from fairing.io.scene_points import with_points
from fairing.mesh import Mesh
from fairing.photo import ArrayPhoto
from fairing.run.session import Session
from fairing.scene import PointsChoice, Scene, SparsePoints, View
from fairing.trace import Trace
from tests.speckled_corner import distance_to_surface, views

QUICK = (
    *("--schedule.blur", "1.2"),
    *("--schedule.max-sweeps", "1", "--schedule.max-iterations", "1"),
)
CORNER = Mesh(
    np.array([[1.0, 1, 1], [0, 1, 1], [0, 0, 1], [1, 0, 1], [1, 0, 0], [1, 1, 0], [0, 1, 0]]),
    np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 5, 6], [0, 6, 1]]),
)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("EIGENFAIRING_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def given(count: int) -> SparsePoints:
    """Points on a side of the cube, as the first three photos show them."""
    positions = np.column_stack([np.random.default_rng(7).uniform(0, 1, (count, 2)), np.ones(count)])
    seen = [np.column_stack([np.arange(count), np.full(count, v)]) for v in range(3)]
    pixels = [views()[v].camera.project(positions)[0] for v in range(3)]
    return SparsePoints(positions, np.zeros((count, 3), np.uint8), np.concatenate(seen), np.concatenate(pixels))


def matrices_capture(folder: Path) -> Path:
    """Plain 3x4 matrices beside the photos: no points, no mesh."""
    write_capture(folder / "written", "colmap", views())
    shutil.move(folder / "written" / "images", folder / "images")
    shutil.rmtree(folder / "written")
    for view in views():
        np.savetxt(folder / f"{Path(view.name).stem}.txt", view.camera.image_from_world, fmt="%.17g")
    return folder


def capture(folder: Path, points: SparsePoints | None = None, mesh: Mesh | None = None, of: tuple = ()) -> Path:
    write_capture(folder, "colmap", of or views(), points, None if mesh is None else (mesh.vertices, mesh.faces))
    return folder


def scene_of_run(folder: str, choice: PointsChoice = "automatic") -> Scene:
    """The scene of a run of the capture, which has the chosen points."""
    return with_points(SceneSource.typed(folder, None, points=choice).load())


def files_of(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


@pytest.mark.parametrize(
    ("n_points", "n_vertices", "enough"),
    [(499, None, False), (500, None, True), (20, 7, False), (21, 7, True), (0, 1, False)],
)
def test_given_points_are_enough_by_the_vertices_of_the_mesh(n_points, n_vertices, enough):
    assert are_enough(n_points, n_vertices) == enough


def test_a_choice_gives_its_points(tmp_path):
    few = given(12)
    folder = str(capture(tmp_path / "capture", few, CORNER))
    found = find_points(read_capture(folder).views)

    def loaded(choice) -> SparsePoints | None:
        return scene_of_run(folder, choice).sparse_points

    own, both, kept = loaded("own"), loaded("both"), loaded("given")
    assert own is not None
    assert both is not None
    assert kept is not None
    assert loaded("none") is None
    np.testing.assert_array_equal(own.positions, found.positions)
    assert (own.origin, both.origin, kept.origin) == ("own", "both", "given")
    np.testing.assert_allclose(kept.positions, few.positions)
    np.testing.assert_array_equal(both.positions, np.concatenate([kept.positions, own.positions]))
    error = np.linalg.norm(
        np.array([views()[v].camera.project(both.positions[[p]])[0][0] for p, v in both.observations]) - both.pixels,
        axis=1,
    )
    assert error.max() < 1.5


def test_automatic_replaces_points_that_are_not_enough(tmp_path):
    for count, origin in ((12, "own"), (30, "given")):
        folder = capture(tmp_path / str(count), given(count), CORNER)
        scene = scene_of_run(str(folder))
        assert scene.sparse_points is not None
        assert scene.sparse_points.origin == origin
        assert any("found in the photos" in line for line in scene.warnings) == (origin == "own")


def test_photos_without_texture_leave_the_given_points(tmp_path):
    blank = tuple(replace(view, photo=replace_pixels(view)) for view in views())
    folder = str(capture(tmp_path / "capture", given(12), CORNER, blank))
    scene = scene_of_run(folder)
    assert scene.sparse_points is not None
    assert len(scene.sparse_points.positions) == 12
    assert any("no points were found in the photos: the photos show no keypoints" in line for line in scene.warnings)
    assert scene_of_run(folder, "own").sparse_points is None


def replace_pixels(view: View):
    return ArrayPhoto(np.full_like(view.photo.load(), 100))


def test_a_demo_keeps_its_points_unless_its_own_are_chosen(monkeypatch, tmp_path):
    folder = capture(tmp_path / "capture", given(12), CORNER)
    demo = replace(SceneSource.typed(str(folder), None).load(), points_choice="given")
    monkeypatch.setattr("app.files.scene_source.load_named", lambda *_, **__: demo)
    assert with_points(SceneSource.typed("cube", None, points="automatic").load()).sparse_points is demo.sparse_points
    own = with_points(SceneSource.typed("cube", None, points="own").load()).sparse_points
    assert own is not None
    assert own.origin == "own"


def test_runs_of_demos_with_points_or_few_faces_do_not_search(monkeypatch):
    monkeypatch.setattr(photography, "cached_photos", lambda scene, options, shape, make: np.zeros(shape, np.uint8))
    choices = {name: load_demo(name).points_choice for name in ("cube", "archway", "dome", "facade")}
    assert choices == {"cube": "given", "archway": "given", "dome": "given", "facade": "automatic"}


def test_photos_and_cameras_alone_become_a_mesh(tmp_path, capsys):
    folder = matrices_capture(tmp_path / "plain")
    before = files_of(folder)
    assert run(["triangulate", str(folder), "--out", str(tmp_path / "start.ply"), "--spacing", "20"]) == 0
    assert "points were found in the photos; the capture has no sparse points" in capsys.readouterr().err
    mesh = trimesh.load_mesh(tmp_path / "start.ply")
    assert len(mesh.faces) > 20
    assert np.median(distance_to_surface(np.asarray(mesh.vertices))) < 0.005
    assert files_of(folder) == before
    assert run(["triangulate", str(folder), "--out", str(tmp_path / "none.ply"), "--points", "none"]) == 1
    assert "expected sparse points to triangulate" in capsys.readouterr().err
    assert run(["fair", str(folder), "--out", str(tmp_path / "none"), "--points", "none"]) == 1
    assert "expected a mesh" in capsys.readouterr().err


def test_a_run_records_its_points_and_opens_with_them(tmp_path, monkeypatch):
    folder, out = matrices_capture(tmp_path / "plain"), tmp_path / "run"
    write_mesh(folder / "start.ply", CORNER.vertices, CORNER.faces)
    assert run(["fair", str(folder), "--out", str(out), *QUICK]) == 0
    trace = Trace.load(out / "run.trace")
    assert trace.header["source"]["points"] == "own"
    recorded = SceneSource.of_run(trace.header, out / "run.trace")
    shutil.rmtree(tmp_path / "cache")
    monkeypatch.setattr(feature_points, "find_points", lambda *_: pytest.fail("points are found again"))
    scene = recorded.load()
    Session(scene, trace=trace).choose_inputs()
    assert scene.sparse_points is not None
    assert scene.sparse_points.origin == "own"
    moved = tmp_path / "moved"
    shutil.move(folder, moved)
    replayed = SceneSource.of_replay(trace.header, out / "run.trace", str(moved), None, recorded.choice)
    Session(replayed.load(), trace=trace)
    shutil.move(moved, folder)
    assert run(["fair", str(folder), "--out", str(out), "--resume", *QUICK]) == 0


def test_a_run_without_the_note_has_the_given_points(tmp_path):
    folder = capture(tmp_path / "capture", given(12), CORNER)
    header = {"source": {"scene": str(folder), "mesh": None}}
    points = SceneSource.of_run(json.loads(json.dumps(header)), tmp_path / "run.trace").load().sparse_points
    assert points is not None
    assert points.origin == "given"


def test_points_are_found_once(tmp_path, cache, monkeypatch):
    folder = str(capture(tmp_path / "capture", None, CORNER))
    first = scene_of_run(folder).sparse_points
    assert len(list(cache.glob("points/*.npz"))) == 1
    monkeypatch.setattr(feature_points, "find_points", lambda *_: pytest.fail("points are found again"))
    second = scene_of_run(folder).sparse_points
    assert first is not None
    assert second is not None
    np.testing.assert_array_equal(first.positions, second.positions)


def test_a_cache_that_cannot_be_written_is_no_error(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("EIGENFAIRING_CACHE", str(tmp_path / "file"))
    folder = str(capture(tmp_path / "capture", None, CORNER))
    assert scene_of_run(folder, "own").sparse_points is not None


@pytest.mark.slow
def test_ctrl_c_while_points_are_found_is_one_line(tmp_path, monkeypatch, capsys):
    lines = []

    def interrupt(done: int, n_photos: int) -> str:
        lines.append(done)
        if done > 0:
            signal.raise_signal(signal.SIGINT)
        return "finding points"

    monkeypatch.setattr("fairing.io.scene_points.progress_line", interrupt)
    folder = str(matrices_capture(tmp_path / "plain"))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a process in the background may ignore it
    try:
        assert run(["fair", folder, "--cameras", "given", "--out", str(tmp_path / "run")]) == 130
    finally:
        signal.signal(signal.SIGINT, before)
    assert capsys.readouterr().err == "eigenfairing: cancelled\n"
    assert max(lines) < 8 * len(views())
    assert not (tmp_path / "run").exists()


def test_progress_names_the_photo(tmp_path):
    shown: list[tuple[float, str]] = []
    folder = str(capture(tmp_path / "capture", None, CORNER))
    with_points(
        SceneSource.typed(folder, None, points="own").load(), lambda fraction, line: shown.append((fraction, line))
    )
    assert shown[0] == (0, f"finding points: photo 1 of {len(views())}")
    assert shown[1][1] == f"finding points: photo 2 of {len(views())}"
    assert shown[-1][1] == "finding points: matching photos"
    fractions = [fraction for fraction, _ in shown]
    assert fractions == sorted(fractions)


@pytest.mark.slow
def test_check_judges_cameras_by_the_points_of_the_photos(tmp_path, capsys):
    for pixels, is_wrong in ((0.0, False), (2.0, True), (8.0, True)):
        folder = tmp_path / f"off{pixels:.0f}"
        capture(folder, None, CORNER, tuple(moved(view, pixels * (v == 2)) for v, view in enumerate(views())))
        out = tmp_path / f"check{pixels:.0f}"
        run(["check", str(folder), "--out", str(out)])
        capsys.readouterr()
        found = json.loads((out / "check.json").read_text())
        assert found["points"] == "own"
        blamed = [
            hint
            for hint in found["hints"]
            if hint.startswith(f"photo images/{views()[2].name}") or hint.startswith(f"photo {views()[2].name}")
        ]
        assert bool(blamed) == is_wrong
        assert found["views"][0]["reprojection"] < 0.3


def moved(view: View, pixels: float) -> View:
    """The view with a principal point that is wrong by so many pixels."""
    shift = np.array([[1, 0, 0.8 * pixels], [0, 1, 0.6 * pixels], [0, 0, 1]])
    return replace(view, camera=Camera(shift @ view.camera.image_from_world, view.camera.width, view.camera.height))


def test_the_page_shows_the_line_and_the_time_left():
    lines, fractions = [], []

    def show(line: str, fraction: float) -> None:
        lines.append(line)
        fractions.append(fraction)

    def load(progress) -> str:
        for done in range(1, 4):
            progress(done / 4, f"finding points: photo {done} of 4")
            time.sleep(1.1 * SHOW_EVERY)
        return "scene"

    assert load_with_bar("corner", load, Console(file=io.StringIO()), show) == "scene"
    assert [line.partition(";")[0] for line in lines] == [f"finding points: photo {done} of 4" for done in (1, 2, 3)]
    assert lines[-1].endswith(" s left")
    assert fractions == [0.25, 0.5, 0.75]


def test_the_time_left_is_that_of_the_present_work():
    lines = []

    def load(progress):
        for line, count in (("photo", 2), ("finding points", 20)):
            for done in range(1, min(count, 4) + 1):
                progress(done / count, f"{line} {done} of {count}")
                time.sleep(1.1 * SHOW_EVERY)

    load_with_bar("corner", load, Console(file=io.StringIO()), lambda line, fraction: lines.append(line))
    assert lines[-1].startswith("finding points 4 of 20; ")
    assert not lines[-1].endswith("; 0 s left")

"""A run from Python and the command's run of the same capture end at the same bytes, with points found in the photos."""

import json
import subprocess
import sys
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import pytest

from app.files.scene_source import SceneSource
from demo_scenes.building.scene import scene_of_plan
from fairing import Session, StepRecord, Trace, fair, load_scene, read_mesh
from fairing.errors import Cancelled
from fairing.io import feature_points
from fairing.io.convert import write_capture
from fairing.options import PRESETS
from fairing.scene import Scene
from tests.family import errors_of
from tests.small_building import small_building

QUICK = PRESETS["accurate"].with_levels(blur=2.0, max_sweeps=1)


@dataclass(frozen=True)
class Files:
    """A building as files: photos and cameras without sparse points, and a mesh beside them."""

    scene: Scene
    capture: Path
    mesh: Path
    out: Path


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    folder = tmp_path_factory.mktemp("building")
    scene = scene_of_plan("building small", small_building())
    mesh = scene.unweld(scene.mesh.vertices), scene.original_faces
    write_capture(folder / "capture", "colmap", scene.views, None, mesh)
    (folder / "capture" / "mesh.ply").rename(folder / "start.ply")
    return Files(scene, folder / "capture", folder / "start.ply", folder / "run")


@pytest.fixture(scope="module")
def session(files: Files) -> Session:
    return fair(load_scene(files.capture, mesh=files.mesh))


@pytest.fixture(scope="module")
def trace(files: Files, session: Session) -> Trace:
    command = [sys.executable, "-m", "app", "fair", str(files.capture), "--mesh", str(files.mesh), "--out"]
    done = subprocess.run([*command, str(files.out)], capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    return Trace.load(files.out / "run.trace")


@pytest.mark.slow
def test_python_and_the_command_end_at_the_same_bytes(files: Files, session: Session, trace: Trace):
    assert session.scene.sparse_points is not None
    assert session.scene.sparse_points.origin == "own"
    assert session.vertices.tobytes() == trace.vertices_at(len(trace)).tobytes()
    assert np.array_equal(read_mesh(files.out / "mesh.ply")[0], session.scene.unweld(session.vertices))
    assert session.plan == trace.plan
    headers = ({**run.header, "source": None} for run in (session.trace, trace))
    assert len({json.dumps(header) for header in headers}) == 1
    assert len(trace) == len(session.trace) > 10
    for ours, theirs in zip(session.trace.steps, trace.steps, strict=True):
        for field in fields(StepRecord):
            here, there = (np.asarray(getattr(record, field.name)) for record in (ours, theirs))
            assert here.tobytes() == there.tobytes(), field.name


@pytest.mark.slow
def test_points_found_in_the_photos_matter_on_this_building(files: Files, session: Session):
    given = fair(load_scene(files.capture, mesh=files.mesh, points="given"))
    assert given.scene.sparse_points is None
    ours, theirs = (errors_of(files.scene, run.vertices) for run in (session, given))
    # Measured: 0.028 and 0.053 % of the diagonal.
    assert ours["median"] < 0.75 * theirs["median"], (ours, theirs)


@pytest.mark.slow
def test_a_scene_built_by_hand_gets_the_points_when_it_is_faired(files: Files, session: Session):
    read = load_scene(files.capture, mesh=files.mesh)
    by_hand = Session(Scene.build("mine", read.mesh.vertices, read.mesh.faces, read.views), QUICK)
    assert by_hand.scene.sparse_points is None
    assert by_hand.trace.header["sparse_points"] is None
    assert by_hand.branch().step() is not None
    by_hand.step()
    assert by_hand.scene.sparse_points is not None
    assert session.scene.sparse_points is not None
    assert np.array_equal(by_hand.scene.sparse_points.positions, session.scene.sparse_points.positions)
    assert by_hand.trace.header["sparse_points"] == session.trace.header["sparse_points"]


@pytest.mark.slow
def test_a_record_made_in_python_is_the_same_bytes_whenever_it_is_attached(files: Files, tmp_path: Path):
    first, later = (Session(load_scene(files.capture, mesh=files.mesh), QUICK) for _ in range(2))
    first.trace.attach(tmp_path / "first.trace")
    first.run()
    first.trace.detach()
    later.run()
    later.trace.attach(tmp_path / "later.trace")
    later.trace.detach()
    assert (tmp_path / "first.trace").read_bytes() == (tmp_path / "later.trace").read_bytes()
    # It is opened again with the scene as it is read from the files, and with a scene that has the points already.
    for scene in (load_scene(files.capture, mesh=files.mesh), first.scene):
        again = Session(scene, trace=Trace.load(tmp_path / "first.trace"))
        again.go_to(1)
        branch = again.branch()
        branch.step()
        assert np.array_equal(branch.vertices, first.trace.vertices_at(2))


@pytest.mark.slow
def test_a_run_of_the_command_is_continued_in_python(files: Files, trace: Trace, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(feature_points, "find_points", lambda *_: pytest.fail("points are found again"))
    monkeypatch.setenv("EIGENFAIRING_CACHE", str(files.out / "none"))
    recorded = files.out / "run.points.npz"
    scene = load_scene(files.capture, mesh=files.mesh, points_file=recorded)
    again = Session(scene, trace=trace.cut(3)).branch()
    again.step()
    assert np.array_equal(again.vertices, trace.vertices_at(4))
    assert SceneSource.of_run(trace.header, files.out / "run.trace").points == "own"


@pytest.mark.slow
def test_the_search_is_cancelled_reports_its_progress_and_can_be_skipped(
    files: Files, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("EIGENFAIRING_CACHE", str(tmp_path))
    session = Session(load_scene(files.capture, mesh=files.mesh), QUICK)
    session.cancel_requested = lambda: True
    with pytest.raises(Cancelled):
        session.step()
    assert session.scene.sparse_points is None
    assert session.plan is None
    session.cancel_requested = lambda: False
    skipped = session.branch()
    shown: list[tuple[float, str, str]] = []

    def show(fraction: float, line: str) -> None:
        shown.append((fraction, line, session.work.current[0].text))

    session.choose_inputs(show)
    assert shown[0][1] == f"refining cameras: keypoints of {len(files.scene.views)} photos"
    assert all(line == text for _, line, text in shown)
    assert [fraction for fraction, *_ in shown] == sorted(fraction for fraction, *_ in shown)
    assert session.scene.sparse_points is not None
    (tmp_path / "points").rename(tmp_path / "elsewhere")
    skipped.choose_inputs(skip_requested=lambda: True)
    assert skipped.scene.sparse_points is None
    assert any("no points were looked for in the photos, on request" in line for line in skipped.warnings)


@pytest.mark.slow
def test_photos_and_cameras_alone_are_triangulated_in_python_as_by_the_command(files: Files):
    ours, theirs = load_scene(files.capture), SceneSource.typed(str(files.capture), None, points="automatic").load()
    assert ours.triangulated
    assert ours.mesh.vertices.tobytes() == theirs.mesh.vertices.tobytes()
    assert ours.sparse_points is not None
    assert ours.sparse_points.origin == "own"
    assert ours.points_choice == "given"

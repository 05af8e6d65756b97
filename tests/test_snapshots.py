"""Meshes of another program as the moments of a run."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import app.cli.main
from app.files.mesh_series import open_series
from app.files.recorded_run import find_run
from demo_scenes import load_demo
from fairing import InputError, Mesh, PhotoChoice, Session, read_mesh, session_of_meshes
from fairing.judge.comparable_residual import ComparableResidual
from fairing.run.snapshots import positions_on
from fairing.stage_kind import StageKind
from fairing.trace import Trace
from tests.two_levels import two_levels


@pytest.fixture(scope="module")
def run() -> Session:
    session = Session(load_demo("cube"), two_levels("joint", sweeps=2, iterations=3))
    session.run()
    return session


@pytest.fixture(scope="module")
def states(run: Session) -> list[np.ndarray]:
    return [run.trace.vertices_at(moment) for moment in (0, 2, len(run.trace))]


def mesh_files(run: Session, states: list[np.ndarray], folder: Path) -> list[Path]:
    """The states as files, with the vertices and faces of the input."""
    files = []
    for number, state in enumerate(states):
        mesh = trimesh.Trimesh(run.scene.unweld(state), run.scene.original_faces, process=False)
        files.append(folder / f"step_{number}.ply")
        mesh.export(files[-1])
    return files


def distances(points: np.ndarray, surface: trimesh.Trimesh) -> np.ndarray:
    """Distances of points from a surface, triangle by triangle."""
    triangles = surface.triangles
    closest = [trimesh.triangles.closest_point(triangles, np.tile(point, (len(triangles), 1))) for point in points]
    return np.array([np.linalg.norm(found - point, axis=1).min() for found, point in zip(closest, points, strict=True)])


def test_moments_are_the_meshes_and_their_residual_is_that_of_the_run(run: Session, states: list[np.ndarray]):
    scene = run.scene
    session = session_of_meshes(scene, [Mesh(scene.unweld(state), scene.original_faces) for state in states])
    for moment, state in enumerate(states):
        assert np.array_equal(session.trace.vertices_at(moment), state)
    measured = [ComparableResidual(each).measure(states[-1]).mean for each in (run, session)]
    assert measured[0] == pytest.approx(measured[1], rel=1e-12)
    assert {record.stage for record in session.trace.steps} == {StageKind.SNAPSHOT}
    assert session.position.level == session.options.n_levels - 1, "the photos at their sharpest see them"


def test_a_run_goes_on_from_the_last_mesh_and_another_branches_from_an_earlier_one(
    run: Session, states: list[np.ndarray]
):
    session = session_of_meshes(run.scene, [run.scene.mesh.moved(state) for state in (states[-1], states[0])])
    pulls = session.pulls()
    assert np.abs(sum(pull.step for pull in pulls)).max() > 0, "the start is not where the photos want it"
    session.go_to(0)
    branch = session.branch()
    record = branch.step()
    assert record is not None
    assert record.stage is StageKind.PHOTOS
    assert np.array_equal(record.applied_to(states[-1])[record.vertices], record.after)


def test_folded_faces_of_another_program_are_shown_as_they_are(run: Session, states: list[np.ndarray]):
    folded = states[0].copy()
    face = run.scene.mesh.faces[0]
    folded[face[0]] = folded[face[1:]].mean(axis=0)  # no area
    session = session_of_meshes(run.scene, [run.scene.mesh.moved(state) for state in (states[0], folded)])
    assert np.array_equal(session.vertices, folded)
    with pytest.raises(InputError, match="would be turned over or collapsed"):
        Session(run.scene).place(face[:1], folded[face[:1]])


def test_a_mesh_with_other_faces_moves_the_vertices_to_its_surface(run: Session, states: list[np.ndarray]):
    fine = trimesh.Trimesh(states[-1], run.scene.mesh.faces, process=False).subdivide()
    positions, farthest = positions_on(run.scene, Mesh(fine.vertices, fine.faces))
    assert distances(positions, fine).max() < 1e-9 * run.scene.mesh.diagonal
    assert farthest == pytest.approx(distances(run.scene.mesh.vertices, fine).max(), rel=1e-6)
    session = session_of_meshes(run.scene, [run.scene.mesh, Mesh(fine.vertices, fine.faces)])
    assert any("closest points of each mesh" in warning for warning in session.scene.warnings)


def test_what_cannot_be_shown_is_one_line(run: Session, states: list[np.ndarray]):
    scene = run.scene
    with pytest.raises(InputError, match="at least two, found 1"):
        session_of_meshes(scene, [scene.mesh])
    camera = scene.views[0].camera
    behind = states[0] + 3 * (camera.center - states[0].mean(axis=0))
    with pytest.raises(InputError, match=r"mesh 2: .* behind a camera"):
        session_of_meshes(scene, [scene.mesh, scene.mesh.moved(behind)])


def test_the_command_reads_files_in_their_order_and_its_record_is_replayed(
    run: Session, states: list[np.ndarray], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    files, record, opened = mesh_files(run, states, tmp_path), tmp_path / "meshes.trace", []
    monkeypatch.setattr(app.cli.main, "_serve", lambda open_run, page, **how: opened.append((open_run, how)) or 0)
    words = [*map(str, files)]
    assert app.cli.main.run(["replay", "--save-to", str(record), "--meshes", *words, "cube"]) == 0
    assert app.cli.main.run(["replay", "cube", "--meshes", *words, "--at", "end"]) == 0
    assert {how["title"] for _, how in opened} == {"cube"}
    sessions = [open_run(app.cli.main.OpeningProgress()) for open_run, _ in opened]
    assert [session.moment for session in sessions] == [0, 2]
    for session in sessions:
        for moment, file in enumerate(files):
            assert np.array_equal(run.scene.unweld(session.trace.vertices_at(moment)), read_mesh(file)[0])
    session = sessions[0]
    session.trace.attach(record)
    session.trace.detach()
    trace, source, _ = find_run(record, None, None, PhotoChoice())
    assert source.scene == "cube"
    assert np.array_equal(Session(source.load(), trace=trace).vertices, session.trace.vertices_at(2))
    assert Trace.load(record).steps[0].stage is StageKind.SNAPSHOT


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--meshes", "only.ply", "cube"], "expected at least two mesh files"),
        (["--meshes", "a.ply", "b.ply", "cube"], "a.ply"),
        (["cube", "--save-to", "x.trace"], "--save-to x.trace without --meshes"),
        ([], "expected RUN, or --meshes"),
    ],
)
def test_wrong_words_are_one_line(words: list[str], message: str, capsys: pytest.CaptureFixture[str]):
    assert app.cli.main.run(["replay", *words]) == 1
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_a_capture_shows_the_faces_of_the_last_file_or_of_the_one_chosen(tmp_path: Path):
    files = [tmp_path / name for name in ("a.ply", "b.ply")]
    for file in files:
        trimesh.creation.box().export(file)
    assert open_series(str(tmp_path), files, None, PhotoChoice()).source.mesh == str(files[1])
    assert open_series(str(tmp_path), files, files[0], PhotoChoice()).source.mesh == str(files[0])

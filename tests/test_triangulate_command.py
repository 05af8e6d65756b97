"""`eigenfairing triangulate`, and what the other commands do with a capture that has points but no mesh."""

import json
import signal
from typing import Any

import numpy as np
import pytest

from app.cli import triangulate as triangulate_command
from app.cli.main import run
from app.files.scene_source import SceneSource
from fairing.io import prepare_output_folder, read_mesh, write_mesh
from fairing.io.convert import write_capture
from fairing.run.session import Session
from fairing.trace import Trace
from fairing.triangulation import FlipTrace
from tests.terrain_scene import seen_points, terrain

QUICK = (
    "--schedule.blur",
    "1.2",
    "--schedule.max-sweeps",
    "1",
    "--schedule.max-iterations",
    "1",
)


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """A folder with photos, cameras and sparse points."""
    folder = tmp_path_factory.mktemp("captures") / "terrain"
    vertices, views = terrain()
    prepare_output_folder(folder)
    write_capture(folder, "colmap", views, seen_points(vertices, views=views), None)
    return folder


def test_points_become_a_mesh_with_a_record_and_a_report(capture, tmp_path, capsys):
    out = tmp_path / "start.ply"
    assert run(["triangulate", str(capture), "--out", str(out), "--points", "given"]) == 0
    vertices, faces = read_mesh(out)
    trace = FlipTrace.load(tmp_path / "start.flips")
    report = json.loads((tmp_path / "start.report.json").read_text())
    assert np.array_equal(trace.vertices, vertices)
    assert np.array_equal(trace.faces_at(len(trace)), faces)
    assert SceneSource.of_run(trace.header, tmp_path).scene == str(capture)
    assert report["flips"] == len(trace) > 0
    assert report["energy"]["after"] < report["energy"]["before"]
    assert report["inconsistent_edges"]["after"] < report["inconsistent_edges"]["before"]
    assert report["points"] + sum(report["points_left_out"].values()) == 25
    said = " ".join(capsys.readouterr().err.split())
    assert f"{report['points']} points gave a surface of {len(vertices)} vertices" in said
    assert "no further flip lowers the energy" in said

    assert run(["triangulate", str(capture), "--out", str(out), "--max-vertices", "14"]) == 0
    assert len(read_mesh(out)[0]) <= 14  # its own earlier result may be replaced


def test_nothing_of_others_is_overwritten(capture, tmp_path, capsys):
    out = tmp_path / "mine.ply"
    out.write_bytes(b"precious")
    assert run(["triangulate", str(capture), "--out", str(out)]) == 1
    assert out.read_bytes() == b"precious"
    assert "mine.ply exists and is not of an earlier triangulation" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.ply"]


@pytest.mark.parametrize(
    ("out", "words"),
    [("start.stl", "found .stl"), ("nowhere/start.ply", "found none; create")],
    ids=["suffix", "folder"],
)
def test_an_output_that_cannot_be_is_one_line(capture, tmp_path, capsys, out, words):
    assert run(["triangulate", str(capture), "--out", str(tmp_path / out)]) == 1
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


def test_without_points_one_line_gives_the_reason(tmp_path, capsys):
    vertices, views = terrain()
    prepare_output_folder(tmp_path / "bare")
    write_capture(tmp_path / "bare", "colmap", views, None, None)
    bare, given = str(tmp_path / "bare"), ["--points", "given"]
    assert run(["triangulate", bare, "--out", str(tmp_path / "m.ply"), *given]) == 1
    assert "expected sparse points to triangulate, found none" in capsys.readouterr().err
    assert run(["fair", bare, "--out", str(tmp_path / "run"), *given]) == 1
    assert "expected a mesh" in capsys.readouterr().err
    two = seen_points(vertices[:2], views=views)
    prepare_output_folder(tmp_path / "two")
    write_capture(tmp_path / "two", "colmap", views, two, None)
    assert run(["triangulate", str(tmp_path / "two"), "--out", str(tmp_path / "m.ply"), *given]) == 1
    assert "at least 3 sparse points, found 2" in capsys.readouterr().err
    assert not (tmp_path / "m.ply").exists()


def test_ctrl_c_keeps_the_mesh_as_it_was_by_then(capture, tmp_path, monkeypatch):
    real: Any = triangulate_command.triangulate

    def interrupted(*arguments):
        *others, show = arguments

        def show_and_interrupt(part, line):
            show(part, line)
            if "flips" in line and not line.startswith("0 flips"):
                signal.raise_signal(signal.SIGINT)

        return real(*others, show_and_interrupt)

    monkeypatch.setattr(triangulate_command, "triangulate", interrupted)
    assert run(["triangulate", str(capture), "--out", str(tmp_path / "m.ply")]) == 130
    trace = FlipTrace.load(tmp_path / "m.flips")
    assert np.array_equal(read_mesh(tmp_path / "m.ply")[1], trace.faces_at(len(trace)))
    assert json.loads((tmp_path / "m.report.json").read_text())["stop_reason"] == "stopped on request"


def test_a_capture_without_a_mesh_is_triangulated_and_faired(capture, tmp_path, capsys):
    assert run(["triangulate", str(capture), "--out", str(tmp_path / "start.ply")]) == 0
    out = tmp_path / "run"
    assert run(["fair", str(capture), "--out", str(out), *QUICK]) == 0
    assert (out / "start.ply").read_bytes() == (tmp_path / "start.ply").read_bytes()
    assert np.array_equal(read_mesh(out / "mesh.ply")[1], read_mesh(out / "start.ply")[1])
    assert "no mesh was given" in capsys.readouterr().err
    assert any("no mesh was given" in line for line in json.loads((out / "report.json").read_text())["warnings"])
    trace = Trace.load(out / "run.trace")
    source = SceneSource.of_run(trace.header, out)
    assert source.mesh == str(out / "start.ply")
    Session(source.load(), trace=trace)
    assert run(["fair", str(capture), "--out", str(out), "--resume", *QUICK]) == 0


def test_the_edges_of_a_given_mesh_are_flipped(capture, tmp_path):
    assert run(["triangulate", str(capture), "--out", str(tmp_path / "one.ply"), "--max-vertices", "12"]) == 0
    given = tmp_path / "given.ply"
    trace = FlipTrace.load(tmp_path / "one.flips")
    write_mesh(given, trace.vertices, trace.faces_at(0))
    assert run(["triangulate", str(capture), "--mesh", str(given), "--out", str(tmp_path / "two.ply")]) == 0
    assert (tmp_path / "two.ply").read_bytes() == (tmp_path / "one.ply").read_bytes()

"""`eigenfairing points`."""

import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from app.cli import points as points_command
from app.cli.main import run
from fairing.features import find_points
from fairing.io import read_capture
from fairing.io.convert import write_capture
from fairing.io.feature_points import load_points
from fairing.photo import ArrayPhoto
from tests.speckled_corner import HEIGHT, WIDTH, views


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    write_capture(tmp_path / "capture", "colmap", views())
    return tmp_path / "capture"


def test_points_are_written_as_a_capture_and_a_cloud(capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture):
    out = tmp_path / "out"
    assert run(["points", str(capture), "--out", str(out)]) == 0
    expected = find_points(read_capture(capture).views)
    sparse = read_capture(out).sparse_points
    assert sparse is not None
    np.testing.assert_array_equal(sparse.positions, expected.positions)
    assert len(sparse.observations) == len(expected.photos)
    cloud = trimesh.load(out / "points.ply")
    assert isinstance(cloud, trimesh.PointCloud)
    np.testing.assert_array_equal(cloud.vertices, expected.positions)
    np.testing.assert_array_equal(load_points(out / "points.npz")[0].covariance, expected.covariance)
    said = " ".join(capsys.readouterr().err.split())
    assert f"{len(expected)} points from {len(views())} photos" in said
    assert f"mean residual {expected.residual.mean():.2f} px" in said
    before = {path.name: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    assert run(["points", str(capture), "--out", str(out)]) == 0
    assert {path.name: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def test_ctrl_c_writes_nothing(
    capture: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
):
    real = points_command.find_points_once

    def interrupted(views, path, on_progress, cancel_requested, found):
        def show(done: int, count: int) -> None:
            on_progress(done, count)
            if done > 0:
                signal.raise_signal(signal.SIGINT)

        return real(views, path, on_progress=show, cancel_requested=cancel_requested)  # `found` needs no search

    monkeypatch.setattr(points_command, "find_points_once", interrupted)
    assert run(["points", str(capture), "--out", str(tmp_path / "out")]) == 130
    assert "cancelled" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_without_points_one_line_gives_the_reason(tmp_path: Path, capsys: pytest.CaptureFixture):
    blank = ArrayPhoto(np.full((HEIGHT, WIDTH, 3), 100, np.uint8))
    same = tuple(replace(view, photo=blank) for view in views())
    write_capture(tmp_path / "capture", "colmap", same)
    assert run(["points", str(tmp_path / "capture"), "--out", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().err
    assert "no points found" in said
    assert "no texture" in said
    assert not (tmp_path / "out" / "points.ply").exists()


def test_a_folder_with_other_content_is_refused(capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    assert run(["points", str(capture), "--out", str(tmp_path / "mine")]) == 1
    assert "expected an empty or new folder" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["letter.txt"]

"""The package's front door."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fairing
from tests.small_scene import VERTICES, corner_scene, small_options, write_corner


def test_fair_runs_to_the_end_and_tells_of_every_step():
    seen = []
    session = fairing.fair(corner_scene(), small_options(locked_vertices=(1, 2, 3, 4, 5, 6)), on_step=seen.append)
    assert session.finished
    assert session.trace.steps == seen
    assert np.linalg.norm(session.vertices[0] - VERTICES[0]) < 0.01


def test_fair_refuses_options_that_cannot_work():
    with pytest.raises(fairing.InputError, match=r"cells\.size"):
        fairing.fair(corner_scene(), small_options(cells={"size": [1]}))


def test_fair_stops_when_asked():
    session = fairing.fair(corner_scene(), small_options(), should_stop=lambda: True)
    assert session.moment == 0
    assert not session.finished


def test_every_exported_name_exists_once():
    assert len(set(fairing.__all__)) == len(fairing.__all__)
    assert all(hasattr(fairing, name) for name in fairing.__all__)


def test_the_engine_knows_nothing_of_browsers():
    code = "import fairing, sys; print('viser' in sys.modules, 'app' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    assert done.stdout.split() == ["False", "False"]


def test_the_readme_s_lines_run_as_they_are_written(tmp_path, monkeypatch, capsys):
    write_corner(tmp_path / "capture")
    before, faces = fairing.read_mesh(tmp_path / "capture" / "mesh.obj")
    fairing.write_mesh(str(tmp_path / "start.ply"), before, faces)
    monkeypatch.chdir(tmp_path)
    readme = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    exec(readme.split("```python")[1].split("```")[0], {})
    assert capsys.readouterr().out.startswith("finished")
    after, _ = fairing.read_mesh("faired.ply")
    assert np.linalg.norm(after[0] - VERTICES[0]) < 0.5 * np.linalg.norm(before[0] - VERTICES[0])

"""The package's front door."""

import os
import pydoc
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import app
import demo_scenes
import fairing
import fairing.features
import fairing.io
import fairing.triangulation
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


LAZY = (fairing, fairing.io, fairing.features, fairing.triangulation, app, demo_scenes)


@pytest.mark.parametrize("package", LAZY, ids=lambda package: package.__name__)
def test_dir_shows_the_names_of_the_stub_each_of_which_exists(package: ModuleType):
    assert package.__file__ is not None
    stub = Path(package.__file__).with_suffix(".pyi")
    names = re.findall(r"^from \.[a-z_.]+ import (\w+) as \1$", stub.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(names) == len(stub.read_text(encoding="utf-8").splitlines())
    assert sorted(names) == sorted(set(names)) == sorted(package.__all__) == sorted(dir(package))
    assert all(hasattr(package, name) for name in names)
    # An imported submodule would take the place of a function of the same name.
    assert not {Path(name).stem for name in os.listdir(stub.parent)} & set(names)


def test_the_docstring_of_the_package_lists_every_name_in_a_group():
    assert fairing.__doc__ is not None
    groups = re.findall(
        r"^(?:Run|Scenes|Files|Records|Terms|Errors): .*?(?=^$|\Z)", fairing.__doc__, re.MULTILINE | re.DOTALL
    )
    listed = re.findall(r"`(\w+)`", "".join(groups))
    assert set(listed) == set(fairing.__all__)


def test_help_shows_the_functions_of_the_package():
    shown = "".join(pydoc.plain(pydoc.render_doc(fairing)).split())  # Python 3.13 breaks the lines of long signatures
    assert "fair(scene:" in shown
    assert "load_scene(path:" in shown
    assert "classSession" in shown


def test_importing_the_package_imports_no_library():
    code = "import fairing, app, demo_scenes, sys; print({'numpy', 'scipy', 'numba', 'cv2'} & sys.modules.keys())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    assert done.stdout == "set()\n"


@pytest.mark.slow
def test_a_demo_scene_is_loaded_by_its_name():
    scene, demo = fairing.load_scene("cube"), demo_scenes.load_demo("cube")
    assert np.array_equal(scene.mesh.vertices, demo.mesh.vertices)
    assert fairing.load_scene("cube", points="none").points_choice == "none"
    with pytest.raises(fairing.InputError, match="cube: a demo scene has its own mesh"):
        fairing.load_scene("cube", mesh="start.ply")


def test_a_folder_takes_precedence_over_the_demo_scene_of_its_name(tmp_path, monkeypatch):
    write_corner(tmp_path / "cube")
    monkeypatch.chdir(tmp_path)
    assert len(fairing.load_scene("cube").views) == 8


def test_a_name_that_nobody_offers_gets_the_names_that_work():
    with pytest.raises(
        fairing.InputError, match=r"cub: expected a folder, .* \(cube, facade, archway, dome, building:SEED\)"
    ):
        fairing.load_scene("cub")
    with pytest.raises(fairing.InputError, match="expected an integer as the seed"):
        fairing.load_scene("building:x")


def test_the_engine_knows_nothing_of_browsers():
    code = "import fairing, sys; print('viser' in sys.modules, 'app' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    assert done.stdout.split() == ["False", "False"]


def test_the_guide_s_lines_run_as_they_are_written(tmp_path, monkeypatch, capsys):
    write_corner(tmp_path / "capture")
    before, faces = fairing.read_mesh(tmp_path / "capture" / "mesh.obj")
    fairing.write_mesh(str(tmp_path / "start.ply"), before, faces)
    monkeypatch.chdir(tmp_path)
    guide = (Path(__file__).parents[1] / "app" / "guides" / "python.md").read_text(encoding="utf-8")
    exec(guide.split("```python")[1].split("```")[0], {})
    assert capsys.readouterr().out.startswith("finished")
    after, _ = fairing.read_mesh("faired.ply")
    assert np.linalg.norm(after[0] - VERTICES[0]) < 0.5 * np.linalg.norm(before[0] - VERTICES[0])

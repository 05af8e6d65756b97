"""What another package offers appears by its installation alone; the example plugin is one."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.lessons.reader import lesson_names, load_lesson
from demo_scenes import load_demo
from fairing import InputError, PhotoChoice, Session, load_scene
from fairing.experiments import EXPERIMENTS, experiments
from fairing.io.mesh_file import write_mesh
from fairing.run.own_files import load_own
from fairing.util.plugins import offered
from tests.installed_plugin import SOURCE, install_plugin
from tests.two_levels import two_levels


@pytest.fixture
def plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The folder of the installed plugin; what was looked up without it is forgotten."""
    caches = (offered, lesson_names, load_lesson)
    install_plugin(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    for each in caches:
        each.cache_clear()
    yield tmp_path
    for each in caches:
        each.cache_clear()
    for name in [name for name in sys.modules if name.startswith("eigenfairing_example")]:
        del sys.modules[name]


def test_a_format_is_read(plugin: Path, tmp_path: Path):
    capture, scene = tmp_path / "capture", load_demo("cube")
    capture.mkdir()
    lines = []
    for view in scene.views[:4]:
        Image.fromarray(view.photo.load()).save(capture / view.name)
        lines.append(",".join([view.name, *(repr(float(x)) for x in view.camera.image_from_world.ravel())]))
    (capture / "cameras.csv").write_text("\n".join(lines))
    write_mesh(capture / "start.ply", scene.mesh.vertices, scene.mesh.faces)
    read = load_scene(capture)
    assert [view.name for view in read.views] == [view.name for view in scene.views[:4]]
    for found, view in zip(read.views, scene.views, strict=False):
        assert np.array_equal(found.photo.load(), view.photo.load())
        assert found.camera.project(scene.mesh.vertices)[0] == pytest.approx(
            view.camera.project(scene.mesh.vertices)[0]
        )
    chosen = load_scene(capture, choice=PhotoChoice(format="camera-table"))
    assert len(chosen.views) == 4
    with pytest.raises(InputError, match=r"--format colmap: expected a COLMAP"):
        load_scene(capture, choice=PhotoChoice(format="colmap"))
    with pytest.raises(
        InputError, match=r"--format table: expected one of colmap, .*, camera-table, found another name"
    ):
        load_scene(capture, choice=PhotoChoice(format="table"))
    (capture / "cameras.csv").write_text("a.png,1,2")
    with pytest.raises(InputError, match="expected twelve numbers, found 2"):
        load_scene(capture)


@pytest.mark.slow
def test_a_scene_is_named_in_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "corners.py").write_text(
        "from tests.small_scene import corner_scene\n"
        "DEMO_NAMES = 'corner'\n"
        "def is_demo(name):\n    return name == 'corner'\n"
        "def load_demo(name, *, progress=None):\n    return corner_scene()\n"
    )
    info = tmp_path / "corners-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: corners\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[fairing.scenes]\ncorners = corners\n")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(SOURCE.parents[1])])}

    def run(*command: str) -> subprocess.CompletedProcess:
        whole = [sys.executable, "-m", "app", *command]
        return subprocess.run(whole, capture_output=True, text=True, timeout=600, check=False, env=environment)

    assert "corner: of an installed package" in run("demos").stdout
    out = tmp_path / "out"
    flags = ["--schedule.blur", "2", "--schedule.max-sweeps", "1"]
    done = run("fair", "corner", "--out", str(out), *flags)
    assert done.returncode == 0, done.stderr
    assert run("fair", "corner", "--out", str(out), "--resume", *flags).returncode == 0
    done = run("fair", "corne", "--out", str(out))
    assert (done.returncode, "corne: expected a demo (cube, " in done.stderr, "corner)" in done.stderr) == (
        1,
        True,
        True,
    )


def test_a_term_is_named_instead_of_a_file(plugin: Path):
    (term,) = load_own([Path("rigidity")]).terms
    session = Session(load_demo("cube"), two_levels("joint", sweeps=1, iterations=1), terms=[term])
    session.step()
    assert "rigidity" in {pull.name for pull in session.pulls(0)}
    with pytest.raises(InputError, match="expected a Python file"):
        load_own([Path("rigid")])


def test_a_norm_and_a_plan_are_named_instead_of_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    info = tmp_path / "robust-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: robust\nVersion: 1\n")
    (info / "entry_points.txt").write_text(
        "[fairing.norms]\nbiweight = demo_scenes.norms.tukey:Tukey\n"
        "[fairing.plans]\ntwo-blurs = demo_scenes.plans.two_blurs:plan\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    offered.cache_clear()
    try:
        own = load_own([Path("biweight"), Path("two-blurs")])
    finally:
        offered.cache_clear()
    assert own.norm is not None
    assert own.norm.name == "tukey"
    assert own.plan is not None
    assert [stage.kind for stage in own.plan] == ["photos", "photos", "judge"]


@pytest.mark.slow
def test_an_experiment_is_listed_and_measured(plugin: Path, tmp_path: Path):
    assert set(experiments()) == {*EXPERIMENTS, "damping"}
    out = tmp_path / "out"
    command = [sys.executable, "-m", "app", "experiment", "damping", "--out", str(out), "--directions", "1"]
    command += ["--schedule.blur", "2", "--schedule.max-sweeps", "1"]
    environment = {**os.environ, "PYTHONPATH": str(plugin)}
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False, env=environment)
    assert done.returncode == 0, done.stderr
    assert "Without damping a run takes" in done.stdout + done.stderr
    assert len(json.loads(next(out.glob("*.json")).read_text())["rows"]) == 2


def test_a_lesson_is_listed_after_the_others(plugin: Path):
    assert lesson_names()[-1] == "my-first"
    assert load_lesson("my-first").title == "My first lesson"


def test_what_cannot_be_loaded_is_one_line_that_names_the_package(plugin: Path):
    (plugin / "eigenfairing_example" / "damping.py").write_text("import nothing_of_this_name")
    with pytest.raises(
        InputError, match=r"package eigenfairing-example: damping of .* cannot be loaded .*nothing_of_this_name"
    ):
        experiments()


def test_two_packages_cannot_offer_the_same_name(plugin: Path, tmp_path: Path):
    other = tmp_path / "other-1.0.dist-info"
    other.mkdir()
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: other\nVersion: 1.0\n")
    (other / "entry_points.txt").write_text("[fairing.terms]\nrigidity = other:Rigidity\n")
    with pytest.raises(InputError, match=r"offers rigidity of fairing\.terms, as another one does"):
        load_own([Path("rigidity")])


def test_its_readme_names_every_kind_that_its_project_offers():
    readme = (SOURCE / "README.md").read_text(encoding="utf-8")
    groups = [
        line.split('"')[1] for line in (SOURCE / "pyproject.toml").read_text().splitlines() if "entry-points" in line
    ]
    assert groups
    for group in groups:
        assert f"| `{group}` |" in readme

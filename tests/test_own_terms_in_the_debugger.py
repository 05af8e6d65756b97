"""Terms of one's own in the debugger: loaded from a file, shown like the others, loaded anew when the file is saved."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import demo_scenes
from app.debugger.commands import Extent, Forward
from app.debugger.controller import Controller
from app.debugger.moment_pulls import moment_pulls
from app.debugger.quantities import StepContext, quantities_of
from app.debugger.term_files import TermFiles
from app.debugger.watch import parse_watch
from app.files.scene_source import SceneSource
from app.pictures.term_colors import COLOR_OF_TERM
from demo_scenes import load_demo
from fairing.errors import InputError
from fairing.run.session import Session
from fairing.terms.own_file import load_terms
from tests.small_scene import corner_scene, small_options
from tests.two_levels import two_levels
from tests.waiting import wait_for

EXAMPLES = Path(demo_scenes.__file__).parent / "terms"


def example(tmp_path: Path, name: str = "planarity") -> Path:
    return Path(shutil.copy(EXAMPLES / f"{name}.py", tmp_path))


@pytest.mark.compiled
@pytest.mark.parametrize("file", sorted(EXAMPLES.glob("[a-z]*.py")), ids=lambda file: file.stem)
def test_every_example_pulls(file: Path):
    (term,) = load_terms([file])
    session = Session(corner_scene(), small_options(), terms=[term])
    session.step()
    pulls = {pull.name: pull for pull in session.pulls()}
    assert file.stem in pulls
    assert np.isfinite(pulls[file.stem].step).all()


@pytest.mark.compiled
def test_conditions_and_colours_know_the_term(tmp_path):
    session = Session(corner_scene(), small_options(), terms=load_terms([example(tmp_path)]))
    session.step()
    ask = quantities_of(session.trace.steps[0], 1, StepContext(session, session.trace.start))
    value = parse_watch("pull(planarity, 0)", session.scene).evaluate(ask)
    found = moment_pulls(session, 1)
    assert value == found.px_of("planarity")[0]
    assert COLOR_OF_TERM["planarity"] not in [COLOR_OF_TERM[name] for name in ("photos", "points", "start")]


MISTAKES = {
    "this is no Python": ("SyntaxError", r"mine.py, line 1: "),
    "import fairing\nx = 1 / 0\n": ("ZeroDivisionError", r"mine.py, line 2: ZeroDivisionError"),
    "x = 1\n": ("none", r"expected subclasses of fairing.OwnTerm, found none"),
    "import fairing\nclass A(fairing.OwnTerm):\n    pass\n": ("name", r"expected a name of words"),
}


@pytest.mark.parametrize("code", MISTAKES, ids=[name for name, _ in MISTAKES.values()])
def test_mistakes_in_a_file_are_one_line(code: str, tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(code)
    with pytest.raises(InputError, match=MISTAKES[code][1]):
        load_terms([file])


def test_a_file_that_is_missing_is_named():
    with pytest.raises(InputError, match=r"missing.py: expected a Python file"):
        load_terms([Path("missing.py")])


@pytest.mark.compiled
def test_a_saved_file_branches_the_run_and_a_mistake_pauses_it(tmp_path):
    file = example(tmp_path)
    session = Session(corner_scene(), small_options(), terms=load_terms([file]))
    controller = Controller(session)
    files = TermFiles(session.terms, controller.post)
    try:
        controller.post(Forward(Extent.ITERATION))
        state = controller.wait_until_idle()
        first = state.run_id
        assert state.moment == 1
        file.write_text(file.read_text().replace("strength = 0.3", "strength = 5.0"))
        wait_for(lambda: controller.state.run_id != first)
        state = controller.wait_until_idle()
        assert state.moment == 1
        assert "planarity as saved" in state.reason
        file.write_text(file.read_text().replace("residual(vertices):", "residual(vertices)"))
        wait_for(lambda: "line" in controller.state.problem)
        assert len(controller.state.runs) == 2
        assert "planarity.py, line" in controller.state.problem
    finally:
        files.close()
        controller.close()


@pytest.mark.slow
def test_the_command_fairs_with_a_term_and_continues_with_the_same_alone(tmp_path):
    file, out = example(tmp_path, "rigidity"), tmp_path / "out"
    fair = [sys.executable, "-m", "app", "fair", "cube", "--out", str(out), "--schedule.blur", "2"]

    def run(*flags: str) -> subprocess.CompletedProcess:
        return subprocess.run([*fair, *flags], capture_output=True, text=True, timeout=600, check=False)

    assert run("--with", str(file)).returncode == 0
    assert run("--resume", "--with", str(file)).returncode == 0


@pytest.mark.slow
def test_a_run_is_exported_without_its_terms_but_then_without_pulls(tmp_path):
    scene, trace = load_demo("cube"), tmp_path / "run.trace"
    file = example(tmp_path, "rigidity")
    session = Session(scene, two_levels("joint", sweeps=1, iterations=1), terms=load_terms([file]))
    SceneSource("cube").note_in(session.trace.header)
    session.run()
    session.trace.attach(trace)
    session.trace.detach()

    def pulls(*flags: str) -> tuple[list[str], str]:
        page = tmp_path / "page.html"
        command = [sys.executable, "-m", "app", "export", str(trace), "--out", str(page), *flags]
        done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=True)
        (data,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page.read_text(), re.DOTALL)
        return [term["name"] for term in json.loads(data)["pulls"]["terms"]], done.stderr

    assert "rigidity" in pulls("--with", str(file))[0]
    names, lines = pulls()
    assert names == []
    assert "without pulls: give the files of the run's own terms with --with" in lines


@pytest.mark.compiled
@pytest.mark.parametrize(("guide", "term"), [("python", "Rigidity"), ("extending", "Closeness")])
def test_the_term_of_a_guide_runs_as_it_is_written(guide, term):
    text = (Path(__file__).parents[1] / "app" / "guides" / f"{guide}.md").read_text(encoding="utf-8")
    (code,) = (block for block in text.split("```python")[1:] if "OwnTerm" in block.split("```")[0])
    names: dict = {}
    exec(code.split("```")[0], names)
    session = Session(corner_scene(), small_options(), terms=[names[term]()])
    session.step()
    assert term.lower() in {pull.name for pull in session.pulls()}

"""Terms of one's own in the debugger: loaded from a file, shown like the others, loaded anew when the file is saved."""

import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import demo_scenes
from app.debugger.commands import Extent, Forward, Run
from app.debugger.controller import Controller
from app.debugger.iteration_query import IterationQuery, iteration_facts
from app.debugger.moment_pulls import moment_pulls
from app.debugger.own_files import OwnFiles
from app.debugger.quantities import StepContext, quantities_of
from app.debugger.watch import parse_watch
from app.files.scene_source import SceneSource
from app.pictures.engine_differences import difference_at
from app.pictures.term_colors import COLOR_OF_TERM, colors_of_terms
from demo_scenes import load_demo
from fairing import Mask, Scene, rasterize
from fairing.errors import InputError
from fairing.norms.norm import Norm
from fairing.run.own_files import load_own
from fairing.run.recorded_stages import recorded_stages
from fairing.run.session import Session
from fairing.trace import Trace
from tests.small_scene import corner_scene, small_options
from tests.two_levels import two_levels
from tests.waiting import wait_for

EXAMPLES = Path(demo_scenes.__file__).parent / "terms"


def example(tmp_path: Path, name: str = "planarity") -> Path:
    return Path(shutil.copy(EXAMPLES / f"{name}.py", tmp_path))


def masked(scene: Scene, folder: Path) -> Scene:
    """The scene with masks of the true surface."""
    assert scene.truth is not None
    views = []
    for view in scene.views:
        file = folder / f"{view.name}.png"
        surface = scene.truth.surface
        Image.fromarray(rasterize(surface.vertices, surface.faces, view.camera)[0] >= 0).save(file)
        views.append(replace(view, mask=Mask(file)))
    return replace(scene, views=tuple(views))


@pytest.mark.compiled
@pytest.mark.parametrize("file", sorted(EXAMPLES.glob("[a-z]*.py")), ids=lambda file: file.stem)
def test_every_example_pulls(file: Path, tmp_path: Path):
    (term,) = load_own([file]).terms
    session = Session(masked(corner_scene(), tmp_path), small_options(), terms=[term])
    session.step()
    pulls = {pull.name: pull for pull in session.pulls()}
    assert file.stem in pulls
    assert np.isfinite(pulls[file.stem].step).all()


@pytest.mark.compiled
def test_conditions_and_colours_know_the_term(tmp_path):
    session = Session(corner_scene(), small_options(), terms=load_own([example(tmp_path)]).terms)
    session.step()
    ask = quantities_of(session.trace.steps[0], 1, StepContext(session, session.trace.start))
    found = moment_pulls(session, 1)
    value = parse_watch("pull(planarity, 0)", session.scene, found.meanings).evaluate(ask)
    assert value == found.px_of("planarity")[0] > 0
    assert colors_of_terms(found.meanings)["planarity"] not in COLOR_OF_TERM.values()
    with pytest.raises(InputError, match="expects a term: photos"):
        parse_watch("pull(planarity, 0)", session.scene)


MISTAKES = {
    "this is no Python": ("SyntaxError", r"mine.py, line 1: "),
    "import fairing\nx = 1 / 0\n": ("ZeroDivisionError", r"mine.py, line 2: ZeroDivisionError"),
    "x = 1\n": (
        "none",
        r"expected subclasses of fairing.OwnTerm, a subclass of fairing.Norm or a list named plan, found none",
    ),
    "import fairing\nclass A(fairing.OwnTerm):\n    pass\n": ("name", r"expected a name of words"),
    "import fairing\nclass A(fairing.Norm):\n    pass\n": ("norm", r"mine.py: norm A: expected a name such as"),
    "import fairing\nclass A(fairing.Norm):\n    pass\nclass B(fairing.Norm):\n    pass\n": (
        "norms",
        r"expected one norm, found A, B",
    ),
    "plan = 3\n": ("plan", r"mine.py: plan: expected a list of fairing.PlanStage, found 3"),
    "def plan():\n    return 1 / 0\n": ("failing plan", r"mine.py, line 2: ZeroDivisionError"),
}


@pytest.mark.parametrize("code", MISTAKES, ids=[name for name, _ in MISTAKES.values()])
def test_mistakes_in_a_file_are_one_line(code: str, tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(code)
    with pytest.raises(InputError, match=MISTAKES[code][1]):
        load_own([file])


def test_a_file_that_is_missing_is_named():
    with pytest.raises(InputError, match=r"missing.py: expected a Python file"):
        load_own([Path("missing.py")])


@pytest.mark.compiled
def test_a_saved_file_branches_the_run_and_a_mistake_pauses_it(tmp_path):
    file = example(tmp_path)
    session = Session(corner_scene(), small_options(), terms=load_own([file]).terms)
    controller = Controller(session)
    files = OwnFiles(session.own_files, controller.post)
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


@pytest.mark.compiled
def test_a_saved_norm_branches_the_run(tmp_path):
    file = Path(shutil.copy(EXAMPLES.parent / "norms" / "tukey.py", tmp_path))
    session = Session(corner_scene(), small_options(), norm=load_own([file]).norm)
    controller = Controller(session)
    files = OwnFiles(session.own_files, controller.post)
    try:
        controller.post(Forward(Extent.ITERATION))
        first = controller.wait_until_idle().run_id
        file.write_text(file.read_text().replace("CUT = 3.0", "CUT = 2.0"))
        wait_for(lambda: controller.state.run_id != first)
        state = controller.wait_until_idle()
        assert "branched at moment 1 with tukey as saved" in state.reason
        assert len(state.runs) == 2
        controller.post(Forward(Extent.ITERATION))
        assert controller.wait_until_idle().problem == ""
        file.write_text(file.read_text().replace("def rho(self, x):", "def rho(self, x):\n        return -x\n"))
        wait_for(lambda: "norm tukey: expected rho(x) finite and at least 0" in controller.state.problem)
        assert len(controller.state.runs) == 2
    finally:
        files.close()
        controller.close()


@pytest.mark.compiled
def test_a_saved_plan_branches_the_run_where_the_first_changed_stage_begins(tmp_path):
    file = tmp_path / "plan.py"
    code = """from fairing import PlanStage
plan = [PlanStage("photos", blur=2.0, max_sweeps=1, max_iterations=2), PlanStage("photos", blur=1.0, max_sweeps=1)]
"""
    file.write_text(code)
    mine = load_own([file])
    session = Session(corner_scene(), small_options(), plan=mine.plan, plan_file=mine.plan_file)
    controller = Controller(session)
    files = OwnFiles(session.own_files, controller.post)
    try:
        controller.post(Run())
        before = controller.wait_until_idle()
        second = recorded_stages(before.trace)[1].begin
        file.write_text(code + "# nothing changes\n")
        wait_for(lambda: "nothing has changed" in controller.state.reason)
        assert controller.state.run_id == before.run_id
        file.write_text(code.replace("1.0", "0.5"))
        wait_for(lambda: controller.state.run_id != before.run_id)
        state = controller.wait_until_idle()
        assert f"branched at moment {second} with the plan as saved" in state.reason
        assert [run.length for run in state.runs] == [before.length, second]
        controller.post(Run())
        state = controller.wait_until_idle()
        assert state.finished
        assert state.options.by_level("blur") == (2.0, 0.5)
        file.write_text(code.replace("PlanStage(", "PlanStage)"))
        wait_for(lambda: "plan.py, line 2" in controller.state.problem)
        file.write_text(code.replace("photos", "points"))
        wait_for(lambda: "expected settings among gates" in controller.state.problem)
        assert controller.state.finished
        assert len(controller.state.runs) == 2
    finally:
        files.close()
        controller.close()


@pytest.mark.compiled
@pytest.mark.parametrize("file", sorted(EXAMPLES.parent.glob("norms/[a-z]*.py")), ids=lambda file: file.stem)
def test_every_example_norm_is_used(file: Path):
    session = Session(corner_scene(), small_options(), norm=load_own([file]).norm)
    record, plain = session.step(), Session(corner_scene(), small_options()).step()
    assert record is not None
    assert plain is not None
    assert session.own_files == (str(file),)
    assert (record.after != plain.after).any()


@pytest.mark.compiled
@pytest.mark.parametrize("file", sorted(EXAMPLES.parent.glob("plans/[a-z]*.py")), ids=lambda file: file.stem)
def test_every_example_plan_is_executed(file: Path):
    plan = load_own([file]).plan
    assert plan is not None
    session = Session(corner_scene(), small_options(), plan=plan)
    session.run()
    assert [stage.kind.label for stage in recorded_stages(session.trace)] == [stage.kind for stage in plan]


@pytest.mark.slow
def test_the_command_fairs_with_a_norm_and_a_plan(tmp_path):
    out, norm = tmp_path / "out", EXAMPLES.parent / "norms" / "cauchy.py"
    plan = tmp_path / "plan.py"
    plan.write_text(
        "import fairing\n\ndef plan():\n    return [fairing.PlanStage('photos', blur=2.0, max_sweeps=1, max_iterations=1)]\n"
    )
    command = [sys.executable, "-m", "app", "fair", "cube", "--out", str(out)]

    def run(*flags: str) -> subprocess.CompletedProcess:
        return subprocess.run([*command, *flags], capture_output=True, text=True, timeout=600, check=False)

    done = run("--with", str(norm), str(plan))
    assert done.returncode == 0, done.stderr
    session = Session(load_demo("cube"), trace=Trace.load(out / "run.trace"))
    assert (len(session.trace), session.norm.name, session.options.by_level("blur")) == (1, "cauchy", (2.0,))
    assert run("--resume").returncode == 0, "its code is not needed again"
    plan.write_text("plan = []\n")
    done = run("--with", str(plan))
    assert done.returncode == 1
    assert "plan.py: plan: expected a list of fairing.PlanStage, found []" in done.stderr
    assert "Traceback" not in done.stderr


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
    session = Session(scene, two_levels("joint", sweeps=1, iterations=1), terms=load_own([file]).terms)
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
def test_the_norm_and_the_plan_of_the_guide_run_as_they_are_written():
    text = (Path(__file__).parents[1] / "app" / "guides" / "extending.md").read_text(encoding="utf-8")
    names: dict = {}
    for word in ("fairing.Norm)", "plan = ["):
        (code,) = (block for block in text.split("```python")[1:] if word in block.split("```")[0])
        exec(code.split("```")[0], names)
    norm, plan = names["Welsch"](), names["plan"]
    x = np.geomspace(1e-3, 8, 50)
    assert norm.weight(x) == pytest.approx(Norm.weight(norm, x), rel=1e-4, abs=1e-7)
    session = Session(corner_scene(), small_options(), norm=norm, plan=plan)
    facts = iteration_facts(session, IterationQuery(0, 0, 0, 0))
    assert "here it is “welsch”" in difference_at("weights", session.options, facts)
    session.run()
    executed = [(stage.kind.label, stage.level) for stage in recorded_stages(session.trace)]
    assert executed == [("smoothing", 0), ("judge", 0), ("photos", 0), ("photos", 1)]
    assert [level.blur for level in session.options.levels] == [2.0, 0.5]


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

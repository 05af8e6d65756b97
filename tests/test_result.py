"""What the page says about a finished run, and the command lines that do the same without it."""

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.debugger.result_facts import ResultFacts, result_facts
from app.debugger.run_command import export_command, fair_command
from app.debugger.runs import Runs
from app.panels.result_card import _figures
from fairing.judge.comparable_residual import ComparableResidual
from fairing.options import PRESETS
from fairing.run.session import Session
from tests.small_scene import corner_scene, small_options


@pytest.fixture(scope="module")
def session() -> Session:
    session = Session(corner_scene(), small_options())
    session.run()
    return session


@pytest.fixture(scope="module")
def facts(session: Session) -> ResultFacts:
    return facts_of(session, None)


def facts_of(session: Session, report: Path | None) -> ResultFacts:
    measure, (run,) = ComparableResidual(session), Runs(session, None).infos()
    before, after = measure.measure(session.trace.start), measure.measure(session.vertices)
    return result_facts(session.scene, run, before, after, report)


def test_a_run_that_found_the_corner_helped(session: Session, facts: ResultFacts):
    assert facts.helped
    assert facts.objection == ""
    assert facts.error is not None
    assert facts.error[1] < 0.1 * facts.error[0]
    far = np.linalg.norm(session.vertices - session.trace.start, axis=1)
    assert facts.moved == pytest.approx(100 * far / session.scene.mesh.diagonal)
    residuals = [residual for _, residual in facts.worst]
    assert len(facts.worst) == 5
    assert residuals == sorted(residuals, reverse=True)
    by_vertex = ComparableResidual(session).measure(session.vertices).by_vertex(session.scene.mesh)
    assert residuals[0] == pytest.approx(np.nanmax(by_vertex))
    assert by_vertex[facts.worst[0][0]] == pytest.approx(residuals[0])


def test_what_speaks_against_a_result_is_said(facts: ResultFacts):
    assert not replace(facts, residual=(5.0, 4.99)).helped
    assert replace(facts, error=(2.55, 2.60)).objection == "the mesh is no nearer to the truth"
    assert replace(facts, left_out=(28.0, 27.0, 11)).objection == "left-out photos are predicted worse"


def test_left_out_photos_are_those_of_the_report(session: Session, tmp_path: Path):
    report = tmp_path / "report.json"
    for found in ("", "[]", '{"left_out": null}'):
        report.write_text(found)
        assert facts_of(session, report).left_out is None
    report.write_text(json.dumps({"left_out": {"psnr_before": 26.5, "psnr_after": 28.2, "photos_judged": 11}}))
    assert facts_of(session, report).left_out == (26.5, 28.2, 11)


def test_the_distance_to_the_truth_has_a_tooltip_about_curved_surfaces(facts: ResultFacts):
    titled = re.findall(r'<tr title="([^"]*)"><td>([^<]*)', _figures(facts))
    assert [name for _, name in titled] == ["Distance to the truth, RMS, %"]
    assert "lower residual than the true mesh" in titled[0][0]
    assert "truth" not in _figures(replace(facts, error=None))


def test_the_preset_paper_is_recognised(session: Session, facts: ResultFacts):
    assert not facts.is_paper
    paper = Session(session.scene, small_options("paper"))
    paper.step()
    assert facts_of(paper, None).is_paper


def test_commands_name_the_scene_and_what_differs_from_a_preset():
    header = {"source": {"scene": "/my captures/wall", "mesh": "/my captures/start.ply"}}
    accurate = PRESETS["accurate"]
    options = replace(accurate, lock_boundary=True, step=replace(accurate.step, damping_always=True))
    options = options.with_levels(points=0.0)
    words = shlex.split(fair_command("wall", header, options))
    assert words[:5] == ["eigenfairing", "fair", "/my captures/wall", "--mesh", "/my captures/start.ply"]
    assert words[-2:] == ["--out", "run"]
    assert sorted(words[5:-2]) == ["--lock-boundary", "--step.damping-always", "--step.points", "0.0"]
    assert words[words.index("--step.points") + 1] == "0.0"
    assert shlex.split(fair_command("cube", {}, PRESETS["paper"])) == [
        *("eigenfairing", "fair", "cube", "--preset", "paper", "--out", "run")
    ]
    assert export_command(Path("/a b/run.trace"), "page.html") == "eigenfairing export '/a b/run.trace' --out page.html"
    assert export_command(None, "report.html", "--report") == "eigenfairing export run --out report.html --report"

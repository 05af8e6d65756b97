"""Lessons as files: what the engine showed is in the page, and a lesson that claims too much is not written."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from app.cli.main import run
from app.lesson_pages import page
from app.lesson_pages.measured import OF_PAGES, experiment_of, measured_experiment
from app.lesson_pages.page import write_lesson, write_lessons
from app.lesson_pages.page_data import lesson_data
from app.lesson_pages.playing import PlayedLesson, play_lesson
from app.lessons.reader import lesson_names, load_lesson
from app.lessons.scenes import load_lesson_scene
from demo_scenes import load_demo
from fairing.errors import InputError
from fairing.experiments import EXPERIMENTS, WarpComparison
from fairing.judge.inspect import face_cells

pytestmark = pytest.mark.usefixtures("remembered_steps")

TEMPLATE = Path(page.__file__).parents[1] / "lessons" / "template.md"


@pytest.fixture(scope="module")
def played(remembered_steps) -> PlayedLesson:
    return play_lesson(load_lesson(str(TEMPLATE)), load_lesson_scene("cube"), lambda fraction: None)


def test_a_played_lesson_holds_the_moment_and_the_numbers_of_each_step(played: PlayedLesson):
    assert [run.name for run in played.runs] == ["main"]
    moments = [step.moment for step in played.steps]
    assert moments[:5] == [0, 0, 1, 1, 1]
    assert moments[5] == played.runs[0].facts.length > 1
    scene, end = played.scene, played.runs[0].facts.trace.vertices_at(moments[5])
    assert scene.truth is not None
    assert scene.truth.vertices is not None
    off = 100 * float(np.linalg.norm(end[0] - scene.truth.vertices[0]))
    assert played.steps[5].findings.numbers["off(0)"] == pytest.approx(off)


def test_the_profile_of_a_step_is_the_energy_of_its_faces(played: PlayedLesson):
    data = lesson_data(played, lambda fraction: None)
    profile = data["steps"][2]["profile"]
    middle = len(profile["offsets"]) // 2
    assert profile["offsets"][middle] == pytest.approx(0)
    session = played.runs[0].facts.session
    wanted = sum(face_cells(session, face, 1).energy for face in range(6))
    assert [line[middle] for line in profile["lines"]] == pytest.approx([wanted] * 3, rel=1e-6)
    json.dumps(data, allow_nan=False)


def test_the_template_for_teachers_becomes_a_page(tmp_path, capsys):
    out = tmp_path / "template.html"
    assert run(["export", "--lesson", str(TEMPLATE), "--out", str(out)]) == 0
    assert "claims verified" in capsys.readouterr().err
    text = out.read_text()
    assert out.stat().st_size < 8e6
    assert "default-src 'none'" in text
    assert re.search(r"(src|href|action)=[\"']?(https?:)?//", text) is None


def test_a_false_claim_stops_the_export(tmp_path):
    false = tmp_path / "false.md"
    false.write_text(TEMPLATE.read_text().replace("off(0) > 12\n", "off(0) > 50\n"))
    with pytest.raises(
        InputError, match=r"lesson false, step 1 \(What is there\): expected off\(0\) > 50, found off\(0\) = 12\.\d+$"
    ):
        write_lesson(str(false), tmp_path / "false.html", lambda fraction, line: None)
    assert not (tmp_path / "false.html").exists()


def test_the_index_links_the_pages_in_their_order(tmp_path, monkeypatch):
    def write(name: str, out: Path, on_progress, index: str) -> int:
        out.write_text(index)
        return 1

    monkeypatch.setattr(page, "write_lesson", write)
    names = lesson_names()
    assert list(write_lessons(names, tmp_path, lambda fraction, line: None)) == list(names)
    index = (tmp_path / "index.html").read_text()
    links = re.findall(r"href='([^']+)'", index)
    assert links == [f"{name}.html" for name in names]
    assert all((tmp_path / link).read_text() == "index.html" for link in links)
    assert all(load_lesson(name).title in index for name in names)


def test_every_experiment_of_a_lesson_can_be_in_its_page():
    offered = {found[0] for name in lesson_names() if (found := experiment_of(load_lesson(name)))}
    assert offered == set(EXPERIMENTS) == set(OF_PAGES)


@pytest.mark.slow
def test_an_experiment_in_a_page_names_its_finding(monkeypatch):
    monkeypatch.setitem(OF_PAGES, "warps", WarpComparison(starts=(10.0,), directions=1))
    seen = []
    found = measured_experiment("warps", 0, load_demo("cube"), seen.append)
    assert found["runs"] == 4 == len(seen)
    assert seen[-1] == 1
    assert found["finding"].startswith("Median final error")
    assert found["charts"].count("<svg") == 2


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--out", "page.html"], "expected one of RUN, --lesson NAME and --lessons"),
        (["--lesson", "model", "--lessons", "--out", "x"], "expected one of RUN, --lesson NAME and --lessons"),
        (["--lesson", "nonsense", "--out", "page.html"], "expected one of model, cells"),
        (["--lesson", "missing.md", "--out", "page.html"], "missing.md: cannot be read"),
        (["--lesson", "model", "--out", "page.png"], "expected a file ending in .html"),
        (["--lesson", "model", "--out", "no/such/page.html"], "there is no folder"),
        (["--lesson", "model", "--scene", "facade", "--out", "page.html"], "has a scene of its own"),
        (["--lesson", "model", "--report", "--out", "page.html"], "apply to a RUN"),
        (["--lessons", "--scene", "cube", "--out", "x"], "uses the demo scenes"),
    ],
)
def test_a_wrong_use_is_reported_in_one_line(arguments, complaint, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(["export", *arguments]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert complaint in lines[0]
    assert list(tmp_path.iterdir()) == []


def test_a_lesson_file_is_named_after_the_file(tmp_path):
    copy = tmp_path / "mine.md"
    copy.write_text(TEMPLATE.read_text())
    lesson = load_lesson(str(copy))
    assert (lesson.name, lesson.title) == ("mine", "A template")
    assert [step.title for step in lesson.steps] == [
        line[2:] for line in copy.read_text().splitlines() if line.startswith("# ")
    ]

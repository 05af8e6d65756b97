"""Runs and experiments in notebooks, and the notebooks of the repository."""

import importlib
import subprocess
import sys
import tomllib
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from app import measure, progress, show
from app.cli.experiment import experiment_to_folder
from app.files.scene_source import SceneSource
from app.notebook import frame
from app.notebook.live import LiveDebugger
from demo_scenes import load_demo
from fairing import PRESETS, FairingOptions, InputError, Session
from fairing.experiments import CaptureRange, Setting
from tests.small_scene import corner_scene
from tests.two_levels import two_levels

NOTEBOOKS = sorted((Path(__file__).parents[1] / "demo_scenes" / "notebooks").glob("*.ipynb"))
QUICK = FairingOptions().with_levels(blur=(2.0, 1.0), max_sweeps=1)
BLOCKED = ("IPython", "ipykernel", "nbclient", "nbformat", "jupyter_client", "jupyter_core", "ipywidgets", "tqdm")


@pytest.fixture(scope="module")
def session() -> Session:
    session = Session(corner_scene(), QUICK)
    session.run()
    return session


@pytest.fixture(scope="module")
def measured():
    setting = Setting.of(load_demo("cube"), QUICK, 0)
    return measure(CaptureRange(starts=(5.0, 10.0), directions=1), setting)


def test_a_session_becomes_the_exported_page_in_a_frame(session, tmp_path):
    session.go_to(1)
    shown = show(session)
    html = shown._repr_html_()
    assert html.startswith("<iframe srcdoc=")
    assert 'sandbox="allow-scripts"' in html
    assert unescape(html.partition('srcdoc="')[2].partition('" sandbox')[0]) == shown.html
    assert "default-src 'none'" in shown.html
    assert '"at":1,' in shown.html
    assert session.moment == 1
    assert shown.save(tmp_path / "page.html").read_text() == shown.html
    assert "steps; save(path)" in repr(shown)


def test_a_page_that_is_too_large_for_a_notebook_is_refused(session, monkeypatch):
    monkeypatch.setattr(frame, "MAX_BYTES", 1000)
    with pytest.raises(InputError, match="takes at most"):
        show(session)


@pytest.mark.slow
def test_results_of_an_experiment_are_shown_with_their_finding(measured):
    assert measured.column("start_percent") == [5.0, 10.0]
    shown = show(measured)
    assert measured.finding in unescape(shown.html)
    assert "<svg" in shown.html
    assert "default-src 'none'" in shown.html
    assert "2 runs" in repr(measured)


@pytest.mark.slow
def test_folders_of_runs_and_experiments_are_shown(tmp_path, capsys):
    from rich.console import Console

    from app.cli.main import run

    folder = tmp_path / "run"
    flags = ["--schedule.blur", "6", "--schedule.max-sweeps", "1", "--cells.size", "16"]
    assert run(["fair", "cube", "--out", str(folder), *flags]) == 0
    shown = show(folder)
    assert "cube" in repr(shown)
    out = tmp_path / "range"
    experiment = CaptureRange(starts=(5.0,), directions=1)
    experiment_to_folder(experiment, SceneSource("cube"), out, 0, QUICK, False, Console(quiet=True))
    assert "Capture range: 1 runs" in repr(show(out))
    assert show(out / "capture-range.json").html == show(str(out)).html
    (out / "capture-range.json").write_text("{}")
    with pytest.raises(InputError, match="expected the record of an experiment"):
        show(out)


def test_a_loop_drives_the_live_debugger_and_makes_the_steps_of_the_session():
    options = two_levels("joint", sweeps=1, iterations=2)
    expected = Session(corner_scene(), options)
    records = list(expected)
    live = LiveDebugger(Session(corner_scene(), options))
    try:
        for number, record in enumerate(live):
            assert live.state.moment == number + 1
            assert np.array_equal(record.after, records[number].after)
        assert np.array_equal(live.state.vertices, expected.vertices)
        assert live.state.finished
        moved = live.state.vertices[[0]] + 1e-3
        live.place(np.array([0]), moved)
        assert np.array_equal(live.state.vertices[[0]], moved)
        with pytest.raises(InputError, match=r"expected vertices \(u,\) and positions \(u, 3\)"):
            live.place(np.array([0]), moved[0])
        with pytest.raises(InputError, match="turned over or collapsed"):
            live.place(np.array([0]), live.state.vertices[[1]])
        assert np.array_equal(live.state.vertices[[0]], moved)
    finally:
        live.stop()


def test_a_session_is_shown_by_an_installed_viewer(monkeypatch: pytest.MonkeyPatch):
    session, found = Session(corner_scene()), {}
    monkeypatch.setattr("fairing.run.session.offered", lambda group: found if group == "fairing.viewers" else {})
    with pytest.raises(InputError, match="found none; install EigenFairing"):
        session.show()
    found["one"] = lambda shown: ("shown", shown)
    assert session.show() == ("shown", session)
    declared = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]["entry-points"]
    module, _, name = declared["fairing.viewers"]["eigenfairing"].partition(":")
    assert getattr(importlib.import_module(module), name) is LiveDebugger


def test_the_live_debugger_is_a_frame_on_its_address():
    live = show(Session(corner_scene(), PRESETS["accurate"]), live=True)
    try:
        assert isinstance(live, LiveDebugger)
        assert live.url.startswith("http://127.0.0.1:")
        html = live._repr_html_()
        assert f'<iframe src="{live.url}"' in html
        assert f'<a href="{live.url}"' in html
    finally:
        live.stop()


def test_other_things_are_refused():
    with pytest.raises(InputError, match="expected a session, the results of an experiment, or a path; found int"):
        show(3)  # pyright: ignore[reportCallIssue, reportArgumentType]
    with pytest.raises(InputError, match="live=True expects a session"):
        show("folder", live=True)  # pyright: ignore[reportCallIssue, reportArgumentType]


def test_progress_in_a_terminal_is_a_line_that_ends(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with progress("Working") as bar:
        bar(0.5)
    assert capsys.readouterr().err.rstrip(" ").endswith("s\n")
    with pytest.raises(ZeroDivisionError), progress("Working"):
        _ = 1 / 0
    assert capsys.readouterr().err.count("\n") == 1


def test_app_needs_no_notebook_packages():
    blocked = f"import sys\nfor name in {BLOCKED}: sys.modules[name] = None\n"
    code = "from app import measure, progress, show\nwith progress('x') as bar: bar(0.5)\n"
    found = subprocess.run([sys.executable, "-c", blocked + code], capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr


def test_importing_the_engine_imports_neither_app_nor_notebook_packages():
    code = (
        f"import fairing, sys\nfairing.fair\nassert not {{'app', 'viser', *{BLOCKED}}} & set(sys.modules), sys.modules"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_a_notebook_runs_to_its_end(path: Path, tmp_path: Path):
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(cell.outputs == [] and cell.execution_count is None for cell in code), "outputs are not committed"
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [output.get("data", {}) for cell in code for output in cell.outputs]
    assert any("<iframe" in data.get("text/html", "") for data in shown), "a frame is displayed"
    assert not [output for cell in code for output in cell.outputs if output.output_type == "error"]


def test_there_are_three_notebooks_and_the_guide_links_them():
    guide = (NOTEBOOKS[0].parents[2] / "app" / "guides" / "python.md").read_text(encoding="utf-8")
    assert len(NOTEBOOKS) == 3
    assert all(f"demo_scenes/notebooks/{path.name}" in guide for path in NOTEBOOKS)

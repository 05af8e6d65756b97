"""Guides and site: every link resolves, every page and section is found, every example runs as it is written."""

import ast
import functools
import importlib.util
import io
import json
import re
import shlex
import tomllib
import warnings
from contextlib import redirect_stdout
from dataclasses import fields
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pytest
import tyro

import app.guides
import fairing
import fairing.io
from app.cli.main import run
from app.guides.guide import NAMES, ROOT, Guide, guides
from app.guides.site import API, write_site
from app.lessons.reader import load_lesson
from fairing.judge.report import run_report
from fairing.run.own_files import Own, load_own
from fairing.stage_kind import StageKind
from tests.small_scene import VERTICES, corner_scene, small_options, write_corner

GUIDES = {guide.name: guide for guide in guides()}
PAPER = ROOT / "fairing" / "paper.py"
LONGEST_README = 12_500  # bytes: what a visitor reads in five minutes
WORDS = {
    "README": "castle-P19", "method": "barycentric", "accuracy": "AVX2", "captures": "VisualSFM", "debugger": "presenter",
    "python": "JupyterLab", "extending": "closeness", "files": "savez_compressed", "for_teachers": "misplaced",
}  # fmt: skip
"""A word of each guide that no docstring of the API needs to contain."""


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("guides") / "site"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_site(folder)
    return folder


def code_of(name: str, word: str) -> str:
    """The Python example of a guide that contains a word."""
    (code,) = (block for block in re.findall(r"```python\n(.*?)```", GUIDES[name].text, re.DOTALL) if word in block)
    return code


def fragments(text: str) -> set[str]:
    """The addresses of headings as GitHub forms them: lower case, no punctuation, hyphens for spaces."""
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {"".join(c for c in line.lower() if c.isalnum() or c in " -_").replace(" ", "-") for line in headings}


def test_the_room_lists_its_guides_and_they_are_all_of_the_site():
    files = {path.stem for path in (ROOT / "app" / "guides").glob("*.md")}
    assert files == set(NAMES)
    assert files | {"README", "for_teachers"} == set(GUIDES)
    assert all(f"`{name}.md`" in (app.guides.__doc__ or "") for name in files)


@pytest.mark.parametrize("guide", GUIDES.values(), ids=list(GUIDES))
def test_every_link_of_a_guide_leads_to_a_file_and_a_heading_of_the_repository(guide: Guide):
    assert guide.targets
    for target in guide.targets:
        if target.startswith("https://"):
            continue
        path, fragment = guide.file_of(target), target.partition("#")[2]
        assert path.is_file(), target
        if path.suffix == ".md" and fragment:
            assert fragment in fragments(path.read_text(encoding="utf-8")), target


def test_links_to_lines_of_the_paper_s_code_lead_to_the_functions_they_name():
    functions = {node.name: node for node in ast.parse(PAPER.read_text()).body if isinstance(node, ast.FunctionDef)}
    links = re.findall(r"\[`(\w+)`\]\(\S+paper\.py#L(\d+)-L(\d+)\)", GUIDES["method"].text)
    assert len(links) == len(re.findall(r"paper\.py#", GUIDES["method"].text)) > 9
    for name, first, last in links:
        assert (int(first), int(last)) == (functions[name].lineno, functions[name].end_lineno), name


def test_the_method_names_all_equations_in_their_order():
    found = re.findall(r"^## Equations? (\d+)(?: (?:to|and) (\d+))?:", GUIDES["method"].text, re.MULTILINE)
    numbers = [n for first, last in found for n in range(int(first), int(last or first) + 1)]
    assert numbers == list(range(1, 12))


def test_what_guides_link_to_is_installed_with_the_packages():
    patterns = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    globs = [f"{package}/{glob}" for package in ("app", "demo_scenes") for glob in patterns[package]]
    assert {"app/guides/*.md", "app/guides/templates/*"} <= set(globs)
    for guide in GUIDES.values():
        for path in {guide.file_of(target) for target in guide.targets if "://" not in target}:
            name = str(path.relative_to(ROOT))
            is_installed = path.suffix == ".py" or any(fnmatch(name, glob) for glob in globs)
            assert is_installed or (guide.name == "README" and name == "README.md"), f"{guide.name}: {name}"


def test_the_guide_to_python_names_everything_public():
    table = GUIDES["python"].text.partition("## The API in groups")[2].partition("\n## ")[0]
    named = set(re.findall(r"`(\w+)`", table))
    for package in (fairing, app):
        assert set(package.__all__) <= named, set(package.__all__) - named


def test_the_readme_is_short():
    assert (ROOT / "README.md").stat().st_size <= LONGEST_README


def test_the_readme_s_figures_are_those_of_the_table():
    def rows(text: str, capture: str) -> list[str]:
        return [cell.strip() for cell in re.findall(rf"^\| {capture}.*$", text, re.MULTILINE)[0].strip("|").split("|")]

    for capture in ("fountain-P11, 11 photos", "castle-P19, 19 photos"):
        short, whole = (rows(GUIDES[name].text, capture) for name in ("README", "accuracy"))
        assert short == [whole[0], whole[2], whole[4]]


@pytest.mark.slow
def test_the_site_has_every_guide_and_names_everything_public(site):
    for guide in GUIDES.values():
        page = (site / "guides" / f"{guide.name}.html").read_text()
        assert f"<title>{guide.title} - EigenFairing</title>" in page
        for section in guide.sections[1:]:
            assert f'id="{section.anchor}"' in page, f"{guide.name}: {section.title}"
    for name in (name for names in API.values() for name in names):
        assert (site / f"{name.replace('.', '/')}.html").exists()
    for package in (fairing, fairing.io):
        page = (site / f"{package.__name__.replace('.', '/')}.html").read_text()
        for member in package.__all__:
            assert f'id="{member}"' in page, f"{package.__name__}.{member}"


def test_every_link_and_picture_of_the_site_is_in_it_and_no_page_requests_another_host(site):
    pages = {path: path.read_text() for path in [site / "index.html", *(site / "guides").glob("*.html")]}
    links = 0
    for page, text in pages.items():
        body = re.sub(r"<(style|script)>.*?</\1>", "", text, flags=re.DOTALL)
        assert not re.findall(r'(?:src|srcset)="(?:https?:)?//', body), page.name
        for address in re.findall(r'(?:src|href)="([^"]+)"', body):
            target, _, fragment = address.partition("#")
            if target.startswith(("https://", "data:")):
                continue
            path = (page.parent / target).resolve() if target else page
            assert path.is_file(), f"{page.name}: {address}"
            if fragment:
                assert re.search(rf'(?:id|name)="{re.escape(fragment)}"', path.read_text()), f"{page.name}: {address}"
            links += 1
    assert links > 200
    for path in site.rglob("*.html"):
        assert not re.findall(r'<(?:link|script|img|iframe)\b[^>]*(?:src|href)="https?://', path.read_text()), path


@pytest.mark.parametrize("name", WORDS)
def test_the_search_contains_a_word_of_each_guide_and_its_sections(site, name):
    index, guide = (site / "search.js").read_text(), GUIDES[name]
    assert WORDS[name].lower() in index.lower()
    assert f'"fullname": {json.dumps(guide.title)}' in index
    for section in guide.sections[1:]:
        assert f'"qualname": "{section.anchor}"' in index, section.title
        assert f'"fullname": {json.dumps(f"{guide.title}: {section.title}")}' in index


def test_a_folder_of_somebody_else_is_refused_with_one_line(tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("mine")
    assert run(["docs", "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.slow
def test_the_command_writes_the_site(tmp_path, capsys):
    assert run(["docs", "--out", str(tmp_path / "site")]) == 0
    assert (tmp_path / "site" / "guides" / "method.html").is_file()
    assert str(tmp_path / "site" / "index.html") in capsys.readouterr().err.replace("\n", "")


def test_without_pdoc_one_line_says_what_to_install(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert run(["docs", "--out", str(tmp_path / "site")]) == 1
    assert re.fullmatch(r"eigenfairing: docs: .*pip install .*docs.*\n", capsys.readouterr().err)
    assert not (tmp_path / "site").exists()


def commands() -> list[tuple[str, str]]:
    """The lines of all guides that call the program."""
    blocks = [(n, b) for n, guide in GUIDES.items() for b in re.findall(r"^```sh\n(.*?)^```", guide.text, re.M | re.S)]
    return [(name, line) for name, block in blocks for line in block.splitlines() if line.startswith("eigenfairing ")]


@pytest.mark.parametrize("name", [n for n, guide in GUIDES.items() if "\neigenfairing " in guide.text])
def test_every_command_of_a_guide_is_understood(name, monkeypatch):
    parse = tyro.extras.subcommand_cli_from_dict

    def parse_alone(subcommands, **how):
        return parse({n: functools.wraps(f)(lambda *_, **__: 0) for n, f in subcommands.items()}, **how)

    monkeypatch.setattr(tyro.extras, "subcommand_cli_from_dict", parse_alone)
    lines = [line for guide, line in commands() if guide == name]
    assert lines
    for line in lines:
        assert run(shlex.split(line, comments=True)[1:]) == 0, line
    with pytest.raises(SystemExit):
        run(["fair", "cube", "--out", "run", "--no-such-flag"])


def test_the_converter_of_the_guide_writes_a_capture_that_is_loaded(tmp_path, monkeypatch):
    write_corner(tmp_path / "capture")
    scene = fairing.load_scene(tmp_path / "capture")
    lines = []
    for view in scene.views:
        camera = view.camera
        assert np.isclose(camera.K[0, 0], camera.K[1, 1])
        numbers = [
            camera.K[0, 0],
            *camera.K[:2, 2],
            *camera.camera_from_world[:, :3].ravel(),
            *camera.camera_from_world[:, 3],
        ]
        lines.append(" ".join(map(str, [f"images/{view.name}", camera.width, camera.height, *numbers])))
    for matrix in (tmp_path / "capture" / "images").glob("*.txt"):
        matrix.unlink()
    (tmp_path / "capture" / "my_cameras.txt").write_text("\n".join(lines))
    monkeypatch.chdir(tmp_path)
    exec(code_of("extending", "my_cameras.txt"), {})
    found = fairing.load_scene("capture")
    assert len(found.views) == len(scene.views)
    for before, after in zip(scene.views, found.views, strict=True):
        expected, read = (view.camera.project(VERTICES)[0] for view in (before, after))
        np.testing.assert_allclose(read, expected, atol=1e-6)  # px


def test_the_reader_of_the_guide_reads_a_trace_without_the_program(tmp_path, monkeypatch):
    session = fairing.Session(corner_scene(), small_options())
    session.trace.attach(tmp_path / "run.trace")
    for _ in range(3):
        session.step()
    session.trace.detach()
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    code = code_of("files", "run.trace")
    assert "fairing" not in code
    with redirect_stdout(io.StringIO()):
        exec(code, names)
    assert names["header"]["scene"] == "corner"
    assert not np.array_equal(session.vertices, session.trace.start)
    np.testing.assert_array_equal(names["vertices"], session.vertices)


def test_the_tables_of_the_guide_name_all_arrays_of_a_step_and_all_keys_of_a_report(tmp_path):
    step = {field.name for field in fields(fairing.StepRecord)}
    part = GUIDES["files"].text.partition("## The trace")[2].partition("## Flips")[0]
    assert step == {name for row in re.findall(r"^\| (`.*?) \|", part, re.M) for name in re.findall(r"`(\w+)`", row)}
    report = run_report(fairing.Session(corner_scene(), small_options()), "accurate", {}, {})
    part = GUIDES["files"].text.partition("## The report")[2].partition("## Block files")[0]
    keys = {name for row in re.findall(r"^\| (`.*?) \|", part, re.M) for name in re.findall(r"`(\w+)`", row)}
    assert keys == set(report) | {"left_out"}


def own_of(guide: str, word: str, folder: Path) -> Own:
    file = folder / "mine.py"
    file.write_text(code_of(guide, word))
    return load_own([file])


@pytest.mark.compiled
@pytest.mark.parametrize(("guide", "word"), [("extending", "Closeness"), ("python", "Rigidity")])
def test_the_terms_of_the_guides_pull(tmp_path, guide: str, word: str):
    session = fairing.Session(corner_scene(), small_options(), terms=own_of(guide, word, tmp_path).terms)
    session.step()
    assert word.lower() in {pull.name for pull in session.pulls()}


@pytest.mark.compiled
def test_the_norm_and_the_plan_of_the_guide_change_a_run(tmp_path):
    plain = fairing.Session(corner_scene(), small_options()).step()
    with_norm = fairing.Session(corner_scene(), small_options(), norm=own_of("extending", "Welsch", tmp_path).norm)
    step = with_norm.step()
    assert plain is not None
    assert step is not None
    assert (step.after != plain.after).any()
    planned = fairing.fair(corner_scene(), small_options(), plan=own_of("extending", "plan = [", tmp_path).plan)
    assert planned.finished
    assert {StageKind.SMOOTHNESS, StageKind.JUDGE, StageKind.PHOTOS} == {step.stage for step in planned.trace.steps}


@pytest.mark.slow
def test_the_step_of_the_guide_fits_into_the_template_of_a_lesson(tmp_path, capsys):
    template = (ROOT / "app" / "lessons" / "template.md").read_text(encoding="utf-8")
    step = re.findall(r"^````text\n(.*?)^````$", GUIDES["extending"].text, re.M | re.S)[0]
    before, end, rest = template.partition("# The end\n")
    lesson = tmp_path / "my.md"
    lesson.write_text(f"{before}{step}\n{end}{rest}")
    assert len(load_lesson(str(lesson)).steps) == 1 + template.count("\n# ")
    assert run(["export", "--lesson", str(lesson), "--out", str(tmp_path / "my.html")]) == 0
    assert "claims verified" in capsys.readouterr().err


@pytest.mark.slow
def test_the_experiment_of_the_guide_runs_as_it_is_written():
    with redirect_stdout(io.StringIO()) as printed:
        exec(code_of("extending", "FewerPhotos"), {"__name__": "__main__"})
    assert re.fullmatch(r"12 photos: \S+ %, 8 photos: \S+ %, 5 photos: \S+ %\n", printed.getvalue())
    assert float(printed.getvalue().split()[2]) < 0.1  # % of the edge


@pytest.mark.slow
def test_the_steps_of_the_guide_run_as_they_are_written():
    names: dict = {}
    with redirect_stdout(io.StringIO()) as printed:
        exec(code_of("python", "face_cells("), names)
    assert printed.getvalue().startswith("0:0:0:0 ")
    assert names["record"].energy_after < names["record"].energy_before
    assert names["session"].moment == 0

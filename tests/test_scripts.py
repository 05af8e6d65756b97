"""Scripts: modules joined to one script, called with JSON, linted."""

import ast
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from app.scripts import script, script_call

ROOT = Path(__file__).parents[1]
MODULES = sorted((ROOT / "app").rglob("web/*.js"))
EXPORT = re.compile(r"^export (?:async )?(?:function|class|const|let) ([\w$]+)", re.MULTILINE)
JAVASCRIPT = re.compile(
    r"=>|\bfunction\b ?\w*\(|\b(?:document|window|event)\.(?!html)\w|addEventListener|setTimeout|querySelector|\bthis\."
)
PAGES = ("export/web/replay.js", "export/web/comparison.js", "lesson_pages/web/lesson.js")


def test_a_module_follows_those_that_it_imports_and_each_comes_once():
    source = script("lesson_pages/web/lesson.js")
    places = [source.index(start) for start in ("const $ =", "class Viewer", "class LessonViewer", "function goToStep")]
    assert places == sorted(places)
    assert source.count("class Plot ") == source.count("const $ =") == 1
    assert not re.search(r"^(import|export) ", source, re.MULTILINE)


@pytest.mark.parametrize("path", PAGES)
def test_modules_that_meet_in_a_script_declare_no_name_twice(path: str):
    names = re.findall(r"^(?:async )?(?:function|class|const|let) ([\w$]+)", script(path), re.MULTILINE)
    assert len(names) == len(set(names)) > 1
    assert "</script" not in script(path), "it would end the element"


def test_parameters_are_json_whatever_they_contain():
    hostile = {"name": "a\"b'\\ </script>\u2028%s ${x}`"}
    source = script_call("viser_bridge/web/line_node.js", "drawInFront", **hostile)
    call = re.search(r"^drawInFront\((.*)\);$", source, re.MULTILINE)
    assert call
    assert json.loads(call.group(1)) == hostile
    with pytest.raises(ValueError, match="not JSON compliant"):
        script_call("viser_bridge/web/line_node.js", "drawInFront", name=float("nan"))


def test_every_exported_name_is_imported_or_called_from_python():
    python = "".join(path.read_text() for path in (ROOT / "app").rglob("*.py"))
    imported = {
        name.strip()
        for module in MODULES
        for names in re.findall(r"^import \{([^}]*)\}", module.read_text(), re.MULTILINE)
        for name in names.split(",")
    }
    unused = [
        f"{module.name}: {name}"
        for module in MODULES
        for name in EXPORT.findall(module.read_text())
        if name not in imported and f'"{name}"' not in python
    ]
    assert MODULES
    assert unused == []


def test_python_holds_no_javascript_but_calls():
    found = [
        f"{path.relative_to(ROOT)}:{node.lineno}: {node.value[:60]}"
        for path in (ROOT / "app").rglob("*.py")
        if path.name != "scripts.py"
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and JAVASCRIPT.search(node.value)
    ]
    assert found == []


def test_every_script_is_part_of_the_package():
    patterns = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    for module in MODULES:
        package = ".".join(module.parents[1].relative_to(ROOT).parts)
        assert "web/*" in patterns[package], module


def test_modules_have_no_faults_that_the_linter_finds():
    linter = Path(sys.executable).with_name("oxlint")
    done = subprocess.run([linter, "app"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout

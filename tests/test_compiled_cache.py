"""numba's cache on disk: nothing is reused after a change of code that it depends on, and what is reused computes the same."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import demo_scenes
import fairing
from fairing.kernels import compiled
from fairing.kernels.faces import evaluate_faces, show_face
from fairing.texture import eigen, fusion, samples, texels
from fairing.util.source_hash import source_hash

FILES = [
    path
    for package in (fairing, demo_scenes)
    for path in sorted(Path(str(package.__file__)).parent.rglob("*.py"))
    if "njit" in path.read_text()
]

RUN = """
from fairing.run.session import Session
from tests.small_scene import corner_scene, small_options
session = Session(corner_scene(), small_options())
session.run()
print(session.vertices.tobytes().hex())
"""


def is_cached(function: ast.FunctionDef) -> bool:
    return any("cache=True" in ast.unparse(decorator) for decorator in function.decorator_list)


def names_of(function: ast.FunctionDef, functions: dict[str, ast.FunctionDef]) -> set[str]:
    """The names that a function reads, and those that the functions of its file read that it calls."""
    names: set[str] = set()
    pending = [function]
    while pending:
        current = pending.pop()
        found = {node.id for node in ast.walk(current) if isinstance(node, ast.Name)} - names
        names |= found
        pending += [functions[name] for name in found if name in functions and functions[name] is not current]
    return names


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_cached_functions_depend_on_their_own_file_or_close_over_the_source_hash(path: Path):
    tree = ast.parse(path.read_text())
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    imported = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and str(node.module).split(".")[0] in ("fairing", "demo_scenes")
        for alias in node.names
    }
    for function in filter(is_cached, functions.values()):
        assert not names_of(function, functions) & (imported - {"COMPILED_ONLY"}), function.name


def test_functions_that_use_other_files_close_over_the_source_hash():
    for source, functions in (
        (compiled.SOURCE, (evaluate_faces, show_face)),
        (texels.SOURCE, (samples.look_up, fusion.fuse, fusion.multiply, eigen.explain, eigen.compose)),
    ):
        for function in functions:
            assert source in [cell.cell_contents for cell in function.py_func.__closure__]


def test_the_source_hash_changes_with_any_python_file(tmp_path: Path):
    (tmp_path / "one.py").write_text("A = 1\n")
    (tmp_path / "two.py").write_text("B = 2\n")
    before = source_hash(tmp_path)
    (tmp_path / "notes.md").write_text("nothing")
    assert source_hash(tmp_path) == before
    (tmp_path / "two.py").write_text("B = 3\n")
    assert source_hash(tmp_path) != before


@pytest.mark.slow
def test_a_process_that_compiles_and_one_that_loads_end_alike_to_the_bit(tmp_path: Path):
    """LLVM optimises a function again where it is linked to another, and may then round sums differently."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    root = Path(__file__).parents[1]
    compiling, loading = (
        subprocess.run(
            [sys.executable, "-c", RUN], env=environment, cwd=root, capture_output=True, text=True, check=True
        )
        for _ in range(2)
    )
    assert any(tmp_path.rglob("faces.*evaluate_faces*.nbc"))
    assert compiling.stdout
    assert compiling.stdout == loading.stdout

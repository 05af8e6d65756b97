"""The rooms of the packages: which room may import which. The guide `extending.md` lists them for readers."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MOST_LOOSE_MODULES = 20

DATA = {"fairing"}
"""The loose modules of `fairing` without `api`: scene, mesh, camera, options, trace and what they need."""

ALLOWED: dict[str, set[str]] = {
    "fairing": {"fairing.util"},
    "fairing.util": {"fairing.errors"},
    "fairing.kernels": {"fairing.util"},
    "fairing.norms": DATA | {"fairing.kernels"},
    "fairing.geometry": DATA | {"fairing.util"},
    "fairing.cells": DATA | {"fairing.util", "fairing.geometry", "fairing.kernels", "fairing.norms"},
    "fairing.solve": DATA
    | {"fairing.features", "fairing.geometry", "fairing.cells", "fairing.kernels", "fairing.norms"},
    "fairing.placement": DATA | {"fairing.geometry"},
    "fairing.optimize": set(),
    "fairing.terms": DATA
    | {"fairing.util", "fairing.optimize", "fairing.geometry", "fairing.features", "fairing.creases"},
    "fairing.cameras": DATA | {"fairing.optimize", "fairing.features"},
    "fairing.creases": DATA | {"fairing.geometry"},
    "fairing.run": DATA
    | {
        "fairing.cameras",
        "fairing.creases",
        "fairing.features",
        "fairing.optimize",
        "fairing.terms",
        "fairing.geometry",
        "fairing.cells",
        "fairing.norms",
        "fairing.solve",
        "fairing.placement",
        "fairing.io",
        "fairing.util",
    },
    "fairing.judge": DATA
    | {
        "fairing.util",
        "fairing.geometry",
        "fairing.creases",
        "fairing.cells",
        "fairing.features",
        "fairing.optimize",
        "fairing.terms",
        "fairing.kernels",
        "fairing.norms",
        "fairing.solve",
        "fairing.run",
    },
    "fairing.check": DATA | {"fairing.geometry", "fairing.cameras", "fairing.cells", "fairing.placement"},
    "fairing.registration": DATA | {"fairing.geometry"},
    "fairing.texture": DATA | {"fairing.util", "fairing.geometry", "fairing.kernels"},
    "fairing.triangulation": DATA
    | {
        "fairing.util",
        "fairing.geometry",
        "fairing.cells",
        "fairing.solve",
        "fairing.features",
        "fairing.optimize",
        "fairing.terms",
    },
    "fairing.io": DATA
    | {
        "fairing.cameras",
        "fairing.util",
        "fairing.geometry",
        "fairing.check",
        "fairing.features",
        "fairing.mesh_formats",
        "fairing.registration",
        "fairing.texture",
        "fairing.placement",
        "fairing.triangulation",
    },
    "fairing.structure": DATA
    | {"fairing.util", "fairing.geometry", "fairing.io", "fairing.placement", "fairing.triangulation"},
    "fairing.features": DATA | {"fairing.util", "fairing.geometry"},
    "fairing.mesh_formats": DATA | {"fairing.util", "fairing.geometry"},
    "fairing.experiments": DATA
    | {"fairing.util", "fairing.geometry", "fairing.io", "fairing.solve", "fairing.run", "fairing.judge"},
    "fairing.api": {"fairing", "fairing.norms", "fairing.run", "fairing.terms"},
    "fairing.paper": DATA | {"fairing.geometry", "fairing.cells"},
    "demo_scenes": DATA | {"fairing.util", "fairing.geometry"},
    "demo_scenes.building": DATA | {"demo_scenes", "fairing.geometry", "fairing.triangulation"},
    "demo_scenes.range_data": DATA | {"demo_scenes", "fairing.geometry", "fairing.registration"},
    "demo_scenes.terms": {"fairing"},
    "demo_scenes.norms": {"fairing"},
    "demo_scenes.plans": {"fairing"},
    "app": DATA | {"fairing.util", "fairing.geometry", "fairing.judge", "app.cli.main"},
    "app.debugger": {"app", "engine"},
    "app.viser_bridge": {"app", "fairing"},
    "app.files": {"app", "app.pictures", "engine", "demo_scenes"},
    "app.page_state": {"app", "app.debugger", "app.viser_bridge", "engine"},
    "app.pictures": {"app", "app.debugger", "app.page_state", "engine"},
    "app.experiments": {"app", "app.files", "engine"},
    "app.lessons": {"app", "app.debugger", "app.page_state", "app.files", "app.pictures", "engine", "demo_scenes"},
    "app.layers": {"app", "app.debugger", "app.page_state", "app.viser_bridge", "app.pictures", "engine"},
    "app.panels": {
        *("app", "app.debugger", "app.page_state", "app.viser_bridge", "app.pictures", "app.lessons"),
        *("app.experiments", "engine"),
    },
    "app.page": {
        *("app", "app.debugger", "app.page_state", "app.viser_bridge", "app.pictures", "app.layers", "app.panels"),
        *("app.lessons", "app.experiments", "app.export", "app.files", "engine"),
    },
    "app.export": {"app", "app.debugger", "app.files", "app.pictures", "engine"},
    "app.lesson_pages": {
        *("app", "app.debugger", "app.page_state", "app.pictures", "app.layers", "app.panels", "app.lessons"),
        *("app.experiments", "app.export", "engine", "demo_scenes"),
    },
    "app.guides": {"app", "app.lessons", "fairing", "fairing.io"},
    "app.notebook": {
        *(
            "app",
            "app.debugger",
            "app.files",
            "app.experiments",
            "app.panels",
            "app.export",
            "app.page",
            "app.viser_bridge",
        ),
        "engine",
    },
    "app.flips": {
        *(
            "app",
            "app.debugger",
            "app.files",
            "app.viser_bridge",
            "app.pictures",
            "app.page_state",
            "app.layers",
            "app.panels",
        ),
        *("app.page", "engine", "demo_scenes"),
    },
    "app.cli": {
        *("app", "app.debugger", "app.viser_bridge", "app.page_state", "app.files", "app.pictures", "app.experiments"),
        *(
            "app.lessons",
            "app.export",
            "app.guides",
            "app.lesson_pages",
            "app.page",
            "app.flips",
            "engine",
            "demo_scenes",
            "demo_scenes.range_data",
        ),
    },
}
"""The rooms that a room's modules may import besides their own. "engine": any room of `fairing`. A loose module's full
name allows that module alone."""

USES_VISER = {"app.viser_bridge", "app.page", "app.layers", "app.panels", "app.flips", "app.cli"}


def modules(*packages: str) -> dict[str, Path]:
    """Path of every module by its dotted name, without those of the example plugin, which is a package of its own."""
    found = {}
    for package in packages:
        for path in sorted((ROOT / package).rglob("*.py")):
            if ROOT / "demo_scenes" / "plugin" in path.parents:
                continue
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules("fairing", "app", "demo_scenes")
ROOMS = {name for name, path in MODULES.items() if path.name == "__init__.py"}


def room_of(module: str) -> str:
    """The package that holds a module. `fairing.api` and `fairing.paper` stand on top of rooms, so they count as rooms."""
    if module in ("fairing.api", "fairing.paper") or module in ROOMS:
        return module
    return module.rpartition(".")[0]


def imports_of(path: Path) -> set[str]:
    """Dotted names of all modules that a file imports, also inside functions; imports for type checkers alone excepted."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = []
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if name in MODULES else node.module for name in names}
    return found


@pytest.mark.parametrize("module", sorted(MODULES))
def test_every_import_follows_the_table_of_rooms(module):
    room = room_of(module)
    if module == "fairing":
        return  # the public names of the package, imported on first use
    assert room in ALLOWED, f"{room} is no room of the table"
    allowed = ALLOWED[room] | {room}
    for imported in imports_of(MODULES[module]):
        if imported.split(".")[0] not in ("fairing", "app", "demo_scenes"):
            continue
        target = room_of(imported)
        is_engine = "engine" in allowed and imported.split(".")[0] == "fairing"
        assert target in allowed or imported in allowed or is_engine, f"{module} imports {imported}"


def test_the_rooms_import_each_other_in_one_direction_only():
    graph: dict[str, set[str]] = {}
    for module, path in MODULES.items():
        if module in ("fairing", "app.__main__"):
            continue
        edges = {room_of(name) for name in imports_of(path) if name in MODULES} - {room_of(module)}
        # The file formats of `fairing.util` raise the errors of the loose modules.
        graph.setdefault(room_of(module), set()).update(edges - ({"fairing"} if "util" in module else set()))
    done: set[str] = set()

    def visit(room: str, path: tuple[str, ...]) -> None:
        assert room not in path, " -> ".join((*path, room))
        if room not in done:
            for other in sorted(graph.get(room, ())):
                visit(other, (*path, room))
            done.add(room)

    for room in sorted(graph):
        visit(room, ())


@pytest.mark.parametrize("package", ["fairing", "app"])
def test_few_modules_lie_loose_beside_the_rooms(package):
    loose = [path for path in (ROOT / package).glob("*.py") if not path.name.startswith("__")]
    assert len(loose) <= MOST_LOOSE_MODULES, sorted(path.name for path in loose)


@pytest.mark.parametrize("room", sorted(ROOMS))
def test_every_room_says_what_belongs_in_it(room):
    docstring = ast.get_docstring(ast.parse(MODULES[room].read_text(encoding="utf-8")))
    assert docstring, f"{room} has no docstring"


def test_the_engine_imports_neither_the_app_nor_viser():
    for module in MODULES:
        if module.split(".")[0] == "fairing":
            heads = {name.split(".")[0] for name in imports_of(MODULES[module])}
            assert not heads & {"app", "viser", "demo_scenes"}, module


def test_only_the_page_imports_viser():
    users = {room_of(m) for m, path in MODULES.items() if any(n.split(".")[0] == "viser" for n in imports_of(path))}
    assert users <= USES_VISER, users - USES_VISER


def test_no_test_imports_another_test_module():
    for name, path in modules("tests").items():
        borrowed = {i for i in imports_of(path) if i.startswith("tests.") and i.rpartition(".")[2].startswith("test_")}
        assert not borrowed, f"{name} imports {borrowed}"


def test_importing_the_mathematics_of_a_test_needs_no_browser():
    for name, path in modules("tests").items():
        if not name.startswith("tests.browser") and (name.rpartition(".")[2].startswith("test_") or "conftest" in name):
            heads = {i for i in imports_of(path) if i.startswith(("playwright", "tests.browser"))}
            assert not heads, f"{name} imports {heads}"

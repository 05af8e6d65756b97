"""The example plugin as if it were installed: its package and the entry points that its pyproject.toml declares."""

import shutil
import tomllib
from pathlib import Path

import demo_scenes

SOURCE = Path(demo_scenes.__file__).parent / "plugin"


def install_plugin(folder: Path) -> None:
    """Put the plugin into a folder of the module search path."""
    shutil.copytree(SOURCE / "eigenfairing_example", folder / "eigenfairing_example")
    project = tomllib.loads((SOURCE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    info = folder / f"eigenfairing_example-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    lines = []
    for group, entries in project["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {value}" for name, value in entries.items()), ""]
    (info / "entry_points.txt").write_text("\n".join(lines))

"""What the commands print reaches every terminal: what its encoding lacks is escaped."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.small_scene import write_corner

QUICK = ["--points", "none", "--schedule.blur", "2", "--schedule.max-sweeps", "1", "--cells.size", "16"]
NAME = "fassäde-\u5efa"
ESCAPED = r"fass\xe4de-\u5efa"


def said(encoding: str, *arguments: str) -> tuple[int, str]:
    """Exit code, and all that is printed."""
    done = subprocess.run(
        [sys.executable, "-m", "app", *arguments],
        env={**os.environ, "PYTHONIOENCODING": encoding, "COLUMNS": "400"},
        capture_output=True,
        timeout=600,
    )
    return done.returncode, (done.stdout + done.stderr).decode("latin-1")


@pytest.mark.slow
def test_paths_that_the_terminal_cannot_show_are_escaped_by_every_command(tmp_path: Path):
    scene = tmp_path / NAME
    write_corner(scene)
    out = {name: str(tmp_path / f"{NAME}-{name}") for name in ("check", "run", "copy")}
    model, page, flips = (str(tmp_path / f"{NAME}{suffix}") for suffix in (".glb", ".html", ".ply"))
    commands = {
        "check": ["check", str(scene), "--out", out["check"]],
        "fair": ["fair", str(scene), "--out", out["run"], *QUICK],
        "fair of none": ["fair", str(tmp_path / NAME / "none"), "--out", out["run"]],
        "export": ["export", out["run"], "--out", page],
        "texture": ["texture", str(scene), "--out", model],
        "convert": ["convert", str(scene), "--out", out["copy"]],
        "triangulate": ["triangulate", str(scene), "--mesh", str(scene / "mesh.obj"), "--out", flips],
        "replay": ["replay", str(tmp_path / NAME / "none.trace")],
    }
    for name, command in commands.items():
        code, text = said("ascii", *command)
        assert "Traceback" not in text, (name, text[-2000:])
        assert ESCAPED in text, (name, text[-2000:])
        is_wrong = "none" in name or name == "replay" or "verdict: not usable" in text
        assert code == int(is_wrong), (name, text[-2000:])


@pytest.mark.slow
def test_what_the_encoding_has_is_printed_as_it_is(tmp_path: Path):
    write_corner(tmp_path / NAME)
    code, text = said(
        "cp1252", "check", str(tmp_path / NAME), "--out", str(tmp_path / f"{NAME}-check"), "--points", "none"
    )
    assert code == 0, text
    assert r"fassäde-\u5efa-check" in text
    assert "Traceback" not in text


@pytest.mark.slow
def test_help_and_lists_are_printed_in_ascii():
    for command in (["--help"], ["demos"], ["experiment"]):
        code, text = said("ascii", *command)
        assert code == 0, text
        assert "Traceback" not in text

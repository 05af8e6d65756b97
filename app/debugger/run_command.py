"""Run command: the command lines that make a run and its exports without the page."""

import shlex
from pathlib import Path
from typing import Any

from app.debugger.option_fields import OptionField, option_fields
from fairing.options import PRESETS, FairingOptions

RUN_FOLDER = "run"  # that the commands write to


def fair_command(scene_name: str, header: dict[str, Any], options: FairingOptions) -> str:
    """`eigenfairing fair` with the scene that the header of a trace names, and the options that differ from a preset's."""
    source = header.get("source")
    named = source if isinstance(source, dict) else {}
    words = ["eigenfairing", "fair", str(named.get("scene") or scene_name)]
    if named.get("mesh"):
        words += ["--mesh", str(named["mesh"])]
    changed = {name: [f for f in option_fields() if f.of(preset) != f.of(options)] for name, preset in PRESETS.items()}
    nearest = min(changed, key=lambda name: len(changed[name]))
    if nearest != next(iter(PRESETS)):
        words += ["--preset", nearest]
    for field in changed[nearest]:
        words += _flag(field, options)
    return shlex.join([*words, "--out", RUN_FOLDER])


def export_command(record: Path | None, *arguments: str) -> str:
    """`eigenfairing export` of the record of a run, or of the folder that `fair_command` writes."""
    return shlex.join(["eigenfairing", "export", str(record or RUN_FOLDER), "--out", *arguments])


def _flag(field: OptionField, options: FairingOptions) -> list[str]:
    name, value = ".".join(field.path).replace("_", "-"), field.of(options)
    if isinstance(value, bool):
        head, _, last = name.rpartition(".")
        no = "" if value else "no-"
        return [f"--{head}.{no}{last}" if head else f"--{no}{last}"]
    return [f"--{name}", *(map(str, value) if isinstance(value, tuple) else [str(value)])]

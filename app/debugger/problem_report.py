"""Problem report: a JSON file with incidents, options, scene facts and the last commands, for the developers."""

import json
import platform
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from app.debugger.commands import Command
from app.debugger.incidents import Incident
from app.debugger.run_state import RunState
from fairing.io import write_atomically
from fairing.judge.report import versions
from fairing.options import options_to_dict
from fairing.scene import Scene

MAX_COMMAND = 400  # characters of a command's text; a manual move of many vertices is longer
STEM = "eigenfairing"  # of the file's name, for a run without a record


def report_path(record: Path | None) -> Path:
    """The report's file: beside a record `run.trace` it is `run.report.json`, else in the current folder.

    A report replaces the previous one, so that repeated requests do not fill the disk.
    """
    return Path(f"{STEM}.report.json") if record is None else record.with_suffix(".report.json")


def problem_report(
    scene: Scene,
    state: RunState,
    incidents: Iterable[Incident],
    commands: Iterable[Command],
    stacks: Mapping[str, str],
) -> dict[str, Any]:
    """The report as JSON values.

    Args:
        commands: the last ones, the newest last.
        stacks: the call stacks of the threads, by name.
    """
    return {
        "time": time.strftime("%Y-%m-%dT%H:%M:%S"),
        "versions": versions(),
        "platform": platform.platform(),
        "scene": {
            "name": scene.name,
            "vertices": len(scene.mesh.vertices),
            "faces": len(scene.mesh.faces),
            "photos": [[view.name, view.camera.width, view.camera.height] for view in scene.views],
        },
        "options": options_to_dict(state.options),
        "run": {
            "run_id": state.run_id,
            "runs": len(state.runs),
            "moment": state.moment,
            "length": state.length,
            "position": list(state.position),
            "activity": state.activity.value,
            "reason": state.reason,
            "problem": state.problem,
        },
        "incidents": [vars(incident) for incident in incidents],
        "commands": [f"{command!r:.{MAX_COMMAND}}" for command in commands],
        "threads": dict(stacks),
    }


def write_report(path: Path, report: Mapping[str, Any]) -> None:
    """Write a report atomically.

    Raises:
        InputError: the file cannot be written.
    """
    text = json.dumps(report, indent=1, ensure_ascii=False, default=str)
    write_atomically(path, lambda file: file.write(text.encode()))

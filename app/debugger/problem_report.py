"""Problem report: a JSON file with incidents, options, scene facts and the last commands, for the developers."""

import json
import platform
import re
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from app.debugger.commands import Command
from app.debugger.incidents import Incident
from app.debugger.run_state import RunState
from fairing.errors import InputError
from fairing.io import write_atomically
from fairing.judge.report import versions
from fairing.options import options_to_dict
from fairing.scene import Scene
from fairing.util.cache_folder import cache_folder

MAX_COMMAND = 400  # characters of a command's text; a manual move of many vertices is longer
MAX_NAME = 80  # characters of a scene's name in the file's name


def report_path(record: Path | None, scene: str) -> Path:
    """The report's file: beside a record `run.trace` it is `run.report.json`, else in the user's cache folder.

    A report replaces the previous one, so that repeated requests do not fill the disk.

    Args:
        scene: the scene's name, part of the file's name where there is no record.
    """
    if record is not None:
        return record.with_suffix(".report.json")
    name = re.sub(r"[^\w.-]+", "_", scene)[:MAX_NAME]
    return cache_folder() / "reports" / f"{name}.report.json"


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
    """Write a report atomically; missing folders are created.

    Raises:
        InputError: the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: could not be written ({error.strerror}); choose another folder") from None
    text = json.dumps(report, indent=1, ensure_ascii=False, default=str)
    write_atomically(path, lambda file: file.write(text.encode()))

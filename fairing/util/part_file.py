"""Part files: what is written beside a file until it is complete, and what killed runs left of them."""

import os
import re
from contextlib import suppress
from pathlib import Path

_PART = re.compile(r"\.(?P<name>.+)\.(?P<pid>\d+)\.part")
_OLD_PART = re.compile(r".+\.(trace|flips)\.part")
"""Names of part files up to version 0.1: without a process id, and only of records."""


def part_path(path: Path) -> Path:
    """Where this process writes a file before renaming it to `path`."""
    return path.with_name(f".{path.name}.{os.getpid()}.part")


def remove_parts_of(path: Path) -> None:
    """Remove the part files of `path` that killed processes left behind."""
    with suppress(OSError):
        for entry in os.scandir(path.parent):
            match = _PART.fullmatch(entry.name)
            if match and match["name"] == path.name:
                _remove_if_left_over(Path(entry.path), int(match["pid"]))


def remove_parts_in(folder: Path) -> None:
    """Remove all part files in an output folder of ours, and below it, that killed processes left behind."""
    for parent, _, names in os.walk(folder):
        for name in names:
            if match := _PART.fullmatch(name):
                _remove_if_left_over(Path(parent, name), int(match["pid"]))
            elif _OLD_PART.fullmatch(name):
                _remove_if_left_over(Path(parent, name), None)


def sync_folder(folder: Path) -> None:
    """Make sure that renames in a folder survive a crash of the machine, where the file system supports it."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _remove_if_left_over(part: Path, pid: int | None) -> None:
    if pid is not None and pid != os.getpid() and _is_running(pid):
        return
    with suppress(OSError):
        part.unlink(missing_ok=True)


def _is_running(pid: int) -> bool:
    if os.name == "nt":  # where signal 0 would end the process
        return True
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # a process of another user
        return True
    return True

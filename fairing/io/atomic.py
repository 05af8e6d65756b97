"""Atomic file writing: a file appears complete or not at all."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from fairing.errors import InputError
from fairing.util.part_file import part_path, remove_parts_of, sync_folder


def write_atomically(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Write a part file with `write`, then rename it: a reader sees the old file or the complete new one.

    Raises:
        InputError: the folder is missing or not writable, or the disk is full. The old file is unchanged then, and no
            part file is left.
    """
    part = part_path(path)
    try:
        remove_parts_of(path)
        with part.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
        sync_folder(path.parent)
    except BaseException as error:
        _discard(part)
        if isinstance(error, OSError):
            raise InputError(f"{path}: could not be written ({error.strerror or error}); {_remedy(path)}") from None
        raise


def _discard(part: Path) -> None:
    try:
        part.unlink(missing_ok=True)
    except (OSError, ValueError):  # a name too long, or with a NUL
        return


def _remedy(path: Path) -> str:
    if not path.parent.is_dir():
        return f"create the folder {path.parent}"
    free = shutil.disk_usage(path.parent).free
    return f"free space ({free / 1e6:.0f} MB left there) or choose another folder"

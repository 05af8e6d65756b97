"""Files appear complete or not at all."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from fairing.errors import InputError


def write_atomically(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Let `write` fill a file beside `path`, then rename it: whoever looks sees the old file or the new one.

    Raises:
        InputError: the folder is missing or not writable, or the disk is full. The old file is untouched then, and
            nothing half-written is left behind.
    """
    aside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with aside.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        aside.replace(path)
    except BaseException as error:
        aside.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise InputError(f"{path}: could not be written ({error.strerror or error}); {_remedy(path)}") from None
        raise


def _remedy(path: Path) -> str:
    if not path.parent.is_dir():
        return f"create the folder {path.parent}"
    free = shutil.disk_usage(path.parent).free
    return f"free space ({free / 1e6:.0f} MB left there) or choose another folder"

"""The folder that results go to: never one that holds somebody's other work."""

from pathlib import Path

from fairing.errors import InputError
from fairing.io.capture import listed, reading

_MARKER = ".eigenfairing"


def prepare_output_folder(path: Path) -> None:
    """Create the folder, or make sure that it is empty or was made by us, and mark it as ours.

    Raises:
        InputError: it holds other content, is a file, or cannot be created. Nothing is written then.
    """
    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: expected a folder for the results, found a file; choose another folder")
    if path.is_dir():
        with reading(path, "a folder for the results"):
            content = sorted(entry.name for entry in path.iterdir())
        if content and _MARKER not in content:
            raise InputError(
                f"{path}: expected an empty or new folder for the results, found {listed(content)}; choose another"
            )
    try:
        path.mkdir(parents=True, exist_ok=True)
        (path / _MARKER).write_text("EigenFairing writes its results here and may replace them.\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: could not be created ({error.strerror or error}); choose another folder") from None

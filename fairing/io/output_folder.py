"""Output folders: marked as ours, never a folder that holds other work, and written by one process at a time."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from fairing.errors import InputError
from fairing.io.capture import listed, reading
from fairing.util.file_lock import locked
from fairing.util.part_file import remove_parts_in

_MARKER = ".eigenfairing"


@contextmanager
def locked_output_folder(path: Path) -> Iterator[None]:
    """A folder that only this process writes to while the `with` block runs; see `prepare_output_folder`.

    A new folder is removed again if the block raises and has written nothing.

    Raises:
        InputError: as `prepare_output_folder`; or another process writes to the folder.
    """
    was_there = path.exists()
    prepare_output_folder(path)
    with ExitStack() as lock:
        try:
            lock.enter_context(locked(path / _MARKER))
        except BlockingIOError:
            raise InputError(
                f"{path}: another process is writing its results there; wait for its end, or choose another folder"
            ) from None
        try:
            yield
        except BaseException:
            if not was_there:
                _remove_if_empty(path)
            raise


def prepare_output_folder(path: Path) -> None:
    """Create the folder or accept an empty or marked one, mark it, and remove part files that killed runs left in it.

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
        remove_parts_in(path)
    except OSError as error:
        raise InputError(f"{path}: could not be created ({error.strerror or error}); choose another folder") from None


def _remove_if_empty(path: Path) -> None:
    with suppress(OSError):
        if [entry.name for entry in path.iterdir()] == [_MARKER]:
            (path / _MARKER).unlink()
            path.rmdir()

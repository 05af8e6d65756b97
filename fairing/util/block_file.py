"""Records as files: appended block by block as things happen, and readable after a crash.

Layout: a magic line, then blocks of (length, checksum, payload), the first being a header. A block that was cut short
is dropped on reading, everything before it is kept.
"""

import io
import os
import zlib
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from fairing.errors import InputError


class BlockFile:
    """A file that grows by blocks. Once a write fails it is closed: its end is in doubt, nothing may follow."""

    def __init__(self, path: Path, magic: bytes, blocks: Iterable[bytes]) -> None:
        """Write all blocks so far aside, and rename; what was at `path` is replaced.

        Raises:
            InputError: the folder is missing or the disk is full. What was at `path` is untouched then.
        """
        self.path = path
        aside = path.with_name(path.name + ".part")
        try:
            with aside.open("wb") as file:
                file.write(magic)
                for block in blocks:
                    _write_block(file, block)
            os.replace(aside, path)
            self._file = path.open("ab")
        except OSError as error:
            with suppress(OSError):
                aside.unlink(missing_ok=True)
            raise InputError(
                f"{path}: could not be written ({error.strerror}); choose another folder or free space"
            ) from None

    def append(self, block: bytes) -> None:
        """Add a block.

        Raises:
            InputError: the disk is full.
        """
        try:
            _write_block(self._file, block)
        except OSError as error:
            raise self._failed(error) from None

    def flush(self) -> None:
        """Make sure that what was appended survives a crash of the machine.

        Raises:
            InputError: the disk is full.
        """
        try:
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise self._failed(error) from None

    def close(self) -> None:
        """Flush and close.

        Raises:
            InputError: the disk is full.
        """
        self.flush()
        self._file.close()

    def _failed(self, error: OSError) -> InputError:
        with suppress(OSError):
            self._file.close()
        return InputError(f"{self.path}: could not be written ({error.strerror}); free space and go on")


def read_blocks(path: Path, magic: bytes, kind: str) -> list[bytes]:
    """The payloads of a file, at least the header's.

    Args:
        kind: what the file should be, for messages.

    Raises:
        InputError: the file is missing, is something else, or its header is damaged.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{kind} {path}: cannot be read ({error.strerror})") from None
    if not data.startswith(magic):
        raise InputError(f"{kind} {path}: expected an EigenFairing {kind} (version 1), found something else")
    blocks = []
    at = len(magic)
    while at + 12 <= len(data):
        length, checksum = int.from_bytes(data[at : at + 8], "little"), int.from_bytes(data[at + 8 : at + 12], "little")
        payload = data[at + 12 : at + 12 + length]
        # Some file systems leave zeros where a crash kept the data from the disk.
        if length == 0 or len(payload) < length or zlib.crc32(payload) != checksum:
            break
        blocks.append(payload)
        at += 12 + length
    if not blocks:
        raise InputError(f"{kind} {path}: its header is damaged; it cannot be replayed")
    return blocks


def pack(texts: dict[str, str], **arrays: np.ndarray) -> bytes:
    """A payload of named texts and arrays."""
    buffer = io.BytesIO()
    text_arrays = {f"text_{name}": np.frombuffer(text.encode(), dtype=np.uint8) for name, text in texts.items()}
    everything: dict[str, Any] = {**text_arrays, **arrays}
    np.savez_compressed(buffer, **everything)
    return buffer.getvalue()


def unpack(block: bytes) -> tuple[dict[str, str], dict[str, np.ndarray]]:
    """The texts and arrays of a payload."""
    with np.load(io.BytesIO(block), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    texts = {name[5:]: bytes(arrays.pop(name)).decode() for name in list(arrays) if name.startswith("text_")}
    return texts, arrays


def _write_block(file: io.BufferedWriter, payload: bytes) -> None:
    file.write(len(payload).to_bytes(8, "little") + zlib.crc32(payload).to_bytes(4, "little") + payload)

"""Block files: append-only records that stay readable after a crash.

Layout: a magic line, then blocks of (length: 8 bytes, CRC-32: 4 bytes, payload), little-endian; the first block is a
header. On reading, a truncated block ends the file; every block before it is kept.
"""

import io
import os
import time
import zlib
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from fairing.errors import InputError
from fairing.util.budget import Budget
from fairing.util.guards import check_regular_file
from fairing.util.npz import npz_budget, read_npz
from fairing.util.part_file import part_path, remove_parts_of, sync_folder

SYNC_EVERY = 1.0
"""Seconds: appended blocks reach the disk at least this often, so that a power failure loses no more work. They reach
the operating system one by one, so that a killed process loses none."""


class BlockFile:
    """A file that grows by blocks. It is closed after a failed write, because its end is undefined then."""

    def __init__(self, path: Path, magic: bytes, blocks: Iterable[bytes]) -> None:
        """Write the given blocks to a part file and rename it to `path`, replacing an existing file.

        Raises:
            InputError: the folder is missing or the disk is full. An existing file is unchanged then.
        """
        self.path = path
        part = part_path(path)
        try:
            remove_parts_of(path)
            with part.open("wb") as file:
                file.write(magic)
                for block in blocks:
                    _write_block(file, block)
                file.flush()
                os.fsync(file.fileno())
            part.replace(path)
            sync_folder(path.parent)
            self._file = path.open("ab")
        except OSError as error:
            with suppress(OSError):
                part.unlink(missing_ok=True)
            raise InputError(
                f"{path}: could not be written ({error.strerror}); choose another folder or free space"
            ) from None
        self._synced = time.monotonic()

    def append(self, block: bytes) -> None:
        """Add a block and hand it to the operating system; see `SYNC_EVERY`.

        Raises:
            InputError: the disk is full.
        """
        try:
            _write_block(self._file, block)
            self._file.flush()
        except OSError as error:
            raise self._failed(error) from None
        if time.monotonic() > self._synced + SYNC_EVERY:
            self.flush()

    def flush(self) -> None:
        """Write everything appended to the disk, so that it survives a crash of the machine.

        Raises:
            InputError: the disk is full.
        """
        try:
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise self._failed(error) from None
        self._synced = time.monotonic()

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
        return InputError(f"{self.path}: could not be written ({error.strerror}); free space and continue")


def read_blocks(path: Path, magic: bytes, kind: str) -> list[bytes]:
    """The payloads of a block file; the header's is always there.

    Args:
        kind: the kind of file for messages, such as "trace".

    Raises:
        InputError: the file is missing, is something else, or its header is damaged.
    """
    check_regular_file(path, f"a {kind}")
    try:
        data = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        raise InputError(f"{kind} {path}: cannot be read ({getattr(error, 'strerror', error)})") from None
    if not data.startswith(magic):
        raise InputError(f"{kind} {path}: expected an EigenFairing {kind} (version 1), found something else")
    blocks = []
    at = len(magic)
    while at + 12 <= len(data):
        length, checksum = int.from_bytes(data[at : at + 8], "little"), int.from_bytes(data[at + 8 : at + 12], "little")
        payload = data[at + 12 : at + 12 + length]
        # After a crash some file systems return zeros for data that never reached the disk.
        if length == 0 or len(payload) < length or zlib.crc32(payload) != checksum:
            break
        blocks.append(payload)
        at += 12 + length
    if not blocks:
        raise InputError(f"{kind} {path}: its header is damaged, so it cannot be replayed; record the run again")
    return blocks


def pack(texts: dict[str, str], **arrays: np.ndarray) -> bytes:
    """A payload of named texts and arrays of numbers."""
    buffer = io.BytesIO()
    text_arrays = {f"text_{name}": np.frombuffer(text.encode(), dtype=np.uint8) for name, text in texts.items()}
    everything: dict[str, Any] = {**text_arrays, **arrays}
    np.savez_compressed(buffer, **everything)
    return buffer.getvalue()


def blocks_budget(blocks: list[bytes]) -> Budget:
    """The budget for the arrays of all blocks of a file."""
    return npz_budget(sum(map(len, blocks)))


def unpack(block: bytes, budget: Budget) -> tuple[dict[str, str], dict[str, np.ndarray]]:
    """The texts and arrays of a payload.

    Raises:
        ValueError: the payload is no archive of texts and arrays, or they exceed the file's budget.
    """
    arrays = read_npz(io.BytesIO(block), budget=budget)
    texts = {name[5:]: bytes(arrays.pop(name)).decode() for name in list(arrays) if name.startswith("text_")}
    return texts, arrays


def _write_block(file: io.BufferedWriter, payload: bytes) -> None:
    file.write(len(payload).to_bytes(8, "little") + zlib.crc32(payload).to_bytes(4, "little") + payload)

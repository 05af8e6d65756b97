"""NumPy archives (.npz) read with checks, so that damage raises one exception and declared sizes are not trusted."""

import io
import math
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Collection
from typing import IO, BinaryIO

import numpy as np

from fairing.util.budget import Budget

MAX_BYTES = 1 << 33
"""Of the arrays of one file."""
_NUMBERS, _TEXT = "biuf", "U"
_LONGEST_TEXT = 1 << 16
_DAMAGE = (
    OSError, EOFError, ValueError, LookupError, ArithmeticError, RuntimeError, SyntaxError, tokenize.TokenError,
    struct.error, zlib.error, zipfile.BadZipFile,
)  # fmt: skip
"""What zipfile, zlib and NumPy raise on damaged bytes; RuntimeError for encrypted and unknown kinds of members."""


def npz_budget(n_bytes: int) -> Budget:
    """The budget of a file of this size that holds one or more archives."""
    return Budget(n_bytes, MAX_BYTES)


def read_npz(
    file: BinaryIO, names: Collection[str] | None = None, texts: Collection[str] = (), budget: Budget | None = None
) -> dict[str, np.ndarray]:
    """The arrays of an archive by name. Nothing else is decompressed.

    Args:
        names: of the arrays to read; default: all.
        texts: names of arrays that are single texts instead of numbers.
        budget: of the file that the archive is part of; default: of the archive alone.

    Raises:
        ValueError: the archive is damaged, an array is of another kind, declares more values than it holds, or all arrays
            take more than the archive's size allows.
    """
    try:
        budget = budget or npz_budget(file.seek(0, io.SEEK_END))
        with zipfile.ZipFile(file) as archive:
            members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            wanted = members.keys() if names is None else members.keys() & {*names, *texts}
            return {
                name: _read_array(archive, members[name], budget, name in texts) for name in members if name in wanted
            }
    except _DAMAGE as error:
        raise ValueError(str(error) or type(error).__name__) from None


def _read_array(archive: zipfile.ZipFile, info: zipfile.ZipInfo, budget: Budget, is_text: bool) -> np.ndarray:
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{info.filename}: expected deflate as compression, found method {info.compress_type}")
    with archive.open(info) as member:
        version = np.lib.format.read_magic(member)
        read_header = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }[version]
        shape, fortran_order, dtype = read_header(member)
        is_expected = dtype.kind == _TEXT if is_text else dtype.kind in _NUMBERS and dtype.itemsize <= 8
        if not is_expected or dtype.subdtype is not None:
            raise ValueError(f"{info.filename}: expected {'a text' if is_text else 'numbers'}, found {dtype}")
        size = math.prod(shape) * dtype.itemsize
        if not 0 <= size <= (_LONGEST_TEXT if is_text else info.file_size):
            raise ValueError(f"{info.filename}: declares shape {shape}, holds {info.file_size} bytes")
        budget.take(size)
        data = bytearray(size)
        n_read = _read_into(member, memoryview(data))
        if n_read < size or member.read(1):
            raise ValueError(f"{info.filename}: declares {size} bytes, holds another number")
    return np.ndarray(shape, dtype, data, order="F" if fortran_order else "C")


def _read_into(member: IO[bytes], data: memoryview) -> int:
    """Fill the data as far as the member goes; returns the number of bytes read."""
    at = 0
    while at < len(data):
        chunk = member.read(min(len(data) - at, 1 << 20))
        if not chunk:
            break
        data[at : at + len(chunk)] = chunk
        at += len(chunk)
    return at

"""NumPy archives (.npz) read with checks, so that damage raises one exception and declared sizes are not trusted."""

import math
import zipfile
from typing import BinaryIO

import numpy as np

MAX_BYTES = 1 << 33
"""Of one array. A deflated archive can expand a thousandfold."""
_PLAIN_KINDS = "biuf"


def read_npz(file: BinaryIO) -> dict[str, np.ndarray]:
    """The arrays of an archive by name.

    Raises:
        ValueError: the archive is damaged, an array is not of plain numbers, or declares more values than it holds.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            return {info.filename.removesuffix(".npy"): _read_array(archive, info) for info in archive.infolist()}
    except Exception as error:  # zipfile, zlib and NumPy raise a dozen types on damaged bytes
        raise ValueError(str(error) or type(error).__name__) from None


def _read_array(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> np.ndarray:
    with archive.open(info) as member:
        version = np.lib.format.read_magic(member)
        read_header = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }[version]
        shape, fortran_order, dtype = read_header(member)
        if dtype.kind not in _PLAIN_KINDS or dtype.subdtype is not None or dtype.itemsize > 8:
            raise ValueError(f"{info.filename}: expected numbers, found {dtype}")
        size = math.prod(shape) * dtype.itemsize
        if not 0 <= size <= min(info.file_size, MAX_BYTES):
            raise ValueError(f"{info.filename}: declares shape {shape}, holds {info.file_size} bytes")
        data = member.read(size)
        if len(data) < size or member.read(1):
            raise ValueError(f"{info.filename}: declares {size} bytes, holds another number")
    return np.ndarray(shape, dtype, bytearray(data), order="F" if fortran_order else "C")

"""Image files of kinds that neither Pillow nor OpenCV writes, assembled byte by byte."""

import struct
import zlib
from collections.abc import Mapping

import numpy as np


def png(samples: np.ndarray, color_type: int, *chunks: tuple[bytes, bytes]) -> bytes:
    """A PNG of (h, w) or (h, w, c) uint8 or uint16 samples.

    Args:
        color_type: 0 grey, 2 RGB, 3 palette, 4 grey and alpha, 6 RGBA.
        chunks: type and content of chunks between the header and the pixels.
    """
    height, width = samples.shape[:2]
    header = struct.pack(">IIBBBBB", width, height, 8 * samples.dtype.itemsize, color_type, 0, 0, 0)
    rows = b"".join(b"\0" + row.astype(samples.dtype.newbyteorder(">")).tobytes() for row in samples)
    parts = [(b"IHDR", header), *chunks, (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    body = b"".join(struct.pack(">I", len(c)) + k + c + struct.pack(">I", zlib.crc32(k + c)) for k, c in parts)
    return b"\x89PNG\r\n\x1a\n" + body


def tiff(*pages: tuple[np.ndarray, Mapping[int, int | tuple[int, ...]]], big_endian: bool = False) -> bytes:
    """An uncompressed TIFF: for each page the samples (h, w) or (h, w, c), and tags that replace the ordinary ones."""
    order = ">" if big_endian else "<"
    data, directories = b"", []
    for samples, tags in pages:
        height, width, channels = (*samples.shape, 1)[:3]
        planes = np.moveaxis(samples, -1, 0) if tags.get(284) == 2 else samples
        pixels = np.ascontiguousarray(planes).astype(samples.dtype.newbyteorder(order)).tobytes()
        at = 8 + len(data)
        n_strips = channels if tags.get(284) == 2 else 1
        length = len(pixels) // n_strips
        entries: dict[int, int | tuple[int, ...]] = {
            256: width, 257: height, 258: (8 * samples.dtype.itemsize,) * channels, 259: 1,
            262: 2 if channels >= 3 else 1, 273: tuple(at + i * length for i in range(n_strips)), 277: channels,
            278: height, 279: (length,) * n_strips,
        }  # fmt: skip
        data += pixels + b"\0" * (len(pixels) % 2)
        directories.append(sorted({**entries, **tags}.items()))
    start = 8 + len(data)
    body = b""
    for number, entries in enumerate(directories):
        at = start + len(body)
        after = at + 2 + 12 * len(entries) + 4
        table, values = struct.pack(order + "H", len(entries)), b""
        for tag, value in entries:
            numbers = value if isinstance(value, tuple) else (value,)
            packed = struct.pack(f"{order}{len(numbers)}I", *numbers)
            if len(packed) > 4:
                packed, values = struct.pack(order + "I", after + len(values)), values + packed
            table += struct.pack(order + "HHI", tag, 4, len(numbers)) + packed
        is_last = number == len(directories) - 1
        body += table + struct.pack(order + "I", 0 if is_last else after + len(values)) + values
    return (b"MM" if big_endian else b"II") + struct.pack(order + "HI", 42, start) + data + body

"""The texels that a face owns in its rectangle, and their positions in the texture.

Samples are stored row by row, unturned: `for row in range(rows(...)): for column in range(columns(row, ...))`
(ledger: texel loops).
"""

from pathlib import Path

import numba

from fairing.util.compiled_only import COMPILED_ONLY
from fairing.util.source_hash import source_hash

SOURCE = source_hash(Path(__file__).parent)
"""Changes with any file of this package: for compiled functions that use those of this module, see `fairing.util.source_hash`."""


@numba.njit(nogil=True, inline="always")
def rows(h, gutter):
    """Number of rows in the rectangle of a face whose legs are w and h texels long."""
    return h + 3 * gutter + 1


@numba.njit(nogil=True, **COMPILED_ONLY)
def columns(row, w, h, gutter):
    """Number of texels of a row that the face owns: all up to somewhat beyond its longest side."""
    end, v = 1 + 0.5 * (gutter / w + gutter / h), (row - gutter) / h
    count = 0
    while count < w + 3 * gutter + 1 and (count - gutter) / w + v <= end:
        count += 1
    return count


@numba.njit(nogil=True, inline="always")
def place(row, column, corner, w, h, turned, gutter):
    """Row and column in the texture of a texel (row, column) of a face's rectangle whose first texel is `corner`."""
    if turned:
        return corner[1] + h + 3 * gutter - row, corner[0] + w + 3 * gutter - column
    return corner[1] + row, corner[0] + column

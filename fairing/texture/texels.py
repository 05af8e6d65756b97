"""The texels that a face owns in its rectangle, and where they lie in the texture.

Samples are kept row by row, unturned: `for row in range(rows(...)): for column in range(columns(row, ...))`. (With a generator of
texels composing a texture took twice as long.)
"""

import numba


@numba.njit(cache=True, nogil=True, inline="always")
def rows(h, gutter):
    """How many rows the rectangle of a face has whose legs are w and h texels long."""
    return h + 3 * gutter + 1


@numba.njit(cache=True, nogil=True)
def columns(row, w, h, gutter):
    """How many texels of a row the face owns: all up to somewhat beyond its longest side."""
    end, v = 1 + 0.5 * (gutter / w + gutter / h), (row - gutter) / h
    count = 0
    while count < w + 3 * gutter + 1 and (count - gutter) / w + v <= end:
        count += 1
    return count


@numba.njit(cache=True, nogil=True, inline="always")
def place(row, column, corner, w, h, turned, gutter):
    """Row and column in the texture of a texel of a face's rectangle."""
    if turned:
        return corner[1] + h + 3 * gutter - row, corner[0] + w + 3 * gutter - column
    return corner[1] + row, corner[0] + column

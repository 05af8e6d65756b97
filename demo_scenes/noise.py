"""Seeded random fields that repeat seamlessly, for textures of brick, plaster, stone and wood.

Compiled functions fill arrays from NumPy, which lie in large pages: those that they allocate themselves lie in small ones,
and to touch them for the first time takes as long as the arithmetic.

All arithmetic is float64 on draws of `numpy.random.Generator(PCG64)`, so a seed gives the same texture on every machine.
"""

from math import floor

import numpy as np
from numba import njit


def seeded(*key: int) -> np.random.Generator:
    """The random generator of a key of integers, none of them negative."""
    return np.random.Generator(np.random.PCG64(list(key)))


def spline_noise(size: tuple[int, int], cells: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    """Smooth random field (height, width), standard deviation about 1, periodic in both directions.

    A lattice of normal numbers, `cells` = (rows, columns), interpolated by the uniform cubic B-spline: twice
    continuously differentiable, without the creases of value noise, and almost free of frequencies above the lattice's.
    """
    lattice = rng.standard_normal(cells)
    # The B-spline averages its knots: the variance is 0.23 in each dimension, on average over a cell.
    noise = np.zeros(size)
    _upsample(lattice, np.zeros((cells[0], size[1])), noise)
    noise /= 0.48
    return noise


def fractal_noise(
    size: tuple[int, int], cells: tuple[int, int], octaves: int, rng: np.random.Generator, persistence: float = 0.6
) -> np.ndarray:
    """Sum of `octaves` spline noises (height, width), each twice as fine and `persistence` times as strong; deviation
    1.

    `cells` is the coarsest lattice (rows, columns). Octaves finer than three texels are omitted.
    """
    cells = min(cells[0], max(1, size[0] // 3)), min(cells[1], max(1, size[1] // 3))
    total = np.zeros(size)
    power = 0.0
    for octave in range(octaves):
        rows, columns = cells[0] << octave, cells[1] << octave
        if octave > 0 and (rows * 3 > size[0] or columns * 3 > size[1]):
            break
        strength = persistence**octave
        noise = spline_noise(size, (rows, columns), rng)
        noise *= strength
        total += noise
        power += strength**2
    total /= power**0.5
    return total


def worley(size: tuple[int, int], cells: tuple[int, int], rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Irregular stones: one random seed in each cell of a lattice, every texel belongs to its nearest seed.

    Returns:
        The stone's number (height, width) int64 and the distance to the stone's border (height, width) in cell sizes.
    """
    jitter = 0.5 + 0.42 * (2 * rng.random((*cells, 2)) - 1)
    stone, border = np.zeros(size, np.int64), np.zeros(size)
    _worley(jitter, stone, border)
    return stone, border


def smoothstep(low: float | np.ndarray, high: float | np.ndarray, x: np.ndarray) -> np.ndarray:
    """0 below `low`, 1 above `high`, a smooth cubic between."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


@njit(cache=True, nogil=True)
def _upsample(lattice: np.ndarray, wide: np.ndarray, out: np.ndarray) -> None:
    """The field (height, width) of a lattice (rows, columns); wide: (rows, width) scratch."""
    rows, columns = lattice.shape
    height, width = out.shape
    for x in range(width):
        at = x * columns / width
        cell = floor(at)
        t = at - cell
        w0, w1, w2, w3 = (1 - t) ** 3 / 6, (4 - 6 * t * t + 3 * t**3) / 6, 0.0, t**3 / 6
        w2 = 1 - w0 - w1 - w3
        for r in range(rows):
            wide[r, x] = (
                w0 * lattice[r, (cell - 1) % columns]
                + w1 * lattice[r, cell % columns]
                + w2 * lattice[r, (cell + 1) % columns]
                + w3 * lattice[r, (cell + 2) % columns]
            )
    for y in range(height):
        at = y * rows / height
        cell = floor(at)
        t = at - cell
        w0, w1, w3 = (1 - t) ** 3 / 6, (4 - 6 * t * t + 3 * t**3) / 6, t**3 / 6
        w2 = 1 - w0 - w1 - w3
        a, b, c, d = (cell - 1) % rows, cell % rows, (cell + 1) % rows, (cell + 2) % rows
        for x in range(width):
            out[y, x] = w0 * wide[a, x] + w1 * wide[b, x] + w2 * wide[c, x] + w3 * wide[d, x]


@njit(cache=True, nogil=True)
def _worley(jitter: np.ndarray, stone: np.ndarray, border: np.ndarray) -> None:
    rows, columns = jitter.shape[:2]
    height, width = stone.shape
    for y in range(height):
        for x in range(width):
            py, px = y * rows / height, x * columns / width
            cy, cx = floor(py), floor(px)
            nearest = second = 1e9
            for dy in range(-2, 3):
                for dx in range(-2, 3):
                    r, c = (cy + dy) % rows, (cx + dx) % columns
                    ey, ex = cy + dy + jitter[r, c, 0] - py, cx + dx + jitter[r, c, 1] - px
                    d = (ey * ey + ex * ex) ** 0.5
                    if d < nearest:
                        second, nearest = nearest, d
                        stone[y, x] = r * columns + c
                    elif d < second:
                        second = d
            border[y, x] = (second - nearest) / 2

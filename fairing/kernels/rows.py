"""Arithmetic on rows of samples.

Faces are processed in blocks of samples that fit the processor's cache. A row that was read is used for several products, three
rows by three where there are as many (ledger: rows three by three).
"""

import numpy as np

from fairing.kernels.compiled import fast, plain

# Multiples of the longest vectors, 16 samples, that leave no short rest of cells of 64 and 128 (ledger: kernel block).
STRIP = 1056  # samples read from a photo at a time
BLOCK = 2 * STRIP  # samples of the eigenspace and the normal equations at a time


@plain
def aligned(count):
    """Uninitialised float32, (count,), from the beginning of a cache line of 64 bytes.

    numba's own arrays begin at multiples of 32 bytes, so that a vector of 64 bytes may straddle two lines (ledger: alignment).
    """
    buffer = np.empty(count + 16, dtype=np.float32)
    skip = (-(buffer.ctypes.data // 4)) % 16
    return buffer[skip : skip + count]


@plain
def copy_row(source, target):
    """target = source; numba compiles an assignment to a slice with its checks of shapes, which takes seconds."""
    for t in range(target.shape[0]):
        target[t] = source[t]


@plain
def times(a, b, out):
    """out = a * b."""
    for t in range(out.shape[0]):
        out[t] = a[t] * b[t]


@fast
def dot(a, b):
    """Inner product, float32."""
    total = np.float32(0)
    for s in range(a.shape[0]):
        total += a[s] * b[s]
    return total


@fast
def dot_three(a, b0, b1, b2):
    """Inner products of a row with three others, float32."""
    total0, total1, total2 = np.float32(0), np.float32(0), np.float32(0)
    for s in range(a.shape[0]):
        total0 += a[s] * b0[s]
        total1 += a[s] * b1[s]
        total2 += a[s] * b2[s]
    return total0, total1, total2


@fast
def dot_three_by_three(a0, a1, a2, b0, b1, b2):
    """Inner products of three rows with three others, row by row, float32."""
    zero = np.float32(0)
    s00, s01, s02, s10, s11, s12, s20, s21, s22 = zero, zero, zero, zero, zero, zero, zero, zero, zero
    for s in range(a0.shape[0]):
        s00 += a0[s] * b0[s]
        s01 += a0[s] * b1[s]
        s02 += a0[s] * b2[s]
        s10 += a1[s] * b0[s]
        s11 += a1[s] * b1[s]
        s12 += a1[s] * b2[s]
        s20 += a2[s] * b0[s]
        s21 += a2[s] * b1[s]
        s22 += a2[s] * b2[s]
    return s00, s01, s02, s10, s11, s12, s20, s21, s22


@plain
def add_rows_to_all(targets, at, width, factors, rows, start):
    """targets[i, at : at + width] += sum of factors[i, m] * rows[m, start : start + width] for each i.

    Args:
        targets: (n, p) float32.
        factors: (n, count) float32.
        rows: (count, q) float32.
    """
    n, count = factors.shape
    stop, end = start + width, at + width
    n_whole, count_whole = n - n % 3, count - count % 3
    for i in range(0, n_whole, 3):
        for m in range(0, count_whole, 3):
            _add_three_to_three(
                targets[i, at:end], targets[i + 1, at:end], targets[i + 2, at:end], factors[i : i + 3, m : m + 3],
                rows[m, start:stop], rows[m + 1, start:stop], rows[m + 2, start:stop],
            )  # fmt: skip
    if count_whole < count:
        for i in range(n_whole):
            add_rows(targets[i, at:end], factors[i, count_whole:], rows[count_whole:], start)
    for i in range(n_whole, n):
        add_rows(targets[i, at:end], factors[i], rows, start)


@plain
def _add_three_to_three(t0, t1, t2, f, r0, r1, r2):
    """Targets t += f r for three rows r, in one pass; f: (3, 3)."""
    f00, f01, f02, f10, f11, f12, f20, f21, f22 = (
        f[0, 0], f[0, 1], f[0, 2], f[1, 0], f[1, 1], f[1, 2], f[2, 0], f[2, 1], f[2, 2],
    )  # fmt: skip
    for s in range(t0.shape[0]):
        t0[s] += f00 * r0[s] + f01 * r1[s] + f02 * r2[s]
        t1[s] += f10 * r0[s] + f11 * r1[s] + f12 * r2[s]
        t2[s] += f20 * r0[s] + f21 * r1[s] + f22 * r2[s]


@plain
def add_rows(target, factors, rows, start):
    """target += sum of factors[m] * rows[m, start : ...], three rows in a pass.

    `start` is an argument because numba cannot infer that the rows of rows[:, start:] are contiguous.
    """
    stop = start + target.shape[0]
    for m in range(0, factors.shape[0], 3):
        left = factors.shape[0] - m
        f0, row0 = factors[m], rows[m, start:stop]
        if left == 1:
            for s in range(target.shape[0]):
                target[s] += f0 * row0[s]
            return
        f1, row1 = factors[m + 1], rows[m + 1, start:stop]
        if left == 2:
            for s in range(target.shape[0]):
                target[s] += f0 * row0[s] + f1 * row1[s]
            return
        f2, row2 = factors[m + 2], rows[m + 2, start:stop]
        for s in range(target.shape[0]):
            target[s] += f0 * row0[s] + f1 * row1[s] + f2 * row2[s]

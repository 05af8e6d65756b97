"""Arithmetic on rows of samples.

Faces are processed in blocks of samples that fit the processor's cache; sums over several rows are computed in one pass.
"""

import numpy as np

from fairing.kernels.compiled import fast

STRIP = 512  # samples read from a photo at a time
BLOCK = 1024  # samples of the normal equations at a time (ledger: kernel block)


@fast
def copy_row(source, target):
    """target = source; numba compiles an assignment to a slice with its checks of shapes, which takes seconds."""
    for t in range(target.shape[0]):
        target[t] = source[t]


@fast
def times(a, b, out):
    """out = a * b."""
    for t in range(out.shape[0]):
        out[t] = a[t] * b[t]


@fast
def subtract(a, number):
    """a -= number."""
    for t in range(a.shape[0]):
        a[t] -= number


@fast
def sum_of(a):
    """Sum, float32."""
    total = np.float32(0)
    for t in range(a.shape[0]):
        total += a[t]
    return total


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
def add_rows(target, factors, rows, start):
    """target += sum of factors[m] * rows[m, start : ...], four rows in a pass.

    `start` is an argument because numba cannot infer that the rows of rows[:, start:] are contiguous.
    """
    stop = start + target.shape[0]
    m, left = 0, factors.shape[0]
    while left > 0:
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
        if left == 3:
            for s in range(target.shape[0]):
                target[s] += f0 * row0[s] + f1 * row1[s] + f2 * row2[s]
            return
        f3, row3 = factors[m + 3], rows[m + 3, start:stop]
        for s in range(target.shape[0]):
            target[s] += f0 * row0[s] + f1 * row1[s] + f2 * row2[s] + f3 * row3[s]
        m, left = m + 4, left - 4

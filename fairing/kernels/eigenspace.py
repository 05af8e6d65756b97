"""Eigenspace of a face's cells, and the residual of their reconstruction."""

import numpy as np

from fairing.kernels.compiled import fast, never_inline, plain
from fairing.kernels.rows import BLOCK, STRIP, add_rows, add_rows_to_all, copy_row, dot, dot_three_by_three

FILL_ITERATIONS = 3
GRAM_BLOCK = STRIP // 3  # samples summed in single precision (ledger: Gram matrix)


@plain
def fit_face(cells, k, centered, mask_weight, masked, basis, V, singular_values, residual):
    """Eigenspace and residual of one face's cells (n, p).

    residual = I - U c (Eq. 1). Masked samples are filled from the reconstruction itself, starting from the mean of the other
    cells, in a fixed number of iterations, so that the energy is a function of the vertices alone. Their residual is zero.

    Args:
        cells: (n, p) float32, grey levels; modified: masked samples are filled, the mean cell is subtracted if centred.
        k: dimensions.
        centered: subtract the mean cell.
        mask_weight: (n, p) float32: 1 where a sample counts, else 0; read only if `masked`.
        masked: whether any sample is masked.
        basis: (k + 1, p) float32, out: the last row is scratch.
        V: (n, at least k) float64, out: right singular vectors.
        singular_values: (at least n,) float64, out, descending.
        residual: (n, p) float32, out, grey levels.
    """
    never_inline()  # pyright: ignore[reportCallIssue]
    n, p = cells.shape
    if masked:
        _fill_with_mean(cells, mask_weight, residual)
    back = np.empty((n, k), dtype=np.float32)
    for _ in range(FILL_ITERATIONS + 1 if masked else 1):
        if centered:
            _subtract_mean(cells, basis[k])
        factors = _decompose(cells, k, V, singular_values)
        for i in range(n):
            for m in range(k):
                back[i, m] = -singular_values[m] * V[i, m]
        for start in range(0, p, BLOCK):
            stop = min(start + BLOCK, p)
            for m in range(k):
                basis[m, start:stop] = 0
            add_rows_to_all(basis, start, stop - start, factors, cells, start)
            for i in range(n):
                copy_row(cells[i, start:stop], residual[i, start:stop])
            add_rows_to_all(residual, start, stop - start, back, basis, start)
        if masked:
            _fill_with_reconstruction(cells, mask_weight, residual)


@plain
def _decompose(cells, k, V, singular_values):
    """First k singular vectors of the cells from the n x n Gram matrix; signs are fixed so that runs are comparable.

    Fills V (n, k); returns the factors (k, n) float32 whose product with the cells is the basis.
    """
    n = cells.shape[0]
    gram = np.empty((n, n))
    _gram_matrix(cells, gram)
    values, vectors = np.linalg.eigh(gram)
    for m in range(n):
        singular_values[m] = np.sqrt(max(values[n - 1 - m], 0.0))
    factors = np.zeros((k, n), dtype=np.float32)
    for m in range(k):
        column = vectors[:, n - 1 - m]
        largest = 0
        for i in range(n):
            if abs(column[i]) > abs(column[largest]) * (1 + 1e-9):
                largest = i
        sign = 1.0 if column[largest] >= 0 else -1.0
        if singular_values[m] > 1e-6 * singular_values[0] and singular_values[m] > 0:
            for i in range(n):
                V[i, m] = sign * column[i]
                factors[m, i] = V[i, m] / singular_values[m]
        else:
            for i in range(n):
                V[i, m] = 0
    return factors


@plain
def _gram_matrix(cells, gram):
    """gram (n, n) float64 = cells cells^T; short blocks, because residuals at large k lose what single precision loses."""
    n, p = cells.shape
    gram[:] = 0
    for start in range(0, p, GRAM_BLOCK):
        stop = min(start + GRAM_BLOCK, p)
        for i in range(0, n - n % 3, 3):
            a0, a1, a2 = cells[i, start:stop], cells[i + 1, start:stop], cells[i + 2, start:stop]
            for j in range(0, i + 1, 3):
                b0, b1, b2 = cells[j, start:stop], cells[j + 1, start:stop], cells[j + 2, start:stop]
                products = dot_three_by_three(a0, a1, a2, b0, b1, b2)
                for c in range(9):
                    gram[i + c // 3, j + c % 3] += products[c]
        for i in range(n - n % 3, n):
            for j in range(i + 1):
                gram[i, j] += dot(cells[i, start:stop], cells[j, start:stop])
    for i in range(n):
        for j in range(i):
            gram[j, i] = gram[i, j]


@fast
def _subtract_mean(cells, mean):
    """Subtract the mean cell from all; mean: (p,) scratch."""
    n = cells.shape[0]
    mean[:] = 0
    add_rows(mean, np.full(n, np.float32(1 / n)), cells, np.int64(0))
    for i in range(n):
        cell = cells[i]
        for t in range(cell.shape[0]):
            cell[t] -= mean[t]


@fast
def _fill_with_mean(cells, mask_weight, scratch):
    """Set masked samples to the mean of the other cells; scratch: (n, p) with n at least 2, overwritten."""
    n, p = cells.shape
    total, count = scratch[0], scratch[1]
    total[:] = 0
    count[:] = 0
    for i in range(n):
        cell, weight = cells[i], mask_weight[i]
        for t in range(p):
            total[t] += weight[t] * cell[t]
            count[t] += weight[t]
    for t in range(p):
        total[t] /= max(count[t], np.float32(1))
    for i in range(n):
        cell, weight = cells[i], mask_weight[i]
        for t in range(p):
            cell[t] = weight[t] * cell[t] + (np.float32(1) - weight[t]) * total[t]


@fast
def _fill_with_reconstruction(cells, mask_weight, residual):
    """Set masked samples to their reconstruction; their residual becomes zero."""
    for i in range(cells.shape[0]):
        cell, weight, rest = cells[i], mask_weight[i], residual[i]
        for t in range(cell.shape[0]):
            cell[t] -= (np.float32(1) - weight[t]) * rest[t]
            rest[t] *= weight[t]


@fast
def remove_means(cells, mask_weight, masked):
    """Subtract from each cell its mean over the samples that count (the bias between photos)."""
    never_inline()  # pyright: ignore[reportCallIssue]
    for i in range(cells.shape[0]):
        cell = cells[i]
        total, count = 0.0, float(cell.shape[0])
        if masked:
            weight = mask_weight[i]
            count = 0.0
            for t in range(cell.shape[0]):
                total += weight[t] * cell[t]
                count += weight[t]
        else:
            for t in range(cell.shape[0]):
                total += cell[t]
        mean = np.float32(total / max(count, 1.0))
        for t in range(cell.shape[0]):
            cell[t] -= mean

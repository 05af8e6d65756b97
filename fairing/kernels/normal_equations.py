"""Normal equations of a face: Gauss-Newton matrix and gradient of its energy by its corners (ledger: normal equations)."""

import numpy as np

from fairing.kernels.compiled import fast, plain
from fairing.kernels.rows import BLOCK, add_rows, dot, dot_three, subtract, sum_of, times


@plain
def normal_equations(G, hats, corner, remove_bias, project, basis, V, residual, weights, pair_weight, H, g):
    """Add one face's H (9, 9) and g (9,): sum of w D_a D_b and w e D_a over views and samples.

    D is the derivative of the residual: hat * G for the alternating solver; with `project`, variable projection,
    (I - U U^T) J (I - V V^T), because the refitted U and c depend on the vertex (Golub and Pereyra 1973, Kaufman 1975).

    A first pass over the blocks projects the views and computes the columns' means and coefficients along the basis; a second
    pass subtracts these and sums. V^T acts on views and U^T on samples, so their order does not matter.

    Args:
        G: (3 or 9, n, p) float32: image gradient times J_image_wrt_point, by world axis (by corner and axis if affine);
            modified.
        hats: (3, p) float32: barycentric weights of the corners.
        corner: the corner that moves, -1 for all three.
        basis: (k, p) float32, rows orthonormal.
        V: (n, k) float64: right singular vectors.
        residual, weights: (n, p) float32: e in grey levels and rho'(e) / e.
        pair_weight: (n,) float64.
        H, g: (9, 9), (9,) float64, out.
    """
    n, p = G.shape[1:]
    k = basis.shape[0]
    first, rows = (0, 9) if corner < 0 else (3 * corner, 3)
    corner = max(corner, 0)
    columns = np.empty((rows, BLOCK), dtype=np.float32)
    scaled = np.empty(BLOCK, dtype=np.float32)
    means = np.zeros((n, rows))
    along = np.zeros((k, n, rows))
    basis_sums = np.zeros(k)
    if project or remove_bias:
        projected = np.empty((k, BLOCK), dtype=np.float32)
        forth, back = np.empty((k, n), dtype=np.float32), np.empty((n, k), dtype=np.float32)
        for i in range(n):
            for m in range(k):
                forth[m, i] = V[i, m]
                back[i, m] = -V[i, m]
        for start in range(0, p, BLOCK):
            stop = min(start + BLOCK, p)
            if project:
                for c in range(G.shape[0]):
                    _project_views(G[c], start, stop, forth, back, projected)
            if remove_bias:
                for m in range(k):
                    basis_sums[m] += sum_of(basis[m, start:stop])
            for a in range(0, rows, 3):
                hat = hats[corner + a // 3, start:stop]
                axes = G[a : a + 3] if G.shape[0] == 9 else G[:3]
                if remove_bias:
                    _add_dots(hat, axes, start, means[:, a : a + 3])
                if project:
                    for m in range(k):
                        # The hat multiplies the basis, once for all views.
                        times(hat, basis[m, start:stop], scaled[: stop - start])
                        _add_dots(scaled[: stop - start], axes, start, along[m, :, a : a + 3])
        for i in range(n):
            for a in range(rows):
                means[i, a] /= p
                for m in range(k):
                    along[m, i, a] -= means[i, a] * basis_sums[m]
    subtracted = np.empty((n, rows, k), dtype=np.float32)
    for i in range(n):
        for a in range(rows):
            for m in range(k):
                subtracted[i, a, m] = -along[m, i, a]
    sums, slope = np.zeros((n, rows, rows)), np.zeros((n, rows))
    for start in range(0, p, BLOCK):
        stop = min(start + BLOCK, p)
        for i in range(n):
            _columns(G, hats, corner, i, start, stop, columns)
            for a in range(rows):
                column = columns[a, : stop - start]
                if remove_bias:
                    subtract(column, np.float32(means[i, a]))
                if project:
                    add_rows(column, subtracted[i, a], basis, start)
            _add_products(
                columns, stop - start, weights[i, start:stop], residual[i, start:stop], sums[i], slope[i],
                scaled[: stop - start],
            )  # fmt: skip
    for i in range(n):
        for a in range(rows):
            g[first + a] += pair_weight[i] * slope[i, a]
            for b in range(a + 1):
                H[first + a, first + b] += pair_weight[i] * sums[i, a, b]
    for a in range(first, first + rows):
        for b in range(first, a):
            H[b, a] = H[a, b]


@plain
def _project_views(G, start, stop, forth, back, projected):
    """G (n, p) becomes (I - V V^T) G in a block of samples; forth: V^T, back: -V; projected: (k, BLOCK) scratch."""
    for m in range(forth.shape[0]):
        row = projected[m, : stop - start]
        row[:] = 0
        add_rows(row, forth[m], G, start)
    for i in range(G.shape[0]):
        add_rows(G[i, start:stop], back[i], projected, np.int64(0))


@plain
def _add_dots(row, axes, start, sums):
    """sums (n, 3) += the products of a row with three components of the derivative, for each view."""
    stop = start + row.shape[0]
    for i in range(sums.shape[0]):
        products = dot_three(row, axes[0, i, start:stop], axes[1, i, start:stop], axes[2, i, start:stop])
        sums[i, 0] += products[0]
        sums[i, 1] += products[1]
        sums[i, 2] += products[2]


@plain
def _columns(G, hats, first, i, start, stop, columns):
    """hat * G of view i by the corners' axes, for a block of samples, into `columns` (rows, BLOCK)."""
    for j in range(columns.shape[0] // 3):
        hat = hats[first + j, start:stop]
        for b in range(3):
            source = G[3 * j + b if G.shape[0] == 9 else b, i, start:stop]
            times(hat, source, columns[3 * j + b, : stop - start])


@plain
def _add_products(columns, width, weight, residual, H, g, scaled):
    """Add sum of w D_a D_b and w e D_a of a block, `width` samples, to the lower triangle of H and to g."""
    rows = columns.shape[0]
    if rows == 3:
        sums = _sums_of_three(columns[0, :width], columns[1, :width], columns[2, :width], weight, residual)
        g[0] += sums[0]
        g[1] += sums[1]
        g[2] += sums[2]
        H[0, 0] += sums[3]
        H[1, 0] += sums[4]
        H[1, 1] += sums[5]
        H[2, 0] += sums[6]
        H[2, 1] += sums[7]
        H[2, 2] += sums[8]
        return
    for a in range(rows):
        times(weight, columns[a, :width], scaled)
        g[a] += dot(scaled, residual)
        for b in range(0, a + 1, 3):
            products = dot_three(scaled, columns[b, :width], columns[b + 1, :width], columns[b + 2, :width])
            for c in range(3):
                H[a, b + c] += products[c]


@fast
def _sums_of_three(d0, d1, d2, weight, residual):
    """The nine sums of one corner in one pass: g by axis, and H's lower triangle by rows."""
    zero = np.float32(0)
    g0, g1, g2, h00, h10, h11, h20, h21, h22 = zero, zero, zero, zero, zero, zero, zero, zero, zero
    for t in range(d0.shape[0]):
        w0, w1, w2 = weight[t] * d0[t], weight[t] * d1[t], weight[t] * d2[t]
        g0 += w0 * residual[t]
        g1 += w1 * residual[t]
        g2 += w2 * residual[t]
        h00 += w0 * d0[t]
        h10 += w1 * d0[t]
        h11 += w1 * d1[t]
        h20 += w2 * d0[t]
        h21 += w2 * d1[t]
        h22 += w2 * d2[t]
    return g0, g1, g2, h00, h10, h11, h20, h21, h22

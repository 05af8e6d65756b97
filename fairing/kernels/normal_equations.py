"""Normal equations of a face: Gauss-Newton matrix and gradient of its energy by its corners (ledger: normal equations)."""

import numpy as np

from fairing.kernels.compiled import fast, plain
from fairing.kernels.rows import BLOCK, add_rows, add_rows_to_all, aligned, dot_three, dot_three_by_three, times


@plain
def normal_equations(G, hats, corner, basis, V, residual, weights, pair_weight, H, g):
    """Add one face's H (9, 9) and g (9,): sum of w D_a D_b and w e D_a over views and samples.

    D is the derivative of the residual, (I - U U^T) (hat * G) (I - V V^T): what is fitted anew depends on the vertex (variable
    projection; Golub and Pereyra 1973, Kaufman 1975). Rows of U or columns of V that are zero project nothing.

    A first pass over the blocks projects the views and computes the coefficients along the basis; a second pass subtracts
    these and sums. V^T acts on views and U^T on samples, so their order does not matter.

    Args:
        G: (3 or 9, n, p) float32: image gradient times J_image_wrt_point, by world axis (by corner and axis if affine);
            modified.
        hats: (3, p) float32: barycentric weights of the corners.
        corner: the corner that moves, -1 for all three.
        basis: (k, p) float32: U^T, rows orthonormal or zero, at least one.
        V: (n, k) float64, columns orthonormal or zero.
        residual, weights: (n, p) float32: e in grey levels and rho'(e) / e.
        pair_weight: (n,) float64.
        H, g: (9, 9), (9,) float64, out.
    """
    n, p = G.shape[1:]
    k = basis.shape[0]
    first, rows = (0, 9) if corner < 0 else (3 * corner, 3)
    corner = max(corner, 0)
    columns = aligned(rows * BLOCK).reshape(rows, BLOCK)
    scaled, projected = aligned(k * BLOCK).reshape(k, BLOCK), aligned(k * BLOCK).reshape(k, BLOCK)
    forth, back = np.empty((k, n), dtype=np.float32), np.empty((n, k), dtype=np.float32)
    for i in range(n):
        for m in range(k):
            forth[m, i] = V[i, m]
            back[i, m] = -V[i, m]
    along = np.zeros((n, rows, k))
    for start in range(0, p, BLOCK):
        stop = min(start + BLOCK, p)
        for c in range(G.shape[0]):
            _project_views(G[c], start, stop, forth, back, projected)
        for a in range(0, rows, 3):
            # The hat multiplies the basis, once for all views.
            for m in range(k):
                times(hats[corner + a // 3, start:stop], basis[m, start:stop], scaled[m, : stop - start])
            axes = G[a : a + 3] if G.shape[0] == 9 else G[:3]
            for i in range(n):
                _add_products(axes, i, start, scaled, stop - start, along[i, a : a + 3])
    subtracted = np.empty((n, rows, k), dtype=np.float32)
    for i in range(n):
        for a in range(rows):
            for m in range(k):
                subtracted[i, a, m] = -along[i, a, m]
    sums, slope = np.zeros((n, rows, rows)), np.zeros((n, rows))
    for start in range(0, p, BLOCK):
        stop = min(start + BLOCK, p)
        for i in range(n):
            for a in range(0, rows, 3):
                axes = G[a : a + 3] if G.shape[0] == 9 else G[:3]
                hat = hats[corner + a // 3, start:stop]
                _columns(hat, axes, i, subtracted[i, a : a + 3], basis, start, columns[a : a + 3])
            _add_system(columns, stop - start, weights[i, start:stop], residual[i, start:stop], sums[i], slope[i])
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
        projected[m, : stop - start] = 0
    add_rows_to_all(projected, np.int64(0), stop - start, forth, G, start)
    add_rows_to_all(G, start, stop - start, back, projected, np.int64(0))


@plain
def _add_products(axes, i, start, rows, width, sums):
    """sums (3, k) += the inner products of three components of a derivative with k rows of `width` samples."""
    stop = start + width
    a0, a1, a2 = axes[0, i, start:stop], axes[1, i, start:stop], axes[2, i, start:stop]
    m = 0
    while m + 3 <= sums.shape[1]:
        products = dot_three_by_three(a0, a1, a2, rows[m, :width], rows[m + 1, :width], rows[m + 2, :width])
        for b in range(9):
            sums[b // 3, m + b % 3] += products[b]
        m += 3
    while m < sums.shape[1]:
        products = dot_three(rows[m, :width], a0, a1, a2)
        for b in range(3):
            sums[b, m] += products[b]
        m += 1


@plain
def _columns(hat, axes, i, factors, basis, start, columns):
    """hat * axes[:, i] plus the product of factors (3, k) with the basis, for a block of samples, into columns (3, BLOCK)."""
    width, k = hat.shape[0], factors.shape[1]
    stop = start + width
    leading = np.zeros((3, 3), dtype=np.float32)  # a missing row of the basis is another one with factors of zero
    for b in range(3):
        for m in range(min(k, 3)):
            leading[b, m] = factors[b, m]
    _three_columns(
        hat, axes[0, i, start:stop], axes[1, i, start:stop], axes[2, i, start:stop], leading,
        basis[0, start:stop], basis[min(1, k - 1), start:stop], basis[min(2, k - 1), start:stop],
        columns[0, :width], columns[1, :width], columns[2, :width],
    )  # fmt: skip
    if k > 3:
        for b in range(3):
            add_rows(columns[b, :width], factors[b, 3:], basis[3:], start)


@plain
def _three_columns(hat, g0, g1, g2, f, r0, r1, r2, c0, c1, c2):
    """Columns c = hat * g + f r for three axes and three rows r, in one pass; f: (3, 3)."""
    f00, f01, f02, f10, f11, f12, f20, f21, f22 = (
        f[0, 0], f[0, 1], f[0, 2], f[1, 0], f[1, 1], f[1, 2], f[2, 0], f[2, 1], f[2, 2],
    )  # fmt: skip
    for s in range(hat.shape[0]):
        c0[s] = hat[s] * g0[s] + f00 * r0[s] + f01 * r1[s] + f02 * r2[s]
        c1[s] = hat[s] * g1[s] + f10 * r0[s] + f11 * r1[s] + f12 * r2[s]
        c2[s] = hat[s] * g2[s] + f20 * r0[s] + f21 * r1[s] + f22 * r2[s]


@plain
def _add_system(columns, width, weight, residual, H, g):
    """Add sum of w D_a D_b and w e D_a of a block, `width` samples, to the lower triangle of H and to g."""
    for a in range(0, columns.shape[0], 3):
        a0, a1, a2 = columns[a, :width], columns[a + 1, :width], columns[a + 2, :width]
        own = _sums_of_three(a0, a1, a2, weight, residual)
        at = 3  # H's lower triangle follows the gradient
        for b in range(3):
            g[a + b] += own[b]
            for c in range(b + 1):
                H[a + b, a + c] += own[at]
                at += 1
        for b in range(0, a, 3):
            b0, b1, b2 = columns[b, :width], columns[b + 1, :width], columns[b + 2, :width]
            products = _weighted_products(weight, a0, a1, a2, b0, b1, b2)
            for c in range(9):
                H[a + c // 3, b + c % 3] += products[c]


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


@fast
def _weighted_products(weight, a0, a1, a2, b0, b1, b2):
    """The nine sums of weight * a * b of two corners in one pass, by rows of H."""
    zero = np.float32(0)
    h00, h01, h02, h10, h11, h12, h20, h21, h22 = zero, zero, zero, zero, zero, zero, zero, zero, zero
    for t in range(a0.shape[0]):
        w0, w1, w2 = weight[t] * a0[t], weight[t] * a1[t], weight[t] * a2[t]
        h00 += w0 * b0[t]
        h01 += w0 * b1[t]
        h02 += w0 * b2[t]
        h10 += w1 * b0[t]
        h11 += w1 * b1[t]
        h12 += w1 * b2[t]
        h20 += w2 * b0[t]
        h21 += w2 * b1[t]
        h22 += w2 * b2[t]
    return h00, h01, h02, h10, h11, h12, h20, h21, h22

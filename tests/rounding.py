"""How far results of the compiled loops may lie from exact ones, from the rounding of float32 alone.

Compilers add in another order on every kind of processor, and fuse products with additions on some. Bounds for a result must
hold for all of them, so they rest on a model, not on what one processor computes: an operation errs by at most u = 2^-24 of
its result, and the errors of different operations are independent with mean zero (Higham and Mary, A new approach to
probabilistic rounding error analysis, SIAM J. Sci. Comput. 41, 2019). A sum of n terms, in any order, then has a deviation of
at most u sqrt(n) S with S the sum of the terms' sizes: no partial sum is larger. Deviations of independent errors add in
squares. Results lie within `CONFIDENCE` deviations; by their inequality a single one does not with a probability of 3e-8.
"""

from dataclasses import dataclass

import numpy as np

U = 2.0**-24
"""Unit roundoff of float32."""
CONFIDENCE = 6.0
"""Deviations."""


def few(operations: int) -> float:
    """Largest relative error of a product or quotient after so many operations: too few of them for statistics."""
    return operations * U / (1 - operations * U)


def of_sum(terms: int) -> float:
    """Largest error of a sum of so many products in float32, as a part of the sum of their sizes."""
    return CONFIDENCE * U * float(np.sqrt(terms + 1))


def sum_deviation(products: np.ndarray, block: int) -> np.ndarray:
    """Deviations (...) of sums over the last axis: float32 within blocks, float64 over the blocks.

    Args:
        products: (..., p) float: the terms.
        block: terms that are added in float32.
    """
    starts = np.arange(0, products.shape[-1], block)
    sizes = np.add.reduceat(np.abs(products), starts, axis=-1)
    return U * np.sqrt(min(block, products.shape[-1]) + 1) * np.sqrt((sizes**2).sum(axis=-1))


@dataclass(frozen=True, eq=False)
class EigenspaceTolerance:
    """Tolerances of an eigenspace that was computed from the Gram matrix of the cells A = W diag(s) Z, to first order.

    An error E of the Gram matrix changes the square of the m-th singular value by w_m' E w_m, and turns w_m towards w_j by
    w_j' E w_m / (s_m^2 - s_j^2), however close the values: small ones lose (s_1 / s_m)^2 of the digits.

    Attributes:
        values: (k,) of the singular values.
        cosines: (k,) of the cosines between a left singular vector and the exact one.
        basis: (k,) of the inner products of a basis image with the exact one.
        residual: (n, p) of the cells' residuals.
        angles: (k, n - k) by which left singular vectors that are kept turn towards those that are left out.
    """

    values: np.ndarray
    cosines: np.ndarray
    basis: np.ndarray
    residual: np.ndarray
    angles: np.ndarray

    @classmethod
    def of(cls, cells: np.ndarray, k: int, block: int) -> "EigenspaceTolerance":
        """Of exact cells (n, p), k dimensions and blocks of samples that are multiplied in float32."""
        W, s, Z = np.linalg.svd(cells, full_matrices=False)
        n = len(cells)
        gram = sum_deviation(cells[:, None] * cells[None], block)
        # w_j' E w_m for all j, m; E is symmetric, so that an error off the diagonal counts twice.
        error = np.sqrt(2 * (W.T**2) @ gram**2 @ W**2)
        with np.errstate(divide="ignore"):
            turned = error / np.abs(s[:, None] ** 2 - s**2)
        np.fill_diagonal(turned, 0)
        values = np.diag(error)[:k] / (2 * s[:k])
        # basis = factors (k, n) float32 times the cells, n terms for each sample
        factors = W[:, :k].T / s[:k, None]
        sample = U * np.sqrt(n + 1) * (np.abs(factors) @ np.abs(cells))
        rounded = U * np.sqrt((factors**2) @ (cells @ Z[:k].T) ** 2).diagonal()
        basis = values / s[:k] + rounded + np.sqrt(((Z[:k] * sample) ** 2).sum(axis=1))
        # residual = cells - back (n, k) float32 times the basis; what is kept and what is left turn into each other
        back = np.abs(W[:, :k] * s[:k])
        kept, left = turned[:k, k:], np.abs(s[k:, None] * Z[k:])
        moved = np.abs(W[:, k:]) @ kept.T @ np.abs(s[:k, None] * Z[:k]) + np.abs(W[:, :k]) @ kept @ left
        products = U * np.sqrt(k + 2) * (np.abs(cells) + back @ np.abs(Z[:k]))
        residual = moved + products + back @ (sample + U * np.abs(factors) @ np.abs(cells))
        cosines = CONFIDENCE**2 / 2 * (turned[:, :k] ** 2).sum(axis=0) + 1e-14
        return cls(CONFIDENCE * values, cosines, CONFIDENCE * basis + cosines, CONFIDENCE * residual, CONFIDENCE * kept)


@dataclass(frozen=True, eq=False)
class SystemTolerance:
    """Tolerances of a face's normal equations, sums of w D_a D_b and w e D_a over views and samples.

    D = (I - U U^T) (hat * G) (I - V V^T) errs twice: each sample by the operations that make it, and all samples of a view
    together by the sums over samples along the basis images.

    Attributes:
        H, g: (c, c) and (c,), of each sum.
    """

    H: np.ndarray
    g: np.ndarray

    @classmethod
    def of(
        cls,
        hat_G: np.ndarray,
        V: np.ndarray,
        basis: np.ndarray,
        D: np.ndarray,
        e: np.ndarray,
        w: np.ndarray,
        block: int,
    ) -> "SystemTolerance":
        """Of exact values.

        Args:
            hat_G: (c, n, p): derivatives of the cells by c coordinates, times the corner's hat.
            V: (n, k), and basis (k, p): what is projected out.
            D: (c, n, p): derivatives of the residual.
            e, w: (n, p): residuals, and weights times those of the pairs.
            block: samples that are added in float32.
        """
        n, k = V.shape
        made = np.abs(hat_G) + np.abs(V) @ (np.abs(V.T) @ np.abs(hat_G))
        along = sum_deviation(made[:, :, None] * basis, block)  # (c, n, k)
        samples = U * np.sqrt(n + 2 * k + 4) * (made + (made @ np.abs(basis.T)) @ np.abs(basis))
        c = len(D)
        H, g = np.zeros((c, c)), np.zeros(c)
        for a in range(c):
            own = (w * e * samples[a]) ** 2
            together = ((w * e) @ basis.T * along[a]) ** 2
            g[a] = own.sum() + together.sum() + (sum_deviation(w * e * D[a], block) ** 2).sum()
            for b in range(c):
                pairs = ((a, b), (b, a))
                own = sum((w * D[x] * samples[y]) ** 2 for x, y in pairs)
                together = sum(((w * D[x]) @ basis.T * along[y]) ** 2 for x, y in pairs)
                H[a, b] = own.sum() + together.sum() + (sum_deviation(w * D[a] * D[b], block) ** 2).sum()
        return cls(CONFIDENCE * np.sqrt(H), CONFIDENCE * np.sqrt(g))


@dataclass(frozen=True, eq=False)
class FaceTolerance:
    """Tolerances of a face's energy and normal equations that are computed from its photos, with the Geman-McClure norm.

    To the errors of the sums (`SystemTolerance`) add, to first order, those of what is summed: samples are read beside their
    places, residuals have the errors of the eigenspace, and what is projected out turns with it.

    Attributes:
        energy: of the weighted sum of rho.
        H, g: (c, c) and (c,), of each sum.
    """

    energy: float
    H: np.ndarray
    g: np.ndarray

    @classmethod
    def of(
        cls,
        cells: np.ndarray,
        cells_moved: np.ndarray,
        hat_G: np.ndarray,
        hat_G_moved: np.ndarray,
        k: int,
        projects: bool,
        weights: np.ndarray,
        sigma: float,
        block: int,
        gram_block: int,
    ) -> "FaceTolerance":
        """Of exact values.

        Args:
            cells: (n, p).
            hat_G: (c, n, p): derivatives of the cells by c coordinates, times the corner's hat.
            cells_moved, hat_G_moved: largest changes of these by errors of the samples' places.
            k: dimensions of the eigenspace.
            projects: whether it is projected out of the derivatives; U and c are held fixed otherwise.
            weights: (n,): of the views.
            sigma: scale of the norm.
            block, gram_block: samples that are added in float32, for the equations and for the Gram matrix.
        """
        W, s, Z = np.linalg.svd(cells, full_matrices=False)
        fit = EigenspaceTolerance.of(cells, k, gram_block)
        V, basis = (W[:, :k], Z[:k]) if projects else (W[:, :0], Z[:0])

        def without_views(x: np.ndarray) -> np.ndarray:
            return x - V @ (V.T @ x)

        def without_samples(x: np.ndarray) -> np.ndarray:
            return x - (x @ basis.T) @ basis

        e = cells - (W[:, :k] * s[:k]) @ Z[:k]
        D = without_samples(without_views(hat_G))
        w = weights[:, None] * 2 * sigma**2 / (sigma**2 + e**2) ** 2
        # g and H are the inner products of factors (1 + c, n, p) and D. First the factors err with the residual.
        of_e = np.hypot(fit.residual, cells_moved)
        slope = w * (sigma**2 - 3 * e**2) / (sigma**2 + e**2)
        steepness = w * 4 * np.abs(e) / (sigma**2 + e**2)
        of_factors = np.concatenate([slope[None], steepness * D]) * of_e
        by_residual = np.sqrt(np.einsum("anp,bnp->ab", of_factors**2, D**2))
        # D errs with the slopes of the photos, and as kept singular vectors turn towards others: those of samples by the ratio of
        # singular values less. What is projected out of D might as well be projected out of the factor.
        factors = np.concatenate([(w * e)[None], w * D])
        projected = np.abs(without_samples(without_views(factors)))
        by_derivative = np.einsum("anp,bnp->ab", projected, hat_G_moved)
        if projects:

            def crossed(x: np.ndarray, y: np.ndarray) -> np.ndarray:
                """(a, b, k, n - k): kept rows of one and rows of the other that are left out, both ways round."""
                products = np.einsum("aip,bjp->abij", x, y)
                return products[:, :, :k, k:] + np.swapaxes(products[:, :, k:, :k], 2, 3)

            of_views = crossed(W.T @ factors, W.T @ without_samples(hat_G))
            of_samples = crossed(*(np.swapaxes(x @ Z.T, 1, 2) for x in (factors, without_views(hat_G))))
            turns = fit.angles * (of_views + s[k:] / s[:k, None] * of_samples)
            by_derivative += np.sqrt((turns**2).sum(axis=(2, 3)))
        sums = SystemTolerance.of(hat_G, V, basis, D, e, w, block)
        total = weights @ (e**2 / (sigma**2 + e**2)).sum(axis=1)
        energy = np.sqrt(((w * e * of_e) ** 2).sum()) + (few(10) + of_sum(block)) * total
        H = sums.H + by_residual[1:] + by_derivative[1:] + by_derivative[1:].T
        return cls(float(energy), H, sums.g + by_residual[0] + by_derivative[0])

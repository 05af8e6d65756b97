"""Normal equations of a term of the objective, row by row."""

import numpy as np

from fairing.optimize.rows import Anchor, Rows, Term


def dense(term: Term, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3 n, 3 n) reweighted normal matrix and (3 n,) gradient of a term, row by row."""
    size = vertices.size
    H, g = np.zeros((size, size)), np.zeros(size)
    if isinstance(term, Anchor):
        for v, (precision, place) in enumerate(zip(term.precision, term.places, strict=True)):
            own = slice(3 * v, 3 * v + 3)
            H[own, own] += precision
            g[own] += precision @ (vertices[v] - place)
        return H, g
    assert isinstance(term, Rows)
    for r, corners in enumerate(term.ids):
        J, residual = np.zeros(size), term.residuals[r]
        for corner, derivative in zip(corners, term.derivatives[r], strict=True):
            J[3 * corner : 3 * corner + 3] = derivative
            residual += derivative @ (vertices - term.begun)[corner]
        weight = term.information[r] * float(term.loss.weight(np.array([residual]))[0])
        H += weight * np.outer(J, J)
        g += weight * residual * J
    return H, g

"""Points and triangles, one triangle a point: closest points and barycentric coordinates, at any scale."""

import numpy as np

_ONES = np.ones(3)


def closest_on_triangles(triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(p, 3) float: the point of each triangle (p, 3, 3) float that is closest to a point (p, 3) float, in the same units.

    By the regions of the triangle's vertices, edges and inside (Ericson, Real-Time Collision Detection, 5.1.5). A triangle with
    coinciding corners counts as the edge between the others.
    """
    scale = _scales(triangles)
    a, b, c = np.moveaxis(triangles, 1, 0)
    ab, ac, bc = ((end - start) * scale for start, end in ((a, b), (a, c), (b, c)))
    ap, bp, cp = ((points - corner) * scale for corner in (a, b, c))
    d1, d2, d3, d4, d5, d6 = ((side * offset) @ _ONES for offset in (ap, bp, cp) for side in (ab, ac))
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    on_ab, on_ac = d1 / _not_zero(d1 - d3), d2 / _not_zero(d2 - d6)
    on_bc = (d4 - d3) / _not_zero((d4 - d3) + (d5 - d6))
    inside = 1 / _not_zero(va + vb + vc)
    back = 1 / scale
    return np.select(
        [
            is_at[:, None]
            for is_at in (
                (d1 <= 0) & (d2 <= 0),
                (d3 >= 0) & (d4 <= d3),
                (vc <= 0) & (d1 >= 0) & (d3 <= 0) & (d1 > d3),
                (d6 >= 0) & (d5 <= d6),
                (vb <= 0) & (d2 >= 0) & (d6 <= 0),
                (va <= 0) & (d4 >= d3) & (d5 >= d6),
            )
        ],
        [
            a,
            b,
            a + on_ab[:, None] * ab * back,
            c,
            a + on_ac[:, None] * ac * back,
            b + on_bc[:, None] * bc * back,
        ],
        a + ab * (vb * inside)[:, None] * back + ac * (vc * inside)[:, None] * back,
    )


def barycentric(triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(p, 3) float: coordinates of the points' projections (p, 3) float onto the planes of their triangles (p, 3, 3) float.

    By Cramer's rule. The coordinates of a triangle without area are zero but for the first.
    """
    scale = _scales(triangles)
    u, v, w = ((end - triangles[:, 0]) * scale for end in (triangles[:, 1], triangles[:, 2], points))
    uu, uv, uw, vv, vw = ((one * other) @ _ONES for one, other in ((u, u), (u, v), (u, w), (v, v), (v, w)))
    determinant = uu * vv - uv * uv
    inverse = np.where(determinant > 0, 1 / _not_zero(determinant), 0)
    second, third = (vv * uw - uv * vw) * inverse, (uu * vw - uv * uw) * inverse
    return np.column_stack([1 - second - third, second, third])


def _scales(triangles: np.ndarray) -> np.ndarray:
    """(p, 1) float: powers of two, which round nothing, that bring the triangles to a size of about 1."""
    size = np.ptp(triangles, axis=1).max(axis=1, keepdims=True)
    return np.ldexp(1.0, -np.frexp(size)[1])


def _not_zero(values: np.ndarray) -> np.ndarray:
    return np.where(values == 0, 1, values)

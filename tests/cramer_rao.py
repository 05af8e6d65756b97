"""How precisely any method could place a vertex: the Cramer-Rao bound with unknown texture."""

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter

from fairing.cells import cell_grid
from fairing.scene import Scene

CELL_SIZE = 192


def bound(scene: Scene, vertex: int, noise: float) -> float:
    """Least rms distance (world units) of an unbiased estimate of one vertex, all others known.

    The texture is unknown: n photos see a texel through its grey level and g_i, the derivative of photo i by the
    vertex. Eliminating the level leaves the information

        sum over texels of [sum_i d_i g_i g_i^T - (sum_i d_i g_i)(sum_i d_i g_i)^T / sum_i d_i] / noise^2,

    with d_i the pixels of photo i that fall on the texel.

    Args:
        noise: standard deviation of a photo's noise, grey levels of the luma.
    """
    assert scene.truth is not None
    assert scene.truth.vertices is not None
    vertices = scene.truth.vertices
    luma = [view.photo.load().astype(float) @ np.array([0.299, 0.587, 0.114]) for view in scene.views]
    splines = [spline_filter(photo, order=3, mode="mirror") for photo in luma]
    ramp = cell_grid(CELL_SIZE).astype(float)
    bary = np.stack([ramp[0], ramp[1], 1 - ramp[0] - ramp[1]], axis=1)
    information = np.zeros((3, 3))
    for face in np.flatnonzero((scene.mesh.faces == vertex).any(axis=1)):
        corners = vertices[scene.mesh.faces[face]]
        hat = bary[:, int(np.flatnonzero(scene.mesh.faces[face] == vertex)[0])]
        points = bary @ corners
        g, d = [], []
        for view, spline in zip(scene.views, splines, strict=True):
            uv, _ = view.camera.project(points)
            gradient = np.stack(
                [_slope(spline, uv, np.array([1.0, 0.0])), _slope(spline, uv, np.array([0.0, 1.0]))], axis=1
            )
            J = view.camera.J_image_wrt_point(points)
            g.append(hat[:, None] * np.einsum("pi,pij->pj", gradient, J))
            # Pixels a texel: the photo's area per area of the face, times the face's area per texel.
            edges = corners[:2] - corners[2]
            stretch = np.abs(np.linalg.det(J @ edges.T))
            d.append(stretch / 2 / len(points))
        g, d = np.array(g), np.array(d)
        weighted = d[..., None] * g
        information += np.einsum("npi,npj->ij", weighted, g)
        mean = weighted.sum(axis=0)
        information -= np.einsum("pi,pj->ij", mean / d.sum(axis=0)[:, None], mean)
    return float(np.sqrt(np.trace(np.linalg.inv(information / noise**2))))


def _slope(spline: np.ndarray, uv: np.ndarray, direction: np.ndarray, step: float = 0.05) -> np.ndarray:
    """Derivative of the spline through the photo along a direction, grey levels / px."""
    ahead, behind = uv + step * direction, uv - step * direction
    return (
        map_coordinates(spline, ahead.T[::-1], order=3, mode="mirror", prefilter=False)
        - map_coordinates(spline, behind.T[::-1], order=3, mode="mirror", prefilter=False)
    ) / (2 * step)

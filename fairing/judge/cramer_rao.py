"""Cramer-Rao bound: the least error with which any unbiased method can estimate a vertex when the texture is unknown."""

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter

from fairing.cells.layout import cell_grid
from fairing.cells.scale_space import LUMA
from fairing.errors import InputError
from fairing.photo import grey_levels
from fairing.scene import Scene, View

CELL_SIZE = 192  # texels along a leg of a face
ROUNDING = 1 / 12  # variance of rounding to whole grey levels


def luma_noise(noise: float) -> float:
    """Standard deviation of the luma's noise, grey levels, for 8-bit channels with independent noise of this deviation."""
    return float(np.linalg.norm(LUMA) * np.sqrt(noise**2 + ROUNDING))


def cramer_rao_covariance(
    scene: Scene, vertex: int, noise: float, views_of_face: dict[int, np.ndarray] | None = None
) -> np.ndarray:
    """Least covariance of an unbiased estimate of one vertex, all others known.

    The texture is unknown: n photos see a texel through its grey level and g_i, the derivative of photo i by the
    vertex. Eliminating the level leaves the information

        sum over texels of [sum_i d_i g_i g_i^T - (sum_i d_i g_i)(sum_i d_i g_i)^T / sum_i d_i] / noise^2,

    with d_i the pixels of photo i that fall on the texel. Its inverse is the bound (Rao 1945; Cramer 1946). Occlusion
    within a face is ignored: with partly hidden faces the bound is too low.

    Args:
        vertex: vertex id.
        noise: standard deviation of a photo's noise, grey levels of the luma (`luma_noise`).
        views_of_face: for each face around the vertex the ids (n,) int of the views that see it; default: all views.

    Returns:
        (3, 3) float, world units squared.

    Raises:
        InputError: the scene's truth is unknown, or the photos leave a direction of the vertex undetermined.
    """
    if scene.truth is None or scene.truth.vertices is None:
        raise InputError(
            f"scene {scene.name}: the bound needs the true positions of its vertices, and they are unknown"
        )
    vertices, everyone = scene.truth.vertices, np.arange(len(scene.views))
    around = scene.mesh.one_rings[vertex]
    splines: dict[int, np.ndarray] = {}
    ramp = cell_grid(CELL_SIZE).astype(float)
    bary = np.stack([ramp[0], ramp[1], 1 - ramp[0] - ramp[1]], axis=1)
    information = np.zeros((3, 3))
    for face in around.tolist():
        corners = vertices[scene.mesh.faces[face]]
        hat = bary[:, int(np.flatnonzero(scene.mesh.faces[face] == vertex)[0])]
        points = bary @ corners
        g, d = [], []
        for view_id in (everyone if views_of_face is None else views_of_face[face]).tolist():
            view = scene.views[view_id]
            if view_id not in splines:
                luma = grey_levels(view.photo.full_depth()).astype(float) @ LUMA
                splines[view_id] = spline_filter(luma, order=3, mode="mirror")
            J = view.camera.J_image_wrt_point(points)
            uv, _ = view.camera.project(points)
            gradient = np.stack([_slope(splines[view_id], uv, axis) for axis in np.eye(2)], axis=1)
            g.append(hat[:, None] * np.einsum("pi,pij->pj", gradient, J))
            # Pixels per texel: the photo's area per area of the face, times the face's area per texel.
            edges = corners[:2] - corners[2]
            stretch = np.abs(np.linalg.det(J @ edges.T))
            d.append(np.where(_inside(view, uv), stretch / 2 / len(points), 0.0))
        if g:
            information += _information(np.array(g), np.array(d))
    values, vectors = np.linalg.eigh(information)
    if not values[0] > 1e-12 * values[2]:
        raise InputError(f"vertex {vertex}: the photos leave a direction undetermined, so its error has no bound")
    return noise**2 * (vectors / values) @ vectors.T


def cramer_rao_bound(scene: Scene, vertex: int, noise: float) -> float:
    """Least rms distance, world units, of an unbiased estimate of a vertex that all photos see; see
    `cramer_rao_covariance`."""
    return float(np.sqrt(np.trace(cramer_rao_covariance(scene, vertex, noise))))


def _information(g: np.ndarray, d: np.ndarray) -> np.ndarray:
    """(3, 3) float: the information of `cramer_rao_covariance` times noise^2, from g (n, p, 3) and d (n, p)."""
    weighted = d[..., None] * g
    mean = weighted.sum(axis=0)
    total = np.maximum(d.sum(axis=0), 1e-300)
    return np.einsum("npi,npj->ij", weighted, g) - np.einsum("pi,pj->ij", mean / total[:, None], mean)


def _inside(view: View, uv: np.ndarray) -> np.ndarray:
    size = np.array([view.camera.width, view.camera.height])
    return np.all((uv >= 0) & (uv <= size - 1), axis=1)


def _slope(spline: np.ndarray, uv: np.ndarray, direction: np.ndarray, step: float = 0.05) -> np.ndarray:
    """Derivative of the spline through the photo along a direction, grey levels / px."""
    ahead, behind = uv + step * direction, uv - step * direction
    return (
        map_coordinates(spline, ahead.T[::-1], order=3, mode="mirror", prefilter=False)
        - map_coordinates(spline, behind.T[::-1], order=3, mode="mirror", prefilter=False)
    ) / (2 * step)

"""Lines of sight through tetrahedra: the costs of facets that hide points from cameras that see them.

Labatut, Pons, Keriven: Robust and Efficient Surface Reconstruction from Range Data, CGF 2009. A facet that crosses the line from
a point to a camera adds 1 - exp(-d^2 / (2 sigma^2)), d its distance from the point, since points are uncertain by sigma. The
tetrahedron 3 sigma behind the point is inside by 1; facets between it and the point add by the same rule.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from fairing.triangulation.tetrahedra import CORNERS, Tetrahedra
from fairing.util.compiled_only import COMPILED_ONLY

BEHIND = 3.0
"""The distance behind a point, in sigma, that is taken to be inside."""


class SightCosts(NamedTuple):
    """Sums over lines of sight.

    Attributes:
        crossing: (T, 4) float: cost if a tetrahedron is outside and the one beyond a facet inside.
        inside: (T,) float: cost if a tetrahedron is outside although it is behind points.
        passing: (T,) float: of each line that reaches a camera through a tetrahedron, the cost of the facet through which it
            comes from the point. The cut does not use it.
    """

    crossing: np.ndarray
    inside: np.ndarray
    passing: np.ndarray


def sight_costs(mesh: Tetrahedra, point_ids: np.ndarray, view_ids: np.ndarray, sigma: np.ndarray) -> SightCosts:
    """Sum the costs of all lines of sight.

    Args:
        point_ids, view_ids: (r,) int: the point and the camera of each line.
        sigma: (n,) float: uncertainty of each point along a line of sight, in units of `mesh.places`.
    """
    n = len(mesh.corners)
    costs = SightCosts(np.zeros((n, 4)), np.zeros(n), np.zeros(n))
    order = np.argsort(mesh.corners.ravel(), kind="stable")
    first = np.searchsorted(mesh.corners.ravel()[order], np.arange(len(mesh.places) + 1))
    # numba compiles again for arrays with strides.
    point_ids, view_ids = np.ascontiguousarray(point_ids), np.ascontiguousarray(view_ids)
    _walk_all(
        mesh.places, mesh.corners, mesh.neighbours, order // 4, first, mesh.cameras, point_ids, view_ids, sigma,
        CORNERS, *costs,
    )  # fmt: skip
    return costs


@njit(nogil=True, **COMPILED_ONLY)
def _height(places, p, q, r, x, y, z):
    """Product of a direction (x, y, z) with the normal of the triangle p, q, r."""
    ux, uy, uz = places[q, 0] - places[p, 0], places[q, 1] - places[p, 1], places[q, 2] - places[p, 2]
    vx, vy, vz = places[r, 0] - places[p, 0], places[r, 1] - places[p, 1], places[r, 2] - places[p, 2]
    return (uy * vz - uz * vy) * x + (uz * vx - ux * vz) * y + (ux * vy - uy * vx) * z


@njit(nogil=True, **COMPILED_ONLY)
def _first(places, corners, incident, first, facets, point, x, y, z):
    """The tetrahedron at a point that a direction enters, and its facet opposite the point, through which the line leaves."""
    best, chosen, apex = -np.inf, -1, 0
    for i in range(first[point], first[point + 1]):
        t = incident[i]
        k = 0
        while corners[t, k] != point:
            k += 1
        least = np.inf
        for f in range(4):
            if f != k:  # the facets at the point: the direction must not leave through them
                p, q, r = corners[t, facets[f, 0]], corners[t, facets[f, 1]], corners[t, facets[f, 2]]
                least = min(least, -_height(places, p, q, r, x, y, z))
        if least > best:
            best, chosen, apex = least, t, k
    return chosen, apex


@njit(nogil=True, **COMPILED_ONLY)
def _parameter(places, corners, facets, t, facet, ox, oy, oz, x, y, z):
    """Where a line (origin o, direction) leaves through a facet's plane: its parameter; infinite if it enters there."""
    p, q, r = corners[t, facets[facet, 0]], corners[t, facets[facet, 1]], corners[t, facets[facet, 2]]
    along = _height(places, p, q, r, x, y, z)
    if along <= 0:
        return np.inf
    return _height(places, p, q, r, places[p, 0] - ox, places[p, 1] - oy, places[p, 2] - oz) / along


@njit(nogil=True, **COMPILED_ONLY)
def _exit(places, corners, facets, t, entry, ox, oy, oz, x, y, z):
    """The facet through which a line leaves a tetrahedron that it entered through another, and the parameter there."""
    facet, least = -1, np.inf
    for f in range(4):
        if f != entry:
            at = _parameter(places, corners, facets, t, f, ox, oy, oz, x, y, z)
            if at < least:
                facet, least = f, at
    return facet, least


@njit(cache=True, nogil=True)
def _walk_all(
    places, corners, neighbours, incident, first, cameras, point_ids, view_ids, sigma, facets, crossing, inside, passing
):
    """Add the costs of all lines into `crossing`, `inside` and `passing`."""
    for ray in range(len(point_ids)):
        point, view = point_ids[ray], view_ids[ray]
        ox, oy, oz = places[point, 0], places[point, 1], places[point, 2]
        x, y, z = cameras[view, 0] - ox, cameras[view, 1] - oy, cameras[view, 2] - oz
        length = np.sqrt(x * x + y * y + z * z)
        x, y, z = x / length, y / length, z / length
        scale = -0.5 / sigma[point] ** 2
        for side in (1.0, -1.0):
            end = length if side > 0 else BEHIND * sigma[point]
            t, facet = _first(places, corners, incident, first, facets, point, side * x, side * y, side * z)
            at = _parameter(places, corners, facets, t, facet, ox, oy, oz, side * x, side * y, side * z)
            for _ in range(len(corners)):
                if facet < 0 or not at < end or neighbours[t, facet] < 0:
                    break
                weight = 1 - np.exp(scale * at * at)
                beyond = neighbours[t, facet]
                back = 0
                while neighbours[beyond, back] != t:
                    back += 1
                if side > 0:
                    crossing[beyond, back] += weight
                    passing[beyond] += weight
                else:
                    crossing[t, facet] += weight
                t = beyond
                facet, following = _exit(places, corners, facets, t, back, ox, oy, oz, side * x, side * y, side * z)
                at = max(at, following)
            if side < 0:
                inside[t] += 1.0

"""Split of a capture's sparse points: every second one is used for fits, the others are held out for evaluation.

Points that are vertices of the start, as in a mesh triangulated from them, are not held out: it was made of them.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from fairing.features.points import FeaturePoints
from fairing.scene import Scene


def fitting_points(scene: Scene) -> np.ndarray:
    """(p, 3) float, world units: the sparse points used for the fit, every second one."""
    return scene.sparse_positions[~_is_second(scene)]


def observed_fitting_points(scene: Scene) -> FeaturePoints:
    """The fitting points that at least two photos observe, with their observations and covariances.

    They cover all that the photos show, the ground and the background too, so they take part only where their own photos see
    the mesh.
    """
    return _observed(scene, ~_is_second(scene))


def observed_held_out_points(scene: Scene) -> FeaturePoints:
    """The points held out for evaluation that at least two photos observe, with their observations and covariances."""
    return _observed(scene, _is_held_out(scene))


def held_out_points(scene: Scene) -> np.ndarray:
    """(p, 3) float, world units: the sparse points held out for evaluation."""
    return scene.sparse_positions[_is_held_out(scene)]


def _observed(scene: Scene, taking_part: np.ndarray) -> FeaturePoints:
    """Those of the points (p,) bool that at least two photos observe."""
    sparse = scene.sparse_points
    if sparse is None:
        return FeaturePoints.none("no sparse points")
    used = taking_part[sparse.observations[:, 0]]
    sparse = replace(sparse, observations=sparse.observations[used], pixels=sparse.pixels[used])
    return FeaturePoints.of_sparse_points(sparse, [view.camera for view in scene.views])


def _is_second(scene: Scene) -> np.ndarray:
    """(p,) bool: the half that no fit uses."""
    return np.arange(len(scene.sparse_positions)) % 2 == 1


def _is_held_out(scene: Scene) -> np.ndarray:
    """(p,) bool: that half without points at vertices of the start."""
    return _is_second(scene) & ~_are_vertices(scene)


def _are_vertices(scene: Scene) -> np.ndarray:
    """(p,) bool: points at vertices of the start."""
    if len(scene.sparse_positions) == 0:
        return np.zeros(0, dtype=bool)
    rounding = 1e-5 * scene.mesh.diagonal  # of positions in mesh files
    return KDTree(scene.mesh.vertices).query(scene.sparse_positions, distance_upper_bound=rounding)[0] < np.inf

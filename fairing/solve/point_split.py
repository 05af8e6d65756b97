"""Split of a capture's sparse points: every second one is used for fits, the others are held out for evaluation."""

from dataclasses import replace

import numpy as np

from fairing.features.points import FeaturePoints
from fairing.scene import Scene


def fitting_points(scene: Scene) -> np.ndarray:
    """(p, 3) float, world units: the sparse points used for the fit, every second one."""
    return scene.sparse_positions[::2]


def observed_fitting_points(scene: Scene) -> FeaturePoints:
    """The fitting points that at least two photos observe, with their observations and covariances.

    They cover all that the photos show, the ground and the background too, so they take part only where their own photos see
    the mesh.
    """
    sparse = scene.sparse_points
    if sparse is None:
        return FeaturePoints.none("no sparse points")
    used = sparse.observations[:, 0] % 2 == 0
    sparse = replace(sparse, observations=sparse.observations[used], pixels=sparse.pixels[used])
    return FeaturePoints.of_sparse_points(sparse, [view.camera for view in scene.views])


def kept_points(scene: Scene) -> np.ndarray:
    """(p, 3) float, world units: the sparse points kept for evaluation."""
    return scene.sparse_positions[1::2]

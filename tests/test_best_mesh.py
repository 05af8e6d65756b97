"""The best mesh of a connectivity, against all inflated ones on a cap of the sphere."""

import numpy as np
import pytest

from demo_scenes.dome import sphere_cap
from fairing.judge.metrics import surface_distance
from tests.best_mesh import best_mesh

pytestmark = pytest.mark.slow


def test_the_best_mesh_is_at_least_as_near_as_the_best_inflated_one():
    coarse, fine = sphere_cap(3), sphere_cap(24)
    best = best_mesh(coarse, [vertex[None] for vertex in coarse.vertices], fine)

    def rms(mesh) -> float:
        return float(np.sqrt((surface_distance(mesh, fine, 1.0).values ** 2).mean()))

    inflated = min(rms(coarse.moved(factor * coarse.vertices)) for factor in np.linspace(1, 1.06, 121))
    assert 0.8 * inflated < rms(best) <= inflated < 0.5 * rms(coarse)


def test_a_mesh_that_is_the_truth_stays():
    mesh = sphere_cap(3)
    best = best_mesh(mesh, [vertex[None] for vertex in mesh.vertices], mesh)
    assert np.abs(best.vertices - mesh.vertices).max() < 1e-12

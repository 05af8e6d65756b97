"""Frusta that cover the mesh from an eye."""

import numpy as np

from app.layers.obstruction import covering

SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
EYE = np.array([0.0, 0, 10])


def test_spheres_in_front_cover_the_mesh_and_those_beside_or_behind_it_do_not():
    centers = np.array([[0.0, 0, 5], [0.9, 0, 1], [3.0, 0, 5], [0.0, 0, -5], [0.0, 0, 15]])
    assert covering(EYE, SQUARE, centers, 0.1).tolist() == [True, True, False, False, False]


def test_a_sphere_beside_the_outline_covers_it_once_it_is_large_enough():
    beside = np.array([[1.2, 0.0, 0.5]])
    assert not covering(EYE, SQUARE, beside, 0.05)[0]
    assert covering(EYE, SQUARE, beside, 0.3)[0]

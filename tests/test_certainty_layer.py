"""The ellipsoids' lines lie where the normal matrix says."""

import numpy as np
import pytest

from app.layers.certainty import LONGEST, ellipsoid_lines
from fairing.judge.certainty import Certainty

TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]


def test_every_point_lies_on_the_ellipsoid_of_the_normal_matrix():
    H = TURN @ np.diag([1.0, 4.0, 9.0]) @ TURN.T
    center = np.array([5.0, -2.0, 1.0])
    offset = ellipsoid_lines(Certainty(0, H, 1.0), center, 0.1) - center
    np.testing.assert_allclose(np.einsum("sei,ij,sej->se", offset, H, offset), 9 * 0.1**2, rtol=1e-9)
    assert np.linalg.norm(offset, axis=-1).max() == pytest.approx(0.3)


def test_a_free_direction_is_drawn_long_but_not_without_end():
    H = TURN @ np.diag([0.0, 1.0, 1.0]) @ TURN.T
    lines = ellipsoid_lines(Certainty(0, H, 1.0), np.zeros(3), 0.1)
    np.testing.assert_allclose(np.abs(lines @ TURN[:, 0]).max(), LONGEST * 0.1)

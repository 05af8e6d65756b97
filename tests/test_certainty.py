"""Certainty of vertices, against geometry and the Cramer-Rao bound."""

import numpy as np
import pytest

from fairing.judge.certainty import certainties
from fairing.judge.cramer_rao import cramer_rao_bound
from fairing.run.session import Session
from fairing.scene import Scene
from tests.small_scene import FACES, VERTICES, corner_scene, photos, small_options

FINEST = small_options(schedule={"blur": [0.3]}, eigenspace={"dimensions": [1]}, cells={"color": False})
MIDDLE = 7  # of the side z = 1


def corner_with_middle(scale: float = 1.0) -> Session:
    """The true corner of the cube, with one of its three sides divided at a vertex in its middle."""
    vertices = scale * np.vstack([VERTICES, [[0.5, 0.5, 1]]])
    faces = np.vstack([[[0, 1, MIDDLE], [1, 2, MIDDLE], [2, 3, MIDDLE], [3, 0, MIDDLE]], FACES[2:]])
    return Session(
        Scene.build("corner", vertices, faces, corner_scene((0, 0, 0), scale=scale).views, points_choice="given"),
        FINEST,
    )


def test_long_within_a_plane_and_nearly_round_at_a_corner():
    middle, corner = certainties(corner_with_middle(), np.array([MIDDLE, 0]))
    assert abs(middle.axes[0, 2]) > 0.95, "best determined along the side's normal"
    assert (middle.lengths[1:] > 2.5).all(), f"within the side {middle.lengths}"
    assert corner.lengths[2] < 2, f"at the corner {corner.lengths}"


def test_axes_and_lengths_are_those_of_the_normal_matrix():
    (found,) = certainties(corner_with_middle(), np.array([0]))
    inverse = np.linalg.inv(found.normal_matrix)
    from_axes = found.axes.T @ np.diag(found.deviations**2) @ found.axes
    np.testing.assert_allclose(from_axes, found.noise * inverse, rtol=1e-9)
    np.testing.assert_allclose(found.lengths, found.deviations / found.deviations[0])


def test_deviations_are_close_to_the_cramer_rao_bound():
    rng, noise = np.random.default_rng(1), 6.0
    noisy = {
        i: np.clip(np.round(photo + rng.normal(0, noise, photo.shape[:2])[..., None]), 0, 255).astype(np.uint8)
        for i, photo in enumerate(photos())
    }
    (found,) = certainties(Session(corner_scene((0, 0, 0), change=noisy), FINEST), np.array([0]))
    expected = cramer_rao_bound(corner_scene((0, 0, 0)), 0, noise)
    assert np.linalg.norm(found.deviations) == pytest.approx(expected, rel=0.3)


def test_deviations_scale_with_the_world():
    small, large = (certainties(corner_with_middle(scale), np.array([MIDDLE]))[0] for scale in (1.0, 8.0))
    np.testing.assert_allclose(large.deviations, 8 * small.deviations, rtol=1e-6)


def test_an_unseen_vertex_is_undetermined():
    session = corner_with_middle()
    session.sweep_state().context.kernel.face_dimensions[:] = 0
    (found,) = certainties(session, np.array([0]))
    assert not found.is_seen
    assert np.isinf(found.lengths).all()
    assert np.isinf(found.deviations).all()


def test_the_run_is_not_changed():
    session, alone = corner_with_middle(), corner_with_middle()
    for _ in range(2):
        certainties(session, np.arange(8))
        np.testing.assert_array_equal(session.step().after, alone.step().after)

"""Shapes of the vertex marks: closed, oriented outward, of the documented size."""

import numpy as np
import pytest
import trimesh

from app.layers.marks import Shape, ball, block, octahedron


@pytest.mark.parametrize(
    ("shape", "n_faces"), [(ball(0), 20), (ball(1), 80), (ball(2), 320), (octahedron(), 8), (block(), 12)]
)
def test_marks_are_closed_convex_and_oriented_outward(shape: Shape, n_faces: int):
    mesh = trimesh.Trimesh(*shape, process=False)
    assert len(mesh.faces) == n_faces
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(mesh.convex_hull.volume, rel=1e-5)


def test_an_octahedron_is_seen_as_large_as_an_icosahedron():
    areas = [trimesh.Trimesh(*shape, process=False).area for shape in (octahedron(), ball(0))]
    assert areas[0] == pytest.approx(areas[1], rel=0.02)


def test_a_ball_is_as_large_as_a_unit_sphere():
    assert np.linalg.norm(ball(1)[0], axis=1) == pytest.approx(np.ones(42), abs=1e-6)

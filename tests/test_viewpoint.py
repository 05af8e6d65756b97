"""The camera flies to where a vertex can be seen: every line of sight is tested against every face."""

import numpy as np
import pytest

from app.page.viewpoint import viewpoint
from fairing.mesh import Mesh

UP = np.array([0.0, 0.0, 1.0])
CAMERAS = np.array([[8.0, -30.0, 20.0], [20.0, 40.0, 30.0]])
SIDE = 17  # vertices


def height_field(heights: np.ndarray) -> Mesh:
    """A square grid of spacing 1 with heights (SIDE, SIDE), its outer side up."""
    y, x = np.mgrid[:SIDE, :SIDE]
    ids = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    a, b, c, d = (part.ravel() for part in (ids[:-1, :-1], ids[:-1, 1:], ids[1:, :-1], ids[1:, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)])
    return Mesh(np.stack([x, y, heights], axis=-1).reshape(-1, 3), faces)


def trenches() -> Mesh:
    """Trenches three times as deep as wide."""
    return height_field(np.tile(9.0 * (np.arange(SIDE) % 6 < 3), (SIDE, 1)))


def floor_and_roof() -> Mesh:
    """A floor and a roof above all of it: no vertex of the floor is seen along its normal."""
    floor = height_field(np.zeros((SIDE, SIDE)))
    both = np.concatenate([floor.vertices, floor.vertices + np.array([0, 0, 6])])
    return Mesh(both, np.concatenate([floor.faces, floor.faces + len(floor.vertices)]))


def is_hidden(mesh: Mesh, vertex: int, eye: np.ndarray) -> bool:
    """Whether a face intersects the line from the eye to the vertex, up to a thousandth before it (Moeller, Trumbore 1997)."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    along = mesh.vertices[vertex] - eye
    p = np.cross(along, c - a)
    determinant = np.einsum("mc,mc->m", p, b - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("mc,mc->m", p, eye - a) / determinant
        q = np.cross(eye - a, b - a)
        v = q @ along / determinant
        t = np.einsum("mc,mc->m", q, c - a) / determinant
        return bool(((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 0.999)).any())


@pytest.mark.parametrize("scene", [trenches, floor_and_roof])
@pytest.mark.parametrize("eye", [(60.0, 8.0, 25.0), (8.0, 8.0, -40.0)], ids=["oblique", "below"])
def test_no_face_hides_a_vertex_from_the_eye(scene, eye):
    mesh = scene()
    hidden = [
        vertex
        for vertex in range(len(mesh.vertices))
        if is_hidden(mesh, vertex, viewpoint(vertex, mesh.vertices, mesh, np.array(eye), UP, CAMERAS))
    ]
    assert hidden == []


def test_a_line_of_sight_that_is_free_is_kept():
    mesh, eye = height_field(np.zeros((SIDE, SIDE))), np.array([30.0, 20.0, 25.0])
    vertex = SIDE * SIDE // 2
    away = eye - mesh.vertices[vertex]
    nearer = viewpoint(vertex, mesh.vertices, mesh, eye, UP, CAMERAS) - mesh.vertices[vertex]
    assert np.allclose(nearer / np.linalg.norm(nearer), away / np.linalg.norm(away))
    assert np.linalg.norm(nearer) < np.linalg.norm(away)


def test_a_surface_is_seen_from_its_outer_side():
    mesh = height_field(np.zeros((SIDE, SIDE)))
    for vertex in range(0, len(mesh.vertices), 7):
        eye = viewpoint(vertex, mesh.vertices, mesh, np.array([8.0, 3.0, -20.0]), UP, CAMERAS)
        assert eye[2] > 5, f"vertex {vertex} is seen from {eye}"

"""Mesh: validation, neighbourhoods against slow loops, and the findings of inspect_mesh."""

import numpy as np
import pytest
import trimesh

from fairing.errors import InputError
from fairing.geometry.mesh_check import inspect_mesh
from fairing.geometry.normals import unit_normals
from fairing.mesh import Mesh
from tests.synthetic_capture import CUBE_FACES, CUBE_VERTICES

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
SQUARE_FACES = np.array([[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize(
    ("vertices", "faces", "said"),
    [
        (np.zeros((0, 3)), SQUARE_FACES, "vertices"),
        (SQUARE, np.zeros((0, 3), int), "no surface"),
        (SQUARE, np.array([[0, 1, 2, 3]]), "triangles"),
        (SQUARE, np.array([[0, 1, 2], [0, 1, 4]]), "face 1 uses vertices"),
        (SQUARE, np.array([[0, 1, -1]]), "face 0 uses vertices"),
        (np.where(np.arange(4)[:, None] == 2, np.nan, SQUARE), SQUARE_FACES, "vertex 2 is not finite"),
        (SQUARE[:, :2], SQUARE_FACES, "vertices"),
    ],
)
def test_unusable_mesh_is_refused(vertices: np.ndarray, faces: np.ndarray, said: str):
    with pytest.raises(InputError, match=said) as error:
        Mesh(vertices, faces)
    assert "\n" not in str(error.value)


def test_unit_normals_point_outwards_and_are_zero_for_a_collapsed_face():
    line = np.array([[0, 1, 1]])
    normals, doubled = unit_normals(CUBE_VERTICES, np.concatenate([CUBE_FACES, line]))
    triangles = trimesh.triangles.normals(CUBE_VERTICES[CUBE_FACES])[0]
    np.testing.assert_allclose(normals[:-1], triangles, atol=1e-12)
    np.testing.assert_allclose(doubled[:-1], 2 * trimesh.triangles.area(CUBE_VERTICES[CUBE_FACES]))
    assert (normals[-1] == 0).all()
    assert doubled[-1] == 0


def test_neighbourhoods_agree_with_a_slow_loop():
    faces = np.random.default_rng(0).integers(0, 20, (60, 3))
    faces = faces[[len(set(face)) == 3 for face in faces.tolist()]]
    mesh = Mesh(np.random.default_rng(1).normal(size=(20, 3)), faces)
    uses: dict[tuple[int, int], int] = {}
    for a, b, c in faces.tolist():
        for edge in ((a, b), (b, c), (c, a)):
            key = (min(edge), max(edge))
            uses[key] = uses.get(key, 0) + 1
    assert mesh.edges.tolist() == [list(edge) for edge in sorted(uses)]
    boundary = sorted({v for edge, count in uses.items() if count == 1 for v in edge})
    assert mesh.boundary_vertices.tolist() == boundary
    for vertex, ring in enumerate(mesh.one_rings):
        assert ring.tolist() == [i for i, face in enumerate(faces.tolist()) if vertex in face]


def test_mesh_keeps_its_own_copy():
    vertices = SQUARE.copy()
    mesh = Mesh(vertices, SQUARE_FACES)
    vertices[0] = 9
    assert mesh.vertices[0].tolist() == [0, 0, 0]


def test_diagonal_ignores_unused_vertices():
    assert Mesh(np.vstack([SQUARE, [[100, 0, 0]]]), SQUARE_FACES).diagonal == pytest.approx(np.sqrt(2))


def test_a_closed_cube_has_no_findings():
    facts = inspect_mesh(Mesh(CUBE_VERTICES, CUBE_FACES))
    assert facts.warnings() == ()
    assert len(facts.boundary_vertices) == 0
    assert facts.n_components == 1


@pytest.mark.parametrize("shift", [0, 1e5])
@pytest.mark.parametrize("scale", [1e-6, 1, 1e6])
def test_degenerate_faces_are_found_at_any_scale_and_place(scale: float, shift: float):
    vertices = np.vstack([SQUARE, [[0.5, 0.0, 0.0], [0.3, 1e-5, 0.0]]])
    # Collinear, a repeated corner, and one that is thin but sound.
    faces = np.vstack([SQUARE_FACES, [[0, 4, 1], [2, 2, 3], [0, 1, 5]]])
    facts = inspect_mesh(Mesh((vertices + shift) * scale, faces))
    assert facts.degenerate_faces.tolist() == [2, 3]
    assert "mesh: degenerate faces: 2 (first: 2); they take no part" in facts.warnings()


def test_repeated_faces_are_found_in_either_orientation():
    faces = np.vstack([SQUARE_FACES, [[1, 2, 0], [3, 2, 0]]])
    facts = inspect_mesh(Mesh(SQUARE, faces))
    assert facts.repeated_faces.tolist() == [2, 3]
    assert len(facts.crowded_edges) == 0, "a repeated face explains its edges"


def test_edges_of_three_faces_are_found():
    vertices = np.vstack([SQUARE, [[0.5, 0.5, 1]]])
    facts = inspect_mesh(Mesh(vertices, np.vstack([SQUARE_FACES, [[0, 2, 4]]])))
    assert facts.crowded_edges.tolist() == [[0, 2]]
    assert "first: 0-2" in facts.warnings()[0]


def test_faces_of_opposite_orientations_are_found():
    facts = inspect_mesh(Mesh(SQUARE, np.array([[0, 1, 2], [0, 3, 2]])))
    assert facts.misoriented_edges.tolist() == [[0, 2]]


def test_components_boundary_and_unused_vertices_are_counted():
    vertices = np.vstack([SQUARE, SQUARE + 5, [[9, 9, 9]]])
    facts = inspect_mesh(Mesh(vertices, np.vstack([SQUARE_FACES, SQUARE_FACES + 4])))
    assert facts.n_components == 2
    assert facts.boundary_vertices.tolist() == list(range(8))
    assert facts.unreferenced_vertices.tolist() == [8]


def test_warnings_use_the_input_vertex_numbers():
    facts = inspect_mesh(Mesh(np.vstack([SQUARE, [[9, 9, 9]]]), SQUARE_FACES))
    assert "first: 4)" in facts.warnings()[0]
    assert "first: 14)" in facts.warnings(np.arange(10, 15))[0]


def test_entirely_degenerate_mesh_is_refused():
    with pytest.raises(InputError, match="all 2 faces have no area"):
        inspect_mesh(Mesh(np.ones((4, 3)), SQUARE_FACES))

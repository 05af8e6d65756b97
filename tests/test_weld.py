"""Welding: copies that differ by rounding are one vertex, real detail stays, and faces without area are found."""

import numpy as np
import pytest

from fairing.errors import InputError
from fairing.mesh import Mesh
from fairing.weld import FLAT, NEAR, weld, welded, without_area

FRAMES = [
    (1.0, (0, 0, 0)), (1e-6, (0, 0, 0)), (1e-3, (0, 0, 0)), (1e3, (0, 0, 0)), (1e6, (0, 0, 0)), (1.0, (5e5, 4.65e6, 0)),
]  # fmt: skip
"""Units, and an origin as of UTM coordinates."""
COPIES = 1e-6
"""Of an edge: how far rounding moves the copies of a vertex."""


def ball(rings: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and faces (m, 3) of a closed surface with edges of 0.03 to 0.5 and needles at its poles."""
    u, v = np.meshgrid(np.arange(2 * rings) / (2 * rings) * 2 * np.pi, np.arange(1, rings) / rings * np.pi)
    around = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], axis=-1).reshape(-1, 3)
    vertices = np.vstack([around, [[0, 0, 1], [0, 0, -1]]])
    n, faces = 2 * rings, []
    for j in range(n):
        k = (j + 1) % n
        faces += [[len(around), j, k], [len(around) + 1, (rings - 2) * n + k, (rings - 2) * n + j]]
        for i in range(rings - 2):
            a, b, c, d = i * n + j, i * n + k, (i + 1) * n + j, (i + 1) * n + k
            faces += [[a, c, b], [b, c, d]]
    return vertices, np.array(faces)


def soup(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every face with vertices of its own, as in an STL file."""
    return vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)


def jittered(corners: np.ndarray, seed: int = 0) -> np.ndarray:
    """Corners of a soup, each moved by up to `COPIES` of the shortest edge of its face along each axis."""
    triangles = corners.reshape(-1, 3, 3)
    shortest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).min(axis=1)
    moves = np.random.default_rng(seed).uniform(-1, 1, triangles.shape) * shortest[:, None, None]
    return (triangles + COPIES * moves).reshape(-1, 3)


def test_weld_keeps_first_occurrences_and_maps_back():
    distinct = np.random.default_rng(0).normal(size=(30, 3))
    distinct[3] = [0.0, 1, 2]
    picks = np.concatenate([np.arange(30), np.random.default_rng(1).integers(0, 30, 200)])
    vertices = distinct[picks]
    vertices[picks == 3] *= np.array([-1.0, 1, 1])  # -0.0 is the same place as 0.0
    faces = np.arange(30).reshape(-1, 3)
    found, index = weld(vertices, faces)
    np.testing.assert_array_equal(found, vertices[:30])
    np.testing.assert_array_equal(index, picks)
    np.testing.assert_array_equal(found[index], vertices)


@pytest.mark.parametrize(("scale", "shift"), FRAMES)
def test_copies_that_differ_by_rounding_are_one_vertex(scale: float, shift: tuple[float, float, float]):
    vertices, faces = ball()
    corners, own = soup(vertices, faces)
    corners = (
        scale * jittered(corners) + shift
    )  # coordinates of 4.65e6 resolve 1e-9, far less than the copies differ by
    found, index = weld(corners, own)
    assert len(found) == len(vertices)
    connected = index[own]
    for input_vertex in range(len(vertices)):
        assert len(np.unique(connected[faces == input_vertex])) == 1
    first = np.unique(index, return_index=True)[1]
    np.testing.assert_array_equal(found, corners[first])  # where the first copy is
    assert (np.diff(first) > 0).all()  # in the order of the input


def test_single_precision_far_from_the_origin_is_welded():
    """Of each copy the last bit of a float32 differs, as when parts are moved and rounded one by one."""
    vertices, faces = ball()
    corners, own = soup(vertices, faces)
    shift = np.array([7000.0, -15000.0, 3000.0])  # a float32 at 15,000 resolves 1e-3, 1/600 of the shortest edge
    rounded = (20 * corners + shift).astype(np.float32)
    up = np.random.default_rng(3).integers(0, 2, rounded.shape).astype(bool)
    copies = np.where(up, np.nextafter(rounded, np.float32(np.inf)), rounded)
    assert len(np.unique(copies, axis=0)) > 3 * len(vertices)
    found, index = weld(copies.astype(float), own)
    assert len(found) == len(vertices)
    for input_vertex in range(len(vertices)):
        assert len(np.unique(index[own][faces == input_vertex])) == 1


def test_differences_that_rounding_to_single_precision_explains_stay_in_double_precision():
    vertices, faces = ball()
    corners, own = soup(20 * vertices + [7000.0, -15000.0, 3000.0], faces)
    moved = corners + np.random.default_rng(3).uniform(-1e-3, 1e-3, corners.shape)
    assert len(weld(moved, own)[0]) > 0.95 * len(moved)  # a few are within `NEAR` of each other by chance


@pytest.mark.parametrize(("scale", "shift"), FRAMES[:5])
def test_no_edge_of_a_face_with_area_collapses(scale: float, shift: tuple[float, float, float]):
    """A strip across whose width copies would be merged: its faces have area, so that both of its sides stay."""
    width = 2 * FLAT  # of the edges along the strip
    strip = np.array([[0.1 * k, side * 0.1 * width, 0] for k in range(11) for side in (0, 1)])
    faces = [[i, i + 2, i + 1] for i in range(0, 20, 2)] + [[i + 1, i + 2, i + 3] for i in range(0, 20, 2)]
    faces = np.array([*faces, [20, 0, 22], [1, 21, 23]])
    vertices = np.vstack([strip, [[0.5, -10, 0], [0.5, 10, 0]]])
    scaled = scale * vertices + shift
    assert not without_area(scaled, faces).any()
    assert width < NEAR  # close enough to be copies, were it not for their faces
    found, index = weld(scaled, faces)
    assert len(found) == len(vertices)
    own = soup(scaled, faces)
    assert len(weld(*own)[0]) == len(vertices)  # also where each face has corners of its own
    np.testing.assert_array_equal(index, np.arange(len(vertices)))


def test_vertices_of_different_parts_stay_apart_beyond_the_tolerance():
    near = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    for gap, count in ((0.5 * NEAR, 3), (2 * NEAR, 6)):
        assert len(weld(np.vstack([near, np.add(near, [0, 0, gap])]), np.arange(6).reshape(2, 3))[0]) == count


def test_a_chain_of_close_vertices_is_not_drawn_together():
    """Each is close to the next, all together are far apart."""
    chain = np.array([[0.7 * NEAR * k, 0, 0] for k in range(40)])
    turn = 0.01 * np.arange(40)
    ends = np.stack([[0 * turn, r * np.cos(turn + r), r * np.sin(turn + r)] for r in (1, 2)]).transpose(2, 0, 1)
    faces = np.array([[k, 40 + 2 * k, 41 + 2 * k] for k in range(40)])
    found, index = weld(np.vstack([chain, ends.reshape(-1, 3)]), faces)
    span = [np.ptp(chain[index[:40] == k, 0]) for k in np.unique(index[:40])]
    assert 10 <= len(span) < 40
    assert max(span) <= 2.001 * NEAR  # the longest edge of each face: to the end at a distance of 2
    assert len(found) == len(span) + 80


def test_the_order_of_faces_changes_nothing():
    vertices, faces = ball()
    corners, own = soup(vertices, faces)
    corners = jittered(corners)
    shuffled = np.random.default_rng(5).permutation(own)
    np.testing.assert_array_equal(weld(corners, own)[1], weld(corners, shuffled)[1])


def test_exact_copies_are_found_among_vertices_of_no_face():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5], [5, 5, 5]])
    assert weld(vertices, np.array([[0, 1, 2]]))[1].tolist() == [0, 1, 2, 3, 3]


@pytest.mark.parametrize(("scale", "shift"), FRAMES)
def test_faces_without_area_are_left_out_and_copies_in_them_are_one(scale: float, shift: tuple[float, float, float]):
    """A seam: two squares whose common vertices are written twice, stitched by faces between the copies."""
    left = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    right = np.add([[1.0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0]], [COPIES, -COPIES, COPIES])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [1, 4, 2], [4, 7, 2], [1, 1, 4]])
    surface = welded(Mesh(scale * np.vstack([left, right]) + shift, faces))
    assert surface.vertex_of_input.tolist() == [0, 1, 2, 3, 1, 4, 5, 2]
    assert surface.input_faces.tolist() == [0, 1, 2, 3]
    assert surface.mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]
    assert surface.all_faces.faces.shape == (7, 3)
    assert surface.displacement.max() == pytest.approx(np.sqrt(3) * COPIES * scale, rel=0.01)


def test_corners_on_a_line_but_for_single_precision_have_no_area():
    start, end = np.array([1000.1, 2000.7, 30.3]), np.array([1010.4, 2011.9, 31.1])
    for part in np.linspace(0.1, 0.9, 9):
        line = np.array([start, (1 - part) * start + part * end, end])
        assert without_area(line, np.array([[0, 1, 2]])).all()
        assert without_area(line.astype(np.float32).astype(float), np.array([[0, 1, 2]])).all()
    lifted = np.array([start, (start + end) / 2 + [0, 0, 0.01], end])  # a hundred times the spacing of float32
    assert not without_area(lifted.astype(np.float32).astype(float), np.array([[0, 1, 2]])).any()


def test_a_needle_has_area():
    needle = np.array([[0.0, 0, 0], [1, 0, 0], [0.3, 1e-5, 0]])
    assert not without_area(needle, np.array([[0, 1, 2]])).any()


def test_a_surface_without_area_is_refused():
    with pytest.raises(InputError, match="all 2 faces have no area"):
        welded(Mesh(np.ones((4, 3)), np.array([[0, 1, 2], [0, 2, 3]])))


def test_many_vertices_at_one_place_take_little_time_and_memory():
    """30,000 faces that meet in a point, each with its own copy of it."""
    rng = np.random.default_rng(0)
    count = 30_000
    tips = np.column_stack([rng.uniform(-1e-7, 1e-7, (count, 3)), rng.normal(size=(count, 6))]).reshape(-1, 3)
    found, index = weld(tips, np.arange(3 * count).reshape(-1, 3))
    assert len(np.unique(index[::3])) < count / 10
    assert len(found) <= 2 * count + count / 10

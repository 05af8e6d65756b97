"""Choosing vertices: by number, by click, by rectangle."""

import numpy as np
import pytest

from app.page_state.page_state import PageState
from app.page_state.selection import Selection, list_vertices, parse_vertices
from app.picking import nearest_to_ray, point_under_pointer, vertices_within
from fairing.camera import Camera
from fairing.errors import InputError
from fairing.mesh import Mesh


def test_a_list_of_numbers_and_ranges_is_read_and_its_first_is_current():
    found = parse_vertices(" 3, 17-20;5 , 18–19", 40)
    assert sorted(found.vertices) == [3, 5, 17, 18, 19, 20]
    assert found.current == 3
    assert parse_vertices("", 40) == Selection()


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("3, x", "'x'"),
        ("3 4", "'3 4'"),
        ("-3", "'-3'"),
        ("41", "0 to 40, found 41"),
        ("3-99", "found 99"),
        ("7-5", "runs upwards, found 7-5"),
        ("1" * 5000, "4000 characters"),
        (17.0, "expected a list"),
        (None, "expected a list"),
    ],
)
def test_what_is_no_list_of_vertices_is_refused_with_the_piece(written, said):
    with pytest.raises(InputError, match="vertices: .*" + said.replace("(", r"\(")):
        parse_vertices(written, 40)


def test_lists_are_written_shortly_and_read_back():
    for chosen, written in (((), ""), ((5,), "5"), ((6, 5), "5, 6"), ((9, 3, 2, 4), "2-4, 9")):
        assert list_vertices(chosen) == written
        assert set(parse_vertices(written, 40).vertices) == set(chosen)


def test_toggling_adds_as_current_and_takes_away():
    selection = Selection((3,)).toggled(7)
    assert selection.current == 7
    assert selection.toggled(7) == Selection((3,))
    assert selection.toggled(3) == Selection((7,))
    assert Selection((3,)).toggled(3).current is None


def test_a_rectangle_adds_and_leaves_the_current_vertex():
    extended = Selection((3, 7)).extended([1, 7, 2])
    assert extended.current == 7
    assert sorted(extended.vertices) == [1, 2, 3, 7]
    assert Selection().extended([4, 5]).current == 5


@pytest.fixture
def two_squares():
    """A large square 2 units away that hides a part of one 3 units away; camera at the origin, looking along z."""
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
    near, far = np.c_[0.5 * square, np.full(4, 2.0)], np.c_[square + np.array([0.5, 0]), np.full(4, 3.0)]
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    K = np.array([[200, 0, 159.5], [0, 200, 119.5], [0, 0, 1]])
    camera = Camera.from_krt(K, np.eye(3), np.zeros(3), 320, 240)
    inner = np.array([[0.1, 0.0, 3.0], [0.0, 0.3, 3.0], [0.2, 0.3, 3.0]])  # hidden by the near square
    vertices = np.concatenate([near, far, inner])
    return vertices, Mesh(vertices, np.concatenate([faces, faces + 4, [[8, 9, 10]]])), camera


def test_a_rectangle_finds_the_vertices_that_are_seen_in_it(two_squares):
    vertices, mesh, camera = two_squares
    everything = ((0.0, 0.0), (1.0, 1.0))
    seen = vertices_within(vertices, mesh, camera, *everything, see_through=False)
    assert seen.tolist() == [0, 1, 2, 3, 4, 5, 6, 7]
    assert vertices_within(vertices, mesh, camera, *everything, see_through=True).tolist() == list(range(11))


def test_a_rectangle_ends_where_it_ends_and_nothing_behind_the_eye_is_in_it(two_squares):
    vertices, mesh, camera = two_squares
    # The near square's left corners are drawn at x = 159.5 - 200 * 0.5 / 2 = 109.5: the middle of pixel 109 and 110.
    left = vertices_within(vertices, mesh, camera, (0.0, 0.0), (110.1 / 320, 1.0), see_through=True)
    assert left.tolist() == [0, 3]
    assert vertices_within(vertices, mesh, camera, (0.0, 0.0), (109.9 / 320, 1.0), see_through=True).tolist() == []
    behind = vertices * [1, 1, -1]
    assert len(vertices_within(behind, mesh, camera, (0.0, 0.0), (1.0, 1.0), see_through=True)) == 0


def test_the_vertex_on_a_line_of_sight_is_the_one_at_the_smallest_angle_in_front():
    points = np.array([[0, 0, -1.0], [0.1, 0, 1.0], [0.3, 0, 9.0], [5, 0, 5.0]])
    assert nearest_to_ray(points, np.zeros(3), np.array([0.0, 0.0, 1.0])) == 2
    assert nearest_to_ray(points, np.array([0.0, 0.0, 0.9]), np.array([1.0, 0.0, 1.0]) / np.sqrt(2)) == 1


def test_the_point_under_the_pointer_is_the_nearest_to_the_eye():
    points = np.array([[0.0, 0.0, 2.0], [0.0, 0.01, 1.0], [0.5, 0.0, 1.0], [0.0, 0.0, -1.0]])
    eye, ahead = np.zeros(3), np.array([0.0, 0.0, 1.0])
    assert point_under_pointer(points, eye, ahead, 0.02) == 1
    assert point_under_pointer(points, eye, ahead, 0.005) == 0
    assert point_under_pointer(points[2:], eye, ahead, 0.02) is None


def test_marks_and_wireframes_that_would_hide_the_surface_are_hidden_at_first():
    hidden = {
        n: {name for name in ("vertices", "now") if not PageState.of_mesh(n).shows(name)} for n in (200, 500, 501)
    }
    assert hidden == {200: set(), 500: {"now"}, 501: {"now", "vertices"}}

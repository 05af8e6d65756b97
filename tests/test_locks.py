"""Vertices held by boxes and by the region of interest."""

import numpy as np
import pytest

from app.cli.main import run
from app.debugger.option_fields import option_fields
from fairing.errors import InputError
from fairing.io import read_mesh
from fairing.option_check import check_options
from fairing.options import FairingOptions
from fairing.run.session import Session
from fairing.solve.locks import inside_boxes
from tests.small_scene import VERTICES, corner_scene, small_options, write_corner

AROUND_CORNER = (0.9, 0.9, 0.9, 1.2, 1.2, 1.2)


def moved(**options) -> np.ndarray:
    session = Session(corner_scene(), small_options(**options))
    session.run()
    return (session.vertices != session.trace.start).any(axis=1)


def test_inside_a_box_are_its_sides_too():
    points = np.array([[0, 0, 0], [1, 1, 1], [1, 1, 1.001], [5, 5, 5], [0.5, 0.5, -0.1]])
    assert inside_boxes(points, (0, 0, 0, 1, 1, 1)).tolist() == [True, True, False, False, False]
    assert inside_boxes(points, (0, 0, 0, 1, 1, 1, 4, 4, 4, 6, 6, 6)).tolist() == [True, True, False, True, False]
    assert not inside_boxes(points, ()).any()


def test_only_the_region_s_vertices_move():
    assert moved(region=AROUND_CORNER).tolist() == [True] + [False] * 6


def test_vertices_in_locked_boxes_never_move():
    found = moved(locked_boxes=(*AROUND_CORNER, -0.1, -0.1, 0.9, 0.1, 0.1, 1.1))
    assert not found[0]
    assert not found[2]
    assert VERTICES[2].tolist() == [0, 0, 1]
    assert found.any()


def test_boxes_are_taken_from_the_command_line(tmp_path):
    write_corner(tmp_path / "corner")
    quick = ["--schedule.blur", "1", "--schedule.max-sweeps", "1", "--cells.size", "32"]
    region = [str(number) for number in (0.9, 0.9, 0.9, 1.2, 1.2, 1.2)]
    out = tmp_path / "out"
    assert run(["fair", str(tmp_path / "corner"), "--out", str(out), *quick, "--region", *region]) == 0
    before, after = read_mesh(tmp_path / "corner" / "mesh.obj")[0], read_mesh(out / "mesh.ply")[0]
    assert (before != after).any(axis=1).tolist() == [True] + [False] * 6 + [True]  # vertex 7 is vertex 0 again


def test_boxes_are_typed_on_the_page_as_lists():
    (field,) = (field for field in option_fields() if field.path == ("region",))
    assert field.read("0 0 0, 1 1 1.5") == (0, 0, 0, 1, 1, 1.5)
    assert field.read("") == ()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (FairingOptions(region=(1.0, 2.0)), "option region: expected x0 y0 z0 x1 y1 z1, found 2 numbers"),
        (FairingOptions(region=(0.0,) * 12), "option region: expected x0 y0 z0 x1 y1 z1, found 12 numbers"),
        (FairingOptions(locked_boxes=(0, 0, 2, 1, 1, 1)), "option locked_boxes: expected x0 <= x1.*found 0 0 2 1 1 1"),
        (FairingOptions(region=(0, 0, 0, 1, 1, float("inf"))), "option region: expected a finite number"),
    ],
)
def test_a_box_that_is_none_is_one_clear_line(options: FairingOptions, said: str):
    with pytest.raises(InputError, match=said):
        check_options(options)


def test_a_region_beside_the_mesh_is_one_clear_line():
    with pytest.raises(InputError, match=r"found none in 5 5 5 6 6 6; the mesh reaches from 0 0 0 to"):
        Session(corner_scene(), small_options(region=(5, 5, 5, 6, 6, 6)))

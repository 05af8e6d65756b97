"""The box that a user chooses in the page: what is typed, and the corners that are dragged."""

from dataclasses import replace

import numpy as np
import pytest

from app.panels.box_panel import corners_of, first_box
from fairing.errors import InputError
from fairing.triangulation.object_box import box_of_corners
from fairing.triangulation.points_in_box import box_words
from tests.small_scene import corner_scene


def test_typed_corners_are_read_as_numbers_or_as_the_option():
    corners = (-1.0, 0.5, 2e-3, 1.0, 2.5, 7.0)
    assert corners_of("-1 0.5 2e-3, 1 2.5 7") == corners
    assert corners_of(f" --box {' '.join(map(str, corners))} ") == corners
    np.testing.assert_allclose(corners_of(box_words(corners)), corners, atol=1e-3)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("", "found none"),
        ("1 2 3", "found 1 2 3"),
        ("a b c d e f", "found a b c d e f"),
        ("0 0 0 1 1 0", "with z0 < z1, found 0 and 0"),
        ("0 0 0 nan 1 1", "with x0 < x1"),
    ],
)
def test_corners_that_are_no_box_are_one_line(line: str, words: str):
    with pytest.raises(InputError, match=words) as caught:
        corners_of(line)
    assert "\n" not in str(caught.value)


def test_the_first_box_is_around_the_box_of_the_mesh_or_the_mesh():
    scene = corner_scene()
    low, high = scene.mesh.vertices.min(axis=0), scene.mesh.vertices.max(axis=0)
    np.testing.assert_array_equal(first_box(scene), [*low, *high])
    corners = (-1.0, -2.0, -3.0, 1.0, 2.0, 3.0)
    assert first_box(replace(scene, object_box=box_of_corners(corners))) == corners

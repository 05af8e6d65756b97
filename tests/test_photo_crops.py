"""Cuts of photos and faces seen through another photo, against the small scene's exact photos."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.layers.step_arrow import pixel_arrow
from app.panels.photo_pages import chosen_pair, vertex_in_photos
from app.pictures.photo_crops import OUTSIDE, Window, face_pair, mean_difference, photo_from_photo
from app.pictures.photo_store import PhotoStore
from fairing.photo import Mask
from fairing.run.session import Session
from tests.small_scene import FACES, VERTICES, cameras, corner_scene, photos, small_options


def test_a_window_shows_its_pixels_where_it_says():
    photo = np.zeros((40, 60, 3), dtype=np.uint8)
    photo[17, 31] = 255
    window = Window(left=20, top=10, span=20, side=100)
    picture = window.cut(photo)
    x, y = window.place(np.array([31.0, 17.0]))
    row, column = np.unravel_index(picture[..., 0].argmax(), picture.shape[:2])
    assert (column + 0.5, row + 0.5) == (pytest.approx(x, abs=1), pytest.approx(y, abs=1))
    assert window.place(np.array([19.5, 9.5])) == pytest.approx([0, 0])


def test_beyond_the_photo_there_is_grey():
    photo = np.full((20, 20, 3), 200, dtype=np.uint8)
    picture = Window(left=-10, top=-10, span=20, side=20).cut(photo)
    assert (picture[:10] == OUTSIDE).all()
    assert (picture[10:, 10:] == 200).all()
    assert (Window(left=90, top=90, span=20, side=20).cut(photo) == OUTSIDE).all()


def test_a_window_around_points_holds_them():
    points = np.array([[3.0, 8.0], [33.0, 14.0], [20.0, 11.0]])
    places = Window.around(points, 100).place(points)
    assert places.min() > 0
    assert places.max() < 100


def test_the_map_between_photos_takes_points_of_the_face_to_themselves():
    corners = VERTICES[FACES[1]]
    points = np.array([[0.2, 0.5, 0.3], [0.1, 0.1, 0.8]]) @ corners
    one, other = cameras()[0], cameras()[5]
    H = photo_from_photo(one, other, corners, affine=False)
    mapped = np.column_stack([other.project(points)[0], np.ones(2)]) @ H.T
    assert mapped[:, :2] / mapped[:, 2:] == pytest.approx(one.project(points)[0])
    A = photo_from_photo(one, other, corners, affine=True)
    at_corners = np.column_stack([other.project(corners)[0], np.ones(3)]) @ A.T
    assert at_corners[:, :2] == pytest.approx(one.project(corners)[0])
    assert A[2] == pytest.approx([0, 0, 1], abs=1e-12)


@pytest.mark.parametrize("side", [120, 40])
def test_a_warped_face_shows_at_each_place_what_the_other_photo_has_there(side: int):
    h, w = photos()[0].shape[:2]
    ruler = np.zeros((h, w, 3), dtype=np.uint8)  # a photo that says where its pixels are
    ruler[..., 0], ruler[..., 1] = np.arange(w), np.arange(h)[:, None]
    one, other = cameras()[0], cameras()[5]
    corners = VERTICES[FACES[2]]
    window = Window.around(other.project(corners)[0], side)
    pair = face_pair((ruler, ruler), (one, other), corners, window, affine=False)
    points = np.array([[0.2, 0.5, 0.3], [0.15, 0.15, 0.7], [1 / 3, 1 / 3, 1 / 3]]) @ corners
    for image, camera in ((pair.warped, one), (pair.own, other)):
        for place, expected in zip(window.place(other.project(points)[0]), camera.project(points)[0], strict=True):
            column, row = np.floor(place).astype(int)
            # A picture's pixel spans up to two of the photo's.
            assert image[row, column, :2] == pytest.approx(expected, abs=2.5)
    assert pair.average.astype(float) == pytest.approx(
        np.where(_inside(pair.outline, side)[..., None], 0.5 * (pair.warped.astype(float) + pair.own), pair.average),
        abs=2,
    )


def _inside(outline: np.ndarray, side: int) -> np.ndarray:
    """(side, side) bool: pixels well within a triangle."""
    y, x = np.mgrid[:side, :side] + 0.5
    weights = np.linalg.solve(np.vstack([outline.T, np.ones(3)]), np.stack([x.ravel(), y.ravel(), np.ones(side**2)]))
    return (weights > 0.1).all(axis=0).reshape(side, side)


def test_ghosts_go_when_the_vertex_is_in_its_place():
    start = VERTICES.copy()
    start[0] += (0.12, -0.08, 0.1)
    differences = []
    for vertices in (VERTICES, start):
        seen = (photos()[2], photos()[3]), (cameras()[2], cameras()[3])
        differences.append(mean_difference(*seen, vertices[FACES[2]], affine=False))
    assert differences[1] > 1.5 * differences[0], differences


def test_the_difference_of_a_pair_is_the_mean_over_the_face():
    h, w = photos()[0].shape[:2]
    columns = np.broadcast_to(np.arange(w, dtype=np.uint8)[:, None], (h, w, 3))
    rows = np.broadcast_to(40 + np.arange(h, dtype=np.uint8)[:, None, None], (h, w, 3))
    one, other = cameras()[0], cameras()[5]
    corners = VERTICES[FACES[2]]
    points = np.random.default_rng(0).dirichlet((1, 1, 1), 100_000) @ corners  # spread evenly over the face
    apart = one.project(points)[0][:, 0] - (40 + other.project(points)[0][:, 1])
    assert apart.min() < -5, "neither photo is brighter throughout"
    assert apart.max() > 5
    found = mean_difference((columns, rows), (one, other), corners, affine=False)
    assert found == pytest.approx(np.abs(apart).mean(), abs=0.1)
    dark = np.zeros_like(rows)
    affine = mean_difference((columns, dark), (one, other), corners, affine=True)
    assert affine == pytest.approx(one.project(corners)[0][:, 0].mean(), abs=1e-3), (
        "of the centroid of the three corners"
    )


def test_a_face_outside_a_photo_has_no_difference():
    small = photos()[0][:2, :2]
    found = mean_difference((small, photos()[5]), (cameras()[0], cameras()[5]), VERTICES[FACES[2]], affine=False)
    assert np.isnan(found)


def test_a_photo_as_taken_has_no_marks_of_masked_areas(tmp_path: Path):
    scene = corner_scene()
    Image.fromarray(np.zeros(photos()[0].shape[:2], dtype=np.uint8)).save(tmp_path / "mask.png")
    view = replace(scene.views[0], mask=Mask(tmp_path / "mask.png"))
    store = PhotoStore(replace(scene, views=(view, *scene.views[1:])))
    assert np.array_equal(store.as_taken(0), photos()[0])
    assert not np.array_equal(store[0], photos()[0])


def test_crops_know_the_path_and_the_last_step():
    session = Session(corner_scene(), small_options(locked_vertices=[1, 2, 3, 4, 5, 6]))
    for _ in range(3):
        session.step()
    known = vertex_in_photos(session, 0, 2)
    steps = session.trace.steps
    assert np.array_equal(known.path, [session.trace.start[0], steps[0].after[0], steps[1].after[0]])
    assert known.step is not None
    assert np.array_equal(known.step, [steps[1].before[0], steps[1].after[0]])
    assert known.views == list(range(8))
    assert set(known.face_views) == set(range(6))
    assert vertex_in_photos(session, 0, 0).step is None


def test_a_pair_has_two_views_and_the_wanted_ones_where_they_see_the_face():
    assert chosen_pair([2, 4, 7, 9], (None, None)) == (2, 7)
    assert chosen_pair([2, 4, 7, 9], (9, 2)) == (9, 2)
    assert chosen_pair([2, 4, 7, 9], (4, 4)) == (2, 4)
    assert chosen_pair([2, 4, 7, 9], (1, 3)) == (2, 7)
    assert chosen_pair([3, 5], (5, None)) == (5, 3)


def test_the_store_keeps_as_many_photos_as_fit(monkeypatch: pytest.MonkeyPatch):
    scene = corner_scene()
    monkeypatch.setattr("app.pictures.photo_store.MAX_BYTES", 2 * photos()[0].nbytes)
    store = PhotoStore(scene)
    for view_id in (0, 1, 0, 2):
        assert np.array_equal(store[view_id], photos()[view_id])
    assert list(store._kept) == [0, 2]


def test_the_arrow_of_a_step_shows_its_displacement_in_the_photo_magnified():
    camera = cameras()[3]
    before, after = VERTICES[0] + [0.05, 0, 0], VERTICES[0] + [0.04, 0.01, -0.01]
    arrow = pixel_arrow(camera, before, after, 10)
    assert arrow is not None
    pixels, depths = camera.project(arrow)
    tail, tip = camera.project(np.stack([before, after]))[0]
    assert pixels[0, 0] == pytest.approx(tail)
    assert pixels[0, 1] - tail == pytest.approx(10 * (tip - tail))
    assert (depths < camera.project(before)[1]).all()
    assert pixel_arrow(camera, before, before, 10) is None
    assert pixel_arrow(camera, 3 * camera.center, after, 10) is None

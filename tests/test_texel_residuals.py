"""Residuals at the samples of the cells, and their picture, against slow computations of their own."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from app.page_state.page_state import PageState
from app.pictures import texel_picture as pictures
from app.pictures.coloring import PER_PIXEL, UNKNOWN, by_value, color_map
from app.pictures.texel_picture import texel_picture
from fairing import TexelResiduals, texel_residuals
from fairing.cells.layout import cell_grid
from fairing.errors import Cancelled
from fairing.judge.face_residuals import face_residuals
from fairing.judge.inspect import face_cells
from fairing.run.session import Session
from tests.small_scene import FACES, corner_scene, small_options


@pytest.fixture(scope="module")
def session() -> Session:
    session = Session(corner_scene(), small_options(eigenspace={"dimensions": [1]}))
    session.step()
    return session


def test_every_sample_has_the_distance_of_the_photos_from_the_eigenspace_in_one_photo_and_its_mean_over_all(
    session: Session,
):
    found = texel_residuals(session)
    by_photo = [texel_residuals(session, view=view) for view in range(len(session.scene.views))]
    n_shown = n_hidden = n_means = 0
    for face in range(len(FACES)):
        cells = face_cells(session, face)
        views, reconstruction = cells.views.tolist(), cells.coefficients @ cells.basis  # U c
        for view, of_view in enumerate(by_photo):
            assert of_view.size[face] == (cells.size if view in views else 0)
            assert len(of_view.of_face(face)) == (cells.observed.shape[1] if view in views else 0)
        for sample in range(cells.observed.shape[1]):
            distances = []
            for k, view in enumerate(views):
                value = by_photo[view].of_face(face)[sample]
                if cells.counts[k, sample]:
                    distances.append(abs(float(cells.observed[k, sample]) - float(reconstruction[k, sample])))
                    assert value == pytest.approx(distances[-1], abs=2e-3)
                    n_shown += 1
                else:
                    assert np.isnan(value)
                    n_hidden += 1
            if distances:
                assert found.of_face(face)[sample] == pytest.approx(np.mean(distances), abs=2e-3)
                n_means += len(distances) > 1
            else:
                assert np.isnan(found.of_face(face)[sample])
    assert min(n_shown, n_hidden, n_means) > 1000


def test_the_mean_over_the_samples_of_a_face_in_a_photo_is_its_residual(session: Session):
    by_face = face_residuals(session, with_flow=False)
    for view in range(len(session.scene.views)):
        found = texel_residuals(session, view=view)
        known = np.flatnonzero(found.size)
        means = np.array([np.nanmean(found.of_face(face), dtype=float) for face in known.tolist()])
        assert means == pytest.approx(by_face.mean_residual(view)[known], rel=1e-5)
        assert np.isnan(by_face.mean_residual(view)[found.size == 0]).all()


def test_in_colour_a_sample_has_the_mean_of_its_channels():
    session = Session(corner_scene(), small_options(cells={"color": True}))
    found = texel_residuals(session, view=1)
    for face in np.flatnonzero(found.size).tolist():
        cells = face_cells(session, face)
        k, channels = cells.views.tolist().index(1), np.abs(cells.residual).reshape(len(cells.views), 3, -1)
        shown = cells.counts[k].reshape(3, -1)[0]
        assert found.of_face(face)[shown] == pytest.approx(channels[k].mean(axis=0)[shown], rel=1e-5)
        assert np.isnan(found.of_face(face)[~shown]).all()


def test_the_divider_shows_residuals_only_per_pixel_which_is_the_default_except_on_very_large_meshes():
    small, large = PageState.of_mesh(10_000), PageState.of_mesh(10_001)
    for state in (small, large):
        state.surface, state.is_divided = "residual", True
    assert (small.shows_texels, small.shows_divider) == (True, True)
    assert (large.shows_texels, large.shows_divider) == (False, False)
    small.surface = "energy"
    assert (small.shows_texels, small.shows_divider) == (False, False)


def test_the_image_of_a_face_has_its_samples_by_row_and_column(session: Session):
    found = texel_residuals(session)
    face = int(np.flatnonzero(found.size)[0])
    image, values, at = found.image(face), found.of_face(face), 0
    n = int(found.size[face])
    for row in range(n):
        for column in range(n):
            if row + column < n:
                assert np.array_equal(image[row, column], values[at], equal_nan=True)
                at += 1
            else:
                assert np.isnan(image[row, column])
    assert at == len(values)


def test_moments_and_photos_that_do_not_exist_and_cancellation(session: Session):
    with pytest.raises(IndexError, match="moment 99: this run has moments 0 to 1"):
        texel_residuals(session, 99)
    with pytest.raises(IndexError, match="photo -1"):
        texel_residuals(session, view=-1)
    session.cancel_requested = lambda: True
    with pytest.raises(Cancelled):
        texel_residuals(session)
    session.cancel_requested = lambda: False


def some_residuals(sizes: list[int], inset: float = 0.03) -> TexelResiduals:
    """Smooth residuals with values between 1 and 10, the last samples of the first face unknown."""
    values = [1 + 9 * cell_grid(n).mean(axis=0) + 0.1 * k for k, n in enumerate(sizes) if n]
    values[0][-2:] = np.nan
    start = np.cumsum([0, *(n * (n + 1) // 2 for n in sizes)])
    return TexelResiduals(
        np.array(sizes), np.full(len(sizes), inset), start, np.concatenate(values).astype(np.float32), 0.5
    )


def texture_at(picture: pictures.TexelPicture, face: int, barycentric: np.ndarray) -> np.ndarray:
    """(3,) the bilinear colour of the picture at a place on a face, as a browser reads it."""
    image = np.array(Image.open(io.BytesIO(picture.picture)).convert("RGB")).astype(float)
    u, v = barycentric @ picture.uv[face]
    x, y = u * image.shape[1] - 0.5, v * image.shape[0] - 0.5
    column, row = int(np.floor(x)), int(np.floor(y))
    dx, dy = x - column, y - row
    parts = [
        (dx if right else 1 - dx) * (dy if down else 1 - dy)
        * image[np.clip(row + down, 0, len(image) - 1), np.clip(column + right, 0, image.shape[1] - 1)]
        for right in (0, 1) for down in (0, 1)
    ]  # fmt: skip
    return np.sum(parts, axis=0)


@pytest.mark.parametrize("inset", [0.0, 0.08])
def test_every_sample_lies_in_the_picture_where_its_place_on_the_face_is(inset: float):
    sizes = [12, 8, 12, 0, 12, 24, 8]
    found = some_residuals(sizes, inset)
    picture = texel_picture(found, PER_PIXEL["residual"])
    at, _ = by_value(PER_PIXEL["residual"], found.values)
    for face, n in enumerate(sizes):
        for sample, ramp in enumerate(cell_grid(n).T if n else []):
            a, b = inset + (1 - 3 * inset) * ramp.astype(float)
            seen = texture_at(picture, face, np.array([a, b, 1 - a - b]))
            shade = at[found.start[face] + sample]
            expected = UNKNOWN if np.isnan(shade) else color_map()[round(255 * float(shade))]
            assert np.abs(seen - expected).max() < 5, (face, sample)
    assert texture_at(picture, 3, np.full(3, 1 / 3)) == pytest.approx(UNKNOWN), "a face without samples"
    assert picture.legend.unknown == 1
    assert picture.legend.left_out == pytest.approx(2 / len(found.values))


def test_corners_and_edges_continue_the_nearest_samples_and_no_face_reads_another_or_what_is_empty():
    sizes = [12, 12, 8, 8, 8]
    found = some_residuals(sizes, inset=0.06)
    levels = np.repeat(np.arange(1, 6), np.diff(found.start)).astype(np.float32)
    picture = texel_picture(replace(found, values=levels), PER_PIXEL["residual"])
    ends = np.linspace(0, 1, 9)
    for face in range(len(sizes)):
        expected = texture_at(picture, face, np.full(3, 1 / 3))
        for share in ends:
            for edge in range(3):
                place = np.roll([share, 1 - share, 0.0], edge)
                assert texture_at(picture, face, place) == pytest.approx(expected, abs=1e-6), (face, edge, share)


def test_samples_that_do_not_fit_are_averaged_in_blocks_and_stay_in_place(monkeypatch: pytest.MonkeyPatch):
    sizes = [96, 96, 8]
    found = some_residuals(sizes, inset=0.02)
    whole = texel_picture(found, PER_PIXEL["residual"])
    monkeypatch.setattr(pictures, "LARGEST", 70)
    picture = texel_picture(found, PER_PIXEL["residual"])
    width, height = Image.open(io.BytesIO(picture.picture)).size
    assert max(width, height) <= 70
    assert max(Image.open(io.BytesIO(whole.picture)).size) > 70
    for face in range(len(sizes)):
        for place in ([0.3, 0.3, 0.4], [0.1, 0.6, 0.3], [0.6, 0.1, 0.3]):
            seen, expected = (texture_at(each, face, np.array(place)) for each in (picture, whole))
            assert np.abs(seen - expected).max() < 6
    monkeypatch.setattr(pictures, "LARGEST", 20)
    with pytest.raises(ValueError, match="3 faces do not fit"):
        texel_picture(found, PER_PIXEL["residual"])


def test_pictures_beside_each_other_have_one_scale_that_covers_both():
    few, many = some_residuals([8]), some_residuals([48, 48])
    few = replace(few, values=10 * few.values)
    beside = (
        texel_picture(few, PER_PIXEL["residual"], beside=many).legend,
        texel_picture(many, PER_PIXEL["residual"], beside=few).legend,
    )
    alone = texel_picture(few, PER_PIXEL["residual"]).legend
    assert [(legend.low, legend.high, legend.largest) for legend in beside] == [(0.0, alone.high, alone.largest)] * 2


def test_without_any_sample_the_picture_is_unknown():
    found = replace(
        some_residuals([8]),
        size=np.zeros(2, dtype=int),
        start=np.zeros(3, dtype=int),
        values=np.zeros(0),
        inset=np.zeros(2),
    )
    picture = texel_picture(found, PER_PIXEL["residual"])
    assert texture_at(picture, 1, np.full(3, 1 / 3)) == pytest.approx(UNKNOWN)
    assert picture.legend.unknown == 2

"""Image flow at the samples of the cells, against known shifts of photos whose texture is a formula, and its picture."""

import io
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from app.page_state.page_state import PageState
from app.pictures.coloring import HUES, PER_PIXEL, UNKNOWN, ZERO, by_vector, wheel_colors
from app.pictures.texel_picture import texel_picture
from fairing.errors import Cancelled
from fairing.judge import texels
from fairing.judge.inspect import FaceCells, cells_of_all_faces
from fairing.judge.texel_flow import TexelFlow, texel_flow
from fairing.run.session import Session
from tests.small_scene import FACES, corner_scene, small_options

VIEW = 3


@pytest.fixture(scope="module", params=["homography", "affine"])
def session(request: pytest.FixtureRequest) -> Session:
    return Session(corner_scene(), small_options(cells={"warp": request.param, "inset": [2.0]}))


def textured(places: np.ndarray) -> np.ndarray:
    """Grey levels at (p, 2) px: waves of 12 to 25 px in all directions."""
    rng = np.random.default_rng(5)
    waves = (
        2
        * np.pi
        / rng.uniform(12, 25, 30)[:, None]
        * np.stack([np.cos(turn := rng.uniform(0, np.pi, 30)), np.sin(turn)], axis=1)
    )
    return 120 + 10 * np.sin(places @ waves.T + rng.uniform(0, 2 * np.pi, 30)).sum(axis=1)


def places_in_photo(session: Session, cells: FaceCells) -> np.ndarray:
    """(p, 2) px: where the samples of a face lie in the photo `VIEW`, from the layout in the docstring of `Texels`."""
    inset = float(session.sweep_state(0).context.kernel.face_inset[cells.face])
    camera, corners = session.scene.views[VIEW].camera, session.vertices[FACES[cells.face]]
    n = cells.size
    weights = np.array(
        [
            [inset + (1 - 3 * inset) * (column + 1 / 3) / n, inset + (1 - 3 * inset) * (row + 1 / 3) / n]
            for row in range(n)
            for column in range(n - row)
        ]
    )
    weights = np.column_stack([weights, 1 - weights.sum(axis=1)])
    if session.options.cells.warp == "affine":
        return weights @ camera.project(corners)[0]
    return camera.project(weights @ corners)[0]


def flow_of(
    session: Session, monkeypatch: pytest.MonkeyPatch, texture: Callable[[np.ndarray], np.ndarray], shift: np.ndarray
) -> TexelFlow:
    """The flow where the photo has a texture of its own, and the reconstruction the same moved by `shift` px."""

    def shown(*inputs: object) -> Iterator[FaceCells]:
        for cells in cells_of_all_faces(*inputs):  # pyright: ignore[reportArgumentType]
            places, slot = places_in_photo(session, cells), cells.views.tolist().index(VIEW)
            observed, reconstruction = np.copy(cells.observed), np.copy(cells.reconstruction)
            observed[slot], reconstruction[slot] = texture(places), texture(places - shift)
            whole = np.ones_like(cells.counts)
            yield replace(cells, observed=observed, reconstruction=reconstruction, counts=whole)

    monkeypatch.setattr(texels, "cells_of_all_faces", shown)
    return texel_flow(session, 0, VIEW)


@pytest.mark.parametrize("shift", [(0.5, 0.0), (0.0, -0.4), (-0.3, 0.6)])
def test_a_known_shift_of_the_photo_is_found_at_every_sample_in_its_pixels(
    session: Session, monkeypatch: pytest.MonkeyPatch, shift: tuple[float, float]
):
    found = flow_of(session, monkeypatch, textured, np.array(shift))
    known = found.values[~np.isnan(found.values[:, 0])]
    assert len(known) > 0.9 * len(found.values) > 1000
    errors = np.linalg.norm(known - shift, axis=1) / np.linalg.norm(shift)
    # Central differences make the slope of a wave of 12 px 5 to 10 % too small.
    assert np.median(errors) < 0.1, np.median(errors)
    assert np.quantile(errors, 0.95) < 0.3
    for face in np.flatnonzero(found.size).tolist():
        assert np.nanmedian(found.of_face(face), axis=0) == pytest.approx(shift, abs=0.1 * float(np.linalg.norm(shift)))


def test_textures_that_do_not_determine_a_shift_have_no_flow(session: Session, monkeypatch: pytest.MonkeyPatch):
    shift = np.array([0.5, 0.5])
    noise = np.random.default_rng(0)
    flat = flow_of(session, monkeypatch, lambda places: 90 + noise.normal(0, 0.5, len(places)), shift)
    assert len(flat.values) > 1000
    assert np.isnan(flat.values).all()
    stripes = flow_of(session, monkeypatch, lambda places: 90 + 40 * np.sin(places[:, 0] / 3), shift)
    assert np.isnan(stripes.values[:, 0]).mean() > 0.9, "along stripes nothing is known"


def test_samples_that_the_photo_does_not_show_are_unknown_and_only_its_faces_take_part():
    session = Session(corner_scene(), small_options())
    found = texel_flow(session, None, VIEW)
    n_hidden = 0
    for cells in cells_of_all_faces(session, 0, "a test"):
        if VIEW not in cells.views:
            assert found.size[cells.face] == 0
            continue
        hidden = ~cells.counts[cells.views.tolist().index(VIEW)]
        assert np.isnan(found.of_face(cells.face)[hidden]).all()
        n_hidden += int(hidden.sum())
    assert n_hidden > 0
    assert not np.isnan(found.values).all()
    face = int(np.flatnonzero(found.size)[0])
    assert np.array_equal(found.image(face)[0, 0], found.of_face(face)[0], equal_nan=True)


def test_moments_and_photos_that_do_not_exist_and_cancellation():
    session = Session(corner_scene(), small_options())
    with pytest.raises(IndexError, match="moment 99: this run has moments 0 to 0"):
        texel_flow(session, 99, 0)
    for view in (-1, 99):
        with pytest.raises(IndexError, match=f"photo {view}"):
            texel_flow(session, 0, view)
    session.cancel_requested = lambda: True
    with pytest.raises(Cancelled):
        texel_flow(session, 0, 0)


def test_hues_are_directions_clockwise_from_the_right_and_lengths_mix_them_with_the_colour_of_zero():
    turns = np.arange(6) * np.pi / 3
    directions = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    assert wheel_colors(directions).tolist() == [list(hue) for hue in HUES]
    assert wheel_colors(np.zeros((1, 2))).tolist() == [list(ZERO)]
    halves = wheel_colors(0.5 * directions).astype(float)
    assert halves == pytest.approx((np.array(HUES) + ZERO) / 2, abs=0.51)
    between = wheel_colors(np.array([[np.cos(np.pi / 6), np.sin(np.pi / 6)], [np.cos(-np.pi / 6), np.sin(-np.pi / 6)]]))
    assert between == pytest.approx((np.array([HUES[0], HUES[5]]) + np.array([HUES[1], HUES[0]])) / 2, abs=0.51)
    # Nobody takes what is unknown for a flow.
    rim = wheel_colors(np.stack([np.cos(t := np.linspace(0, 2 * np.pi, 360)), np.sin(t)], axis=1)).astype(float)
    assert np.linalg.norm(rim - UNKNOWN, axis=1).min() > 60


def some_flow() -> TexelFlow:
    """Two faces of 6 and 3 samples a leg; lengths of 1, and one of 100; the first sample is unknown."""
    n = 21 + 6
    turns = np.linspace(0, 2 * np.pi, n)
    values = np.stack([np.cos(turns), np.sin(turns)], axis=1).astype(np.float32)
    values[0] = np.nan
    values[1] *= 100
    return TexelFlow(np.array([6, 3]), np.zeros(2), np.array([0, 21, 27]), values, 0.5)


def test_lengths_are_on_one_scale_for_the_pictures_beside_each_other():
    found = some_flow()
    coloring = PER_PIXEL["flow"]
    _, alone = by_vector(coloring, found.values[2:])
    assert (alone.low, alone.high, alone.unknown) == (0.0, pytest.approx(1.0), 0)
    at, beside = by_vector(coloring, found.values[2:], 3 * found.values[2:])
    assert beside.high == pytest.approx(3.0)
    assert at == pytest.approx(found.values[2:] / 3, abs=1e-6)
    at, legend = by_vector(coloring, found.values)
    assert np.isnan(at[0]).all()
    assert np.linalg.norm(at[1]) == pytest.approx(1.0), "beyond the scale: its direction in full colour"
    assert (legend.largest, legend.unknown) == (pytest.approx(100.0), 1)
    still, _ = by_vector(coloring, np.zeros((4, 2)))
    assert not still.any()


def test_the_picture_has_the_colour_of_every_sample_and_what_is_unknown_in_its_own():
    found = some_flow()
    picture = texel_picture(found, PER_PIXEL["flow"])
    image = np.array(Image.open(io.BytesIO(picture.picture)).convert("RGB")).astype(int)
    at, _ = by_vector(PER_PIXEL["flow"], found.values)
    for face, n in enumerate(found.size.tolist()):
        sample = found.start[face]
        for row in range(n):
            for column in range(n - row):
                weights = np.array([(column + 1 / 3) / n, (row + 1 / 3) / n, 0])
                weights[2] = 1 - weights.sum()
                u, v = weights @ picture.uv[face] * [image.shape[1], image.shape[0]]
                expected = np.array(UNKNOWN) if sample == 0 else wheel_colors(at[sample : sample + 1])[0].astype(int)
                assert image[int(v), int(u)].tolist() == expected.tolist(), (face, row, column)
                sample += 1
    assert picture.legend.left_out == pytest.approx(1 / 27)


def test_flow_is_shown_per_pixel_for_one_photo_alone():
    state = PageState(surface="flow")
    assert not state.shows_texels, "all photos have no common direction"
    state.residual_view = 2
    assert state.shows_texels
    state.is_per_pixel = False
    assert not state.shows_texels

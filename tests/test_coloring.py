"""Quantities on the mesh agree with what the record says, and every colour can be read back from the scale."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from app.html import text
from app.panels.legend import legend_html
from app.pictures.coloring import COLORINGS, REASON_COLORS, UNKNOWN, color_map, color_mesh
from fairing.judge import quantities
from fairing.run.session import Session
from fairing.trace import StepReason
from tests.small_scene import FACES, VERTICES, corner_scene, small_options


@pytest.fixture(scope="module")
def session():
    session = Session(corner_scene(), small_options(schedule={"order": "sequential", "max_sweeps": [1]}))
    session.run()
    return session


def read_back(mesh, corner: int) -> np.ndarray:
    """The colour of a corner of a coloured mesh, RGB, looked up as a browser does."""
    picture = cv2.imdecode(np.frombuffer(mesh.picture, dtype=np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    height, width = picture.shape[:2]
    x, y = mesh.uv[corner] * [width, height] - 0.5
    assert abs(y - round(y)) < 1e-6, "a colour between known and unknown"
    left = int(np.clip(np.floor(x), 0, width - 2))
    return picture[round(y), left] * (left + 1 - x) + picture[round(y), left + 1] * (x - left)


def test_energy_by_face_is_what_the_next_step_records(session: Session):
    first = session.trace.steps[0]
    energy = quantities.face_energy(session, 0)
    assert np.allclose(energy[first.faces], first.face_energy_before, rtol=1e-12)


def test_displacement_and_distance_are_measured_from_start_and_truth(session: Session):
    end, start = session.vertices, session.trace.start
    assert np.allclose(
        quantities.displacement(session, session.moment),
        100 * np.sqrt(((end - start) ** 2).sum(1)) / np.linalg.norm(np.ptp(start, axis=0)),
    )
    assert (quantities.displacement(session, 0) == 0).all()
    before, after = (quantities.distance_to_truth(session, moment) for moment in (0, session.moment))
    corner = 100 * np.linalg.norm(start[0] - VERTICES[0]) / np.linalg.norm(np.ptp(start, axis=0))
    assert before[0] == pytest.approx(corner, rel=1e-9)
    assert after[0] < 0.2 * before[0]


def test_the_last_step_of_each_vertex_counts_and_what_has_none_is_unknown(session: Session):
    assert np.isnan(quantities.last_reason(session, 0)).all()
    moment = len(session.trace) // 2
    reasons, ratio = quantities.last_reason(session, moment), quantities.determinacy(session, moment)
    for vertex in range(len(VERTICES)):
        own = [step for step in session.trace.steps[:moment] if vertex in step.vertices]
        if not own:
            assert np.isnan(reasons[vertex])
            continue
        assert reasons[vertex] == own[-1].reasons[list(own[-1].vertices).index(vertex)]
        known = [step.eigenvalues[list(step.vertices).index(vertex)] for step in own]
        known = [values for values in known if values[2] > 0]
        expected = max(0, known[-1][0]) / known[-1][2] if known else np.nan
        assert ratio[vertex] == pytest.approx(expected, nan_ok=True)


def test_faces_count_the_photos_that_see_them(session: Session):
    context = session.sweep_state(0).context
    assert (quantities.view_count(session, 0) == context.n_views).all()


def test_colours_follow_the_values_between_the_ends_of_the_scale():
    values = np.array([0.0, 1.0, 2.0, 3.0, 4.0, np.nan])
    mesh = color_mesh(COLORINGS["energy"], values, VERTICES, FACES)
    ends = mesh.legend.low, mesh.legend.high
    for face, value in enumerate(values[:5]):
        at = np.clip((value - ends[0]) / (ends[1] - ends[0]), 0, 1) * 255
        assert np.abs(read_back(mesh, 3 * face) - color_map()[round(at)]).max() < 3
    assert mesh.legend.unknown == 1
    assert np.array_equal(read_back(mesh, 15), UNKNOWN)
    assert "1 face unknown: too few photos" in legend_html(mesh.legend)
    assert np.array_equal(mesh.vertices.reshape(-1, 3, 3), VERTICES[FACES])


def test_no_colour_of_the_scale_looks_like_that_of_unknown_values():
    assert np.linalg.norm(color_map().astype(float) - UNKNOWN, axis=1).min() > 50


def test_a_few_extreme_values_do_not_take_all_the_colours():
    values = np.append(np.linspace(0, 1, 200), 1e6)
    faces = np.zeros((201, 3), dtype=int)
    legend = color_mesh(COLORINGS["energy"], values, VERTICES, faces).legend
    assert legend.high < 2
    assert legend.largest == 1e6
    assert "≥" in legend_html(legend)


def test_reasons_colour_the_surroundings_of_each_vertex_without_mixing():
    values = np.array([0.0, 1.0, 2.0, 3.0, 5.0, 6.0, np.nan])
    mesh = color_mesh(COLORINGS["reason"], values, VERTICES, FACES)
    area = np.linalg.norm(np.cross(*np.diff(mesh.vertices.reshape(-1, 3, 3), axis=1).transpose(1, 0, 2)), axis=1) / 2
    assert area.sum() == pytest.approx(3.0), "the small triangles cover the three unit squares"
    colors = {tuple(np.round(read_back(mesh, corner)).astype(int)) for corner in range(len(mesh.uv))}
    expected = {REASON_COLORS[StepReason(int(value))][1] for value in values[:6]}
    assert len(colors) == 7
    assert expected < colors
    for reason in values[:6]:
        assert text(REASON_COLORS[StepReason(int(reason))][0]) in legend_html(mesh.legend)


def test_the_legend_says_why_values_of_one_photo_are_unknown():
    legend = color_mesh(COLORINGS["residual"], np.array([1.0, np.nan, np.nan, 2, 3, 4]), VERTICES, FACES).legend
    assert "2 faces unknown: too few photos" in legend_html(legend)
    assert "2 faces unknown: not seen in this photo" in legend_html(
        replace(legend, why_unknown="not seen in this photo")
    )


def test_every_reason_has_a_colour():
    assert set(REASON_COLORS) >= set(StepReason)


def test_values_that_are_all_alike_or_all_unknown_have_a_legend():
    for values in (np.zeros(7), np.full(7, np.nan)):
        for name in ("moved", "determined"):
            mesh = color_mesh(COLORINGS[name], values, VERTICES, FACES)
            assert np.isfinite(mesh.uv).all()
            assert "nan" not in legend_html(mesh.legend)

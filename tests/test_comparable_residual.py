"""The comparable residual is one measure for all moments, runs and options."""

from dataclasses import replace

import numpy as np
import pytest

from fairing.errors import Cancelled
from fairing.judge import comparable_residual
from fairing.judge.comparable_residual import LEVEL, MARGIN, OPTIONS, SIGMA, ComparableResidual, stage_residuals
from fairing.judge.inspect import cells_in_context
from fairing.options import PRESETS
from fairing.run.recorded_stages import recorded_stages
from fairing.run.session import Session
from tests.small_scene import corner_scene, small_options


@pytest.fixture(scope="module")
def session() -> Session:
    session = Session(corner_scene(), small_options())
    session.run()
    return session


@pytest.fixture(scope="module")
def measure(session: Session) -> ComparableResidual:
    return ComparableResidual(session)


def test_it_falls_towards_the_truth(session: Session, measure: ComparableResidual):
    assert session.scene.truth is not None
    start, truth = session.trace.start, session.scene.truth.vertices
    assert truth is not None
    values = [measure.measure(start + share * (truth - start)).mean for share in (0.0, 0.5, 0.9, 1.0)]
    assert values == sorted(values, reverse=True)
    assert measure.measure(session.vertices).mean < 0.4 * values[0]


def test_it_is_the_same_whatever_the_options_and_the_moment_of_the_run(session: Session, measure: ComparableResidual):
    paper = Session(session.scene, replace(PRESETS["paper"], threads=2))
    for moment in (0, len(session.trace)):
        vertices = session.trace.vertices_at(moment)
        assert ComparableResidual(paper, threads=1).measure(vertices).mean == measure.measure(vertices).mean


def test_it_is_the_bounded_root_mean_square_of_the_residuals_of_the_cells(
    session: Session, measure: ComparableResidual
):
    """Against the residuals that a look at a face shows, sample by sample."""
    problem = session.problem_under(OPTIONS)
    every = np.ones(len(session.scene.mesh.faces), dtype=bool)
    context = problem.context_of(every, LEVEL, session.trace.start, MARGIN)
    for moment in (0, len(session.trace)):
        vertices = session.trace.vertices_at(moment)
        squares = weights = 0.0
        for face in np.flatnonzero(context.takes_part).tolist():
            cells = cells_in_context(session, context, vertices, face, moment, SIGMA, SIGMA**2)
            e = cells.residual.astype(float)
            weight = context.kernel.pair_weight[context.pairs_of(face)][:, None] * cells.counts
            squares += float((weight * SIGMA**2 * e**2 / (SIGMA**2 + e**2)).sum())
            weights += float(weight.sum())
        assert measure.measure(vertices).mean == pytest.approx(np.sqrt(squares / weights), rel=1e-4)


def test_its_parts_add_up(session: Session, measure: ComparableResidual):
    found, mesh = measure.measure(session.trace.start), session.scene.mesh
    assert found.of_faces(np.arange(len(mesh.faces))) == pytest.approx(found.mean)
    for face in range(len(mesh.faces)):
        of_face = found.of_face_by_view(face)
        pixels = found.pixels[found.faces == face]
        if of_face:
            mean = np.sqrt((pixels * np.array(list(of_face.values())) ** 2).sum() / pixels.sum())
            assert mean == pytest.approx(found.by_face()[face]) == pytest.approx(found.of_faces(np.array([face])))
    for vertex, ring in enumerate(mesh.one_rings):
        assert found.by_vertex(mesh)[vertex] == pytest.approx(found.of_faces(ring), nan_ok=True)


def test_a_corner_behind_a_camera_counts_as_an_outlier(session: Session, measure: ComparableResidual):
    camera = session.scene.views[0].camera
    vertices = session.trace.start.copy()
    vertices[0] = 2 * camera.center - vertices.mean(axis=0)
    found = measure.measure(vertices)
    assert np.isfinite(found.mean)
    assert measure.measure(session.trace.start).mean < found.mean <= SIGMA + 1e-9


def test_a_mesh_with_too_many_photo_pixels_is_measured_in_part(session: Session, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(comparable_residual, "MOST_PIXELS", 100_000)
    found = ComparableResidual(session).measure(session.trace.start)
    measured = np.unique(found.faces[found.pixels > 0])
    assert 0 < len(measured) < len(session.scene.mesh.faces)
    assert found.mean == pytest.approx(ComparableResidual(session).measure(session.trace.start).of_faces(measured))


def test_it_can_be_cancelled_and_measured_again(session: Session):
    is_cancelled = True
    measure = ComparableResidual(session, lambda: is_cancelled)
    with pytest.raises(Cancelled):
        measure.measure(session.trace.start)
    is_cancelled = False
    assert measure.measure(session.trace.start).mean > 0


def test_the_session_is_not_changed_by_it(session: Session):
    other = Session(session.scene, session.options)
    measure = ComparableResidual(other)
    while (record := other.step()) is not None:
        measure.measure(other.vertices)
        assert np.array_equal(record.after, session.trace.steps[other.moment - 1].after)


def test_the_stages_of_a_run_have_residuals(session: Session, measure: ComparableResidual):
    found = stage_residuals(session)
    assert list(found) == [0, *(stage.end for stage in recorded_stages(session.trace))]
    assert found[0] == measure.measure(session.trace.start).mean

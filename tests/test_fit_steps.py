"""Steps of smoothing and fits in a recorded run of a small building: objectives, folds, parts of terms."""

from dataclasses import replace

import numpy as np
import pytest

from demo_scenes.building.scene import scene_of_plan
from fairing.geometry.normals import face_normals
from fairing.optimize.iteration import OBJECTIVE_TOLERANCE
from fairing.options import PRESETS
from fairing.run.session import Session
from fairing.stage_kind import StageKind
from fairing.trace import StepReason
from tests.small_building import small_building

pytestmark = [pytest.mark.slow, pytest.mark.compiled]


@pytest.fixture(scope="module")
def run() -> Session:
    session = Session(replace(scene_of_plan("building small", small_building()), truth=None), PRESETS["accurate"])
    session.run()
    kinds = {step.stage for step in session.trace.steps}
    assert {StageKind.POINTS, StageKind.AXES, StageKind.CLOSEST_POINTS, StageKind.JUDGE, StageKind.PHOTOS} <= kinds
    return session


def test_no_step_of_a_fit_raises_its_objective(run: Session):
    steps = [step for step in run.trace.steps if step.stage.is_fit]
    assert len(steps) > 20
    for step in steps:
        is_rejected = (step.reasons == StepReason.REJECTED_ENERGY).all()
        assert step.objective_after <= step.objective_before * (1 + OBJECTIVE_TOLERANCE) or is_rejected, step.position
        assert not is_rejected or np.array_equal(step.before, step.after), "a rejected step moves nothing"
    falls = [1 - step.objective_after / step.objective_before for step in steps if step.objective_before > 0]
    assert np.mean(np.array(falls) > 0) > 0.9


def test_no_step_folds_a_face(run: Session):
    faces, vertices = run.scene.mesh.faces, run.trace.start
    for step in run.trace.steps:
        after = step.applied_to(vertices)
        turned = (face_normals(vertices, faces) * face_normals(after, faces)).sum(axis=1) < 0
        assert not turned.any(), (step.stage, step.position)
        vertices = after


def test_the_parts_of_all_terms_add_up_to_the_proposed_step(run: Session):
    moments = [
        k for k, step in enumerate(run.trace.steps) if step.stage.is_fit and step.stage is not StageKind.SMOOTHNESS
    ]
    first = [k for k in moments if k == 0 or run.trace.steps[k - 1].position[:2] != run.trace.steps[k].position[:2]]
    size = run.scene.mesh.diagonal
    for moment in sorted({*first[::4], *moments[::9]}):
        step, pulls = run.trace.steps[moment], run.pulls(moment)
        whole = sum(pull.step for pull in pulls)
        assert len(pulls) >= 2
        np.testing.assert_allclose(whole[step.vertices], step.proposed, atol=1e-9 * size)
        others = np.setdiff1d(np.arange(len(whole)), step.vertices)
        assert (whole[others] == 0).all()

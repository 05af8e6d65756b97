"""Quantities of breakpoints against values computed from the engine's own records."""

from types import SimpleNamespace

import numpy as np
import pytest

from app.debugger.commands import JumpTo, Run
from app.debugger.condition import ANY
from app.debugger.controller import Controller
from app.debugger.quantities import StepContext, limits_of, parse_step_condition, quantities_of
from demo_scenes import Photography, load_demo
from fairing.cells.visibility import Visibility
from fairing.errors import InputError
from fairing.judge.inspect import face_cells
from fairing.options import FairingOptions, RobustOptions, ScheduleOptions
from fairing.run.session import Session
from fairing.scene import Scene
from fairing.stage_kind import StageKind

OPTIONS = FairingOptions(
    robust=RobustOptions(sigma=3), schedule=ScheduleOptions(order="sequential", first_level="first")
).with_levels(sigma_rule="fixed", blur=(3.6, 2.0), max_sweeps=2, max_iterations=3)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_demo("cube", Photography())


@pytest.fixture(scope="module")
def session(scene: Scene) -> Session:
    session = Session(scene, OPTIONS)
    session.run()
    return session


def apart(scene: Scene, one: np.ndarray, other: np.ndarray) -> float:
    """The largest distance in any photo, px; all photos show the cube."""
    return max(
        float(np.linalg.norm(np.diff(view.camera.project(np.stack([one, other]))[0], axis=0))) for view in scene.views
    )


def test_a_data_breakpoint_stops_each_time_the_vertex_has_moved_the_given_distance(scene: Scene):
    controller = Controller(Session(scene, OPTIONS))
    try:
        controller.edit_breakpoints(lambda b: b.added("travelled(0) > 1.5"))
        stopped = controller.state
        for _ in range(2):
            controller.post(Run())
            state = controller.wait_until_idle()
            assert state.reason == "breakpoint: travelled(0) > 1.5"
            before = state.trace.vertices_at(state.moment - 1)
            assert apart(scene, stopped.vertices[0], before[0]) <= 1.5
            assert apart(scene, stopped.vertices[0], state.vertices[0]) > 1.5
            stopped = state
        controller.post(JumpTo(0))
        controller.wait_until_idle()
        controller.post(Run())
        assert controller.wait_until_idle().moment < stopped.moment, "a jump is a stop, too"
    finally:
        controller.close()


def test_quantities_around_a_step_are_those_of_the_engine(scene: Scene, session: Session):
    moment = next(m for m, record in enumerate(session.trace.steps, 1) if record.position == (0, 1, 2, 0))
    session.go_to(moment)
    record = session.trace.steps[moment - 1]
    ask = quantities_of(record, moment, StepContext(session, session.trace.start))
    assert ask.functions["displaced"](0) == pytest.approx(apart(scene, session.trace.start[0], session.vertices[0]))
    cells = [face_cells(session, int(face)) for face in record.faces]
    kept = [(c.residual[k], c.counts[k], c.outlier_threshold) for c in cells for k in np.flatnonzero(c.views == 3)]
    large = sum(int((np.abs(residual[counts]) > threshold).sum()) for residual, counts, threshold in kept)
    outliers = ask.functions["outliers"]
    assert outliers(4) == large / sum(int(counts.sum()) for _, counts, _ in kept), "views are counted from 1"
    assert 0 < outliers(4) < 0.5
    by_view = [outliers(view) for view in range(1, 13)]
    assert outliers(ANY) == np.nanmax(by_view)
    assert ask.functions["displaced"](ANY) == max(ask.functions["displaced"](vertex) for vertex in range(7))
    assert ask.functions["moved"](ANY) == max(ask.functions["moved"](vertex) for vertex in range(7))
    assert ask.functions["view"](ANY) == max(ask.functions["view"](view) for view in range(1, 13))
    for wrong in (-1, 99, float("nan"), 1e300):
        assert np.isnan(ask.functions["outliers"](wrong))
        assert np.isnan(ask.functions["displaced"](wrong))


def test_changes_of_visibility_are_counted_where_a_sweep_begins(session: Session, monkeypatch: pytest.MonkeyPatch):
    steps = session.trace.steps
    of_photos = [moment for moment, record in enumerate(steps, 1) if record.stage is StageKind.PHOTOS]
    begins = [moment for moment in of_photos if steps[moment - 1].position[2:] == (0, 0)]
    assert len(begins) == 4

    def sweep_state(moment: int) -> SimpleNamespace:
        sweep = sum(moment >= began - 1 for began in begins)
        reasons = np.full((12, 12), Visibility.SEEN)
        reasons[: sweep * sweep] = Visibility.HIDDEN
        return SimpleNamespace(context=SimpleNamespace(reasons=reasons))

    monkeypatch.setattr(session, "sweep_state", sweep_state)
    counts = [
        quantities_of(record, moment, StepContext(session, session.trace.start)).values["seen_changes"]()
        for moment, record in enumerate(session.trace.steps, 1)
    ]
    assert [counts[began - 1] for began in begins] == [0, 12 * 3, 12 * 5, 12 * 3]
    assert sum(counts) == 12 * 11


def test_quantities_that_need_the_engine_are_nan_without_it(session: Session):
    ask = quantities_of(session.trace.steps[0], 1)
    for name in ("travelled", "displaced", "outliers"):
        assert np.isnan(ask.functions[name](0))
    assert np.isnan(ask.values["seen_changes"]())


def test_errors_name_unknown_vertices_and_views(scene: Scene):
    limits = limits_of(scene)
    parse_step_condition("about(6) and view(12) > 0", limits)
    parse_step_condition("outliers(view) > 0.2 and travelled(vertex) > 3", limits)
    with pytest.raises(InputError, match=r"column 13: about\(\) expects a whole number from 0 to 6.*⟨here⟩7"):
        parse_step_condition("1 and about(7)", limits)
    with pytest.raises(InputError, match=r"column 6: view\(\) expects a whole number from 1 to 12"):
        parse_step_condition("view(0) > 0", limits)

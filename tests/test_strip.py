"""The timeline's strip, and looks at the past, without a browser."""

from dataclasses import replace

import numpy as np
import pytest

from app.debugger.commands import Extent, Forward
from app.debugger.controller import Controller
from app.debugger.run_state import Activity, RunState
from app.page_state.page_state import PageState
from app.page_state.past_moment import at_viewed_moment
from app.palette import NOW, REJECTED, START
from app.pictures.strip import KINDS, MAX_PIXELS, StepHistory, _log_part
from demo_scenes import Photography, load_demo
from fairing.run.session import Session
from tests.two_levels import two_levels

OPTIONS = two_levels("sequential", sweeps=2, iterations=3)


@pytest.fixture(scope="module")
def state() -> RunState:
    controller = Controller(Session(load_demo("cube", Photography()), OPTIONS))
    controller.post(Forward(Extent.LEVEL))
    found = controller.wait_until_idle()
    controller.close()
    return found


def test_the_strip_has_a_pixel_a_moment_and_the_colour_of_what_happened(state: RunState):
    history = StepHistory()
    history.update(state)
    energy, step, rejected = (history.picture(kind)[0].astype(int) for kind in KINDS)
    assert len(energy) == len(step) == len(rejected) == state.length
    falls = [(r.energy_before - r.energy_after) / r.energy_before for r in state.trace.steps]
    assert np.linalg.norm(energy[int(np.argmax(falls))] - START) < 60
    for k, record in enumerate(state.trace.steps):
        if not record.accepted:
            assert np.array_equal(step[k], step.min(axis=0)), "no step, no colour"
    lengths = [record.step_px.max() if record.accepted else 0 for record in state.trace.steps]
    to_now = np.linalg.norm(step - NOW, axis=1)
    assert to_now[int(np.argmax(lengths))] == to_now.min(), "the longest step has the strongest colour"


def test_a_long_strip_keeps_the_strongest_of_each_group(state: RunState):
    history = StepHistory()
    history.update(state)
    count = 2 * MAX_PIXELS + 7
    history._values = np.zeros((count, 4), dtype=np.float32)
    history._values[1001, 2] = 1
    picture = history.picture("rejected")[0]
    assert len(picture) <= MAX_PIXELS
    assert np.flatnonzero((picture == REJECTED).all(axis=1)).tolist() == [1001 // 3]


@pytest.mark.parametrize(("value", "part"), [(0.0, 0.0), (1e-5, 0.0), (1e-3, 0.5), (0.1, 1.0), (5.0, 1.0)])
def test_the_scale_of_a_strip_is_logarithmic(value: float, part: float):
    assert _log_part(value, 1e-5, 1e-1) == pytest.approx(part)


def test_a_look_back_shows_the_past_only_while_the_run_goes_on(state: RunState):
    view = PageState(viewed_moment=3)
    running = replace(state, activity=Activity.RUNNING)
    past = at_viewed_moment(running, view)
    assert (past.moment, past.length) == (3, state.length)
    np.testing.assert_array_equal(past.vertices, state.trace.vertices_at(3))
    assert past.position == state.trace.steps[3].position
    assert at_viewed_moment(state, view) is state
    assert view.viewed_moment is None

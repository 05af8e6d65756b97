"""Steps that the engine has computed for one test serve the others that lead it the same way.

A run is a function of scene, options and what was done before (tests/test_session.py holds it to that), and the lessons are
walked twice: without a page, every claim checked, and in the page.
"""

from collections.abc import Iterator

import pytest

from fairing.run.stepper import Stepper
from fairing.trace import StepRecord

_known: dict[tuple[str, str, str, int], StepRecord] = {}


@pytest.fixture(scope="module")
def remembered_steps() -> Iterator[None]:
    compute = Stepper.step_after

    def step_after(self: Stepper, moment: int) -> StepRecord:
        problem, trace = self._problem, self._trace
        before = hash(
            (trace.start.tobytes(), *((s.vertices.tobytes(), s.after.tobytes()) for s in trace.steps[:moment]))
        )
        key = (problem.scene.name, repr(problem.options), repr(trace.plan), before)
        if key not in _known:
            _known[key] = compute(self, moment)
        return _known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Stepper, "step_after", step_after)
        yield

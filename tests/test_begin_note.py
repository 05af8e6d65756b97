"""The status's note on the level a run begins at."""

from types import SimpleNamespace

import pytest

from app.panels.status import begin_note
from fairing.options import FairingOptions
from fairing.run_plan import PlanStage, RunPlan

OPTIONS = FairingOptions()
BEGINNING = RunPlan(0, False, False)


def note(plan: RunPlan | None) -> str:
    return begin_note(SimpleNamespace(trace=SimpleNamespace(plan=plan), options=OPTIONS))  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("plan", "expected"),
    [
        (None, "\u00a0"),
        (BEGINNING, "\u00a0"),
        (RunPlan(3, False, True, start_sigma=19.0), "Begins at level 4: the start fits its points"),
        (RunPlan(2, False, False), "Begins at level 3: its blur suits the face size"),
        (RunPlan(3, False, False, start_sigma=4.0), "Begins at level 4: its blur suits the face size"),
        (
            RunPlan(4, False, True, start_sigma=6.0, represents_surface=True),
            "Begins at level 5: the start is near its points",
        ),
        (RunPlan(0, True, False, stages=(PlanStage("smoothing"), PlanStage("photos"))), "Plan of your own: 2 stages"),
    ],
)
def test_the_note_names_the_level_and_what_decided(plan: RunPlan | None, expected: str):
    assert note(plan) == expected

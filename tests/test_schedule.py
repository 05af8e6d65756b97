"""What follows what within a level: its search, Gauss-Newton, and rounds of a second try and Gauss-Newton again."""

import pytest

from fairing.options import ScheduleOptions
from fairing.run.schedule import LevelPlan, next_position
from fairing.trace import SchedulePosition

LEVEL = 2
SCHEDULE = ScheduleOptions(blur=(2.0, 2.0, 2.0, 2.0), max_iterations=(1,), sweep_tolerance=0.05)


def walk(plan: LevelPlan, longest_move: float) -> tuple[str, SchedulePosition]:
    """The sweeps of a level in their order, S earches, T ries and G auss-Newton, and where the run goes on after it."""
    position, kinds = SchedulePosition(LEVEL, 0, 0, 0), ""
    while position.level == LEVEL:
        kind = "T" if plan.is_second_try(position.sweep) else "S" if plan.searches(position.sweep) else "G"
        assert plan.searches(position.sweep) == (kind != "G")
        kinds += kind
        position = next_position(SCHEDULE, plan, position, True, 1, lambda: longest_move)
    return kinds, position


@pytest.mark.parametrize(
    ("plan", "moving", "resting"),
    [
        (LevelPlan(is_searched=False, sweeps=3, tries=0), "GGG", "G"),
        (LevelPlan(is_searched=True, sweeps=3, tries=0), "SGGG", "SG"),
        (LevelPlan(is_searched=True, sweeps=4, tries=2), "SGGGGTGGTGG", "SGTGTG"),
    ],
)
def test_sweeps_go_on_while_vertices_move_and_every_round_is_begun(plan: LevelPlan, moving: str, resting: str):
    after = SchedulePosition(LEVEL + 1, 0, 0, 0)
    assert walk(plan, 0.11) == (moving, after)
    assert walk(plan, 0.09) == (resting, after)
    assert plan.n_sweeps == len(moving)


def test_within_a_sweep_iterations_come_first_then_units():
    plan = LevelPlan(is_searched=False, sweeps=2, tries=0)
    schedule = ScheduleOptions(blur=(2.0,), max_iterations=(3,))
    position, seen = SchedulePosition(0, 0, 0, 0), []
    while position.level == 0:
        seen.append(tuple(position[1:]))
        position = next_position(schedule, plan, position, position.unit == 1, 3, lambda: 9.0)
    assert seen == [(sweep, unit, k) for sweep in range(2) for unit in range(3) for k in range(1 if unit == 1 else 3)]

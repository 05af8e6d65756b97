"""Order of sweeps within a level: local search, Gauss-Newton, restarts; and progress as a pure function of the position."""

from dataclasses import replace

import numpy as np
import pytest

from fairing.run.phases import (
    SWEEPS_AFTER_SEARCH,
    WEAK_PRIOR,
    GaussNewton,
    Level,
    LocalSearch,
    Restart,
    Schedule,
    schedule_of,
)
from fairing.run.schedule import fraction_done, most_blocks, next_position
from fairing.run_plan import RunPlan
from fairing.trace import SchedulePosition
from tests.small_scene import small_options

LEVEL = 2
SEARCH = LocalSearch(radius=3.0, max_displacement=4.5)
LETTERS = {LocalSearch: "S", GaussNewton: "G", Restart: "R"}


def gauss_newton(max_sweeps: int, max_iterations: int = 1) -> GaussNewton:
    return GaussNewton(max_sweeps, max_iterations, tolerance=0.1)


def level_of(*phases) -> Level:
    return Level(LEVEL, prior=0.1, phases=phases)


def walk(level: Level, longest_move: float) -> tuple[str, SchedulePosition]:
    """The phases of the sweeps of a level in their order, and the position after it."""
    position, letters = SchedulePosition(LEVEL, 0, 0, 0), ""
    while position.level == LEVEL:
        letters += LETTERS[type(level.phase_at(position.sweep))]
        position = next_position(level, position, True, 1, lambda: longest_move)
    return letters, position


@pytest.mark.parametrize(
    ("level", "moving", "resting"),
    [
        (level_of(gauss_newton(3)), "GGG", "G"),
        (level_of(SEARCH, gauss_newton(3)), "SGGG", "SG"),
        (level_of(Restart(0), SEARCH, gauss_newton(4)), "RSGGGG", "RSG"),
    ],
)
def test_sweeps_continue_while_vertices_move_and_no_phase_is_skipped(level: Level, moving: str, resting: str):
    after = SchedulePosition(LEVEL + 1, 0, 0, 0)
    assert walk(level, 0.11) == (moving, after)
    assert walk(level, 0.09) == (resting, after)
    assert level.n_sweeps == len(moving)


def test_within_a_sweep_iterations_come_first_then_blocks():
    level = Level(0, prior=0.1, phases=(gauss_newton(2, max_iterations=3),))
    position, seen = SchedulePosition(0, 0, 0, 0), []
    while position.level == 0:
        seen.append(tuple(position[1:]))
        position = next_position(level, position, position.block == 1, 3, lambda: 9.0)
    assert seen == [
        (sweep, block, k) for sweep in range(2) for block in range(3) for k in range(1 if block == 1 else 3)
    ]


def test_a_sweep_beyond_the_last_phase_ends_the_level():
    """A branch with fewer sweeps than the run it comes from."""
    level = level_of(SEARCH, gauss_newton(2))
    assert level.phase_at(7) == gauss_newton(2)
    assert next_position(level, SchedulePosition(LEVEL, 7, 0, 0), True, 1, lambda: 9.0) == (LEVEL + 1, 0, 0, 0)


def plan(**changes) -> RunPlan:
    values = {
        "first_level": 0,
        "is_smoothed": False,
        "is_fitted_to_points": False,
        "start_error": 0.0,
        "is_near_truth": False,
    }
    return RunPlan(**values | changes)


def test_phases_follow_from_options_and_plan():
    schedule = {"blur": [2.0, 1.2, 0.6], "search": [0.0, 0.8, 0.5], "max_sweeps": [5], "sweeps_near_truth": [1]}
    options = small_options(schedule=schedule, cells={"point_spread": ["as_seen", "as_seen", "common"]})

    def letters(plan: RunPlan) -> list[str]:
        levels = schedule_of(options, plan).levels
        return ["".join(LETTERS[type(phase)] for phase in level.phases) for level in levels]

    assert letters(plan()) == ["G", "G", "G"]
    assert letters(plan(start_error=9.0)) == ["G", "SG", "RSG"]
    assert [level.gauss_newton.max_sweeps for level in schedule_of(options, plan(is_near_truth=True)).levels] == [
        1,
        1,
        1,
    ]
    searched = schedule_of(options, plan(start_error=9.0)).levels
    assert [level.search.radius for level in searched[1:]] == [0.8 * 9.0, 0.5 * 9.0]
    assert [level.gauss_newton.max_sweeps for level in searched] == [5, 5, 5 * SWEEPS_AFTER_SEARCH]
    assert searched[2].prior < searched[1].prior == options.step.prior


def test_a_start_whose_faces_can_follow_its_points_is_not_held_to_at_the_sharp_level():
    schedule = {"blur": [2.0, 0.6], "search": [0.0], "max_sweeps": [5]}
    options = small_options(schedule=schedule, cells={"point_spread": ["as_seen", "common"]})
    fitted = plan(start_sigma=4.0, is_fitted_to_points=True)
    follows, holds = (
        schedule_of(options, replace(fitted, represents_surface=represents)).levels for represents in (True, False)
    )
    assert follows[0].prior == holds[0].prior == holds[1].prior == options.step.prior
    assert follows[1].prior == WEAK_PRIOR * options.step.prior
    assert (follows[1].start_sigma, holds[1].start_sigma) == (0.0, 4.0)


def test_vertices_stay_within_1_3_times_the_measured_error_or_one_and_a_half_search_radii():
    options = small_options(schedule={"blur": [2.0, 1.2], "search": [0.0, 0.8], "max_sweeps": [5]})

    def farthest(plan: RunPlan) -> list[float]:
        return [level.gauss_newton.max_displacement for level in schedule_of(options, plan).levels]

    assert farthest(plan()) == [np.inf, np.inf]
    assert farthest(plan(start_sigma=4.0)) == pytest.approx([1.3 * 4.0] * 2)
    assert farthest(plan(start_error=9.0)) == pytest.approx([1.5 * 0.8 * 9.0] * 2)


def test_progress_rises_from_0_to_1_along_the_schedule():
    levels = (
        Level(0, 0.1, phases=(gauss_newton(2, 3),)),
        Level(1, 0.1, phases=(SEARCH, gauss_newton(2, 3), Restart(0), gauss_newton(1, 3))),
    )
    schedule, position, fractions = Schedule(levels, 0, 0), SchedulePosition(0, 0, 0, 0), []
    while position.level < 2:
        fractions.append(fraction_done(schedule, position, lambda phase: 3))
        position = next_position(levels[position.level], position, False, 3, lambda: 9.0)
    fractions.append(fraction_done(schedule, position, lambda phase: 3))
    assert fractions == sorted(fractions)
    assert (fractions[0], fractions[-1]) == (0.0, 1.0)
    assert len(set(fractions)) == len(fractions)


def test_a_sweep_without_blocks_has_a_progress():
    schedule = Schedule((Level(0, 0.1, phases=(gauss_newton(2, 3),)),), 0, 0)
    assert 0 <= fraction_done(schedule, SchedulePosition(0, 0, 0, 1), lambda phase: 0) < 1


def test_the_number_of_blocks_is_bounded_by_the_order():
    phase = gauss_newton(1)
    assert [most_blocks(phase, order, 50, 6) for order in ("joint", "independent", "sequential")] == [1, 7, 50]
    assert most_blocks(SEARCH, "joint", 50, 6) == 7
    assert most_blocks(Restart(0), "sequential", 50, 6) == 1

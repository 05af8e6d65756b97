"""Order of stages and sweeps within a level: smoothing, fits, photos and judges; progress as a function of the position."""

from dataclasses import replace

import pytest

from fairing.options import FINE_BLUR, PRESETS, FairingOptions
from fairing.run.phases import Level, Schedule, most_blocks, schedule_of
from fairing.run.stages import Judge, Photos, PointGates, Stage, fit_stages, numbered
from fairing.run_plan import RunPlan
from fairing.stage_kind import StageKind
from fairing.trace import SchedulePosition
from tests.small_scene import small_options

LEVEL = 2
FIT = PointGates(StageKind.POINTS, gates=(5.0,))
END = Judge(StageKind.JUDGE, by="end")
LETTERS = {
    StageKind.PHOTOS: "G", StageKind.SMOOTHNESS: "S", StageKind.POINTS: "P", StageKind.SURFACE_POINTS: "U",
    StageKind.AXES: "A", StageKind.CLOSEST_POINTS: "C", StageKind.JUDGE: "J",
}  # fmt: skip
# Points with their judge, then twice points near the mesh, each with the axes; closest points and broad relations; photos judge.
FITTED = "PJA" + 2 * "UA" + "CACA" + "J"


def gauss_newton(max_sweeps: int, max_iterations: int = 1) -> Photos:
    return Photos(StageKind.PHOTOS, max_sweeps, max_iterations, tolerance=0.1)


def level_of(*stages: Stage) -> Level:
    return Level(LEVEL, stages=numbered(stages, 0))


def walk(level: Level, longest_move: float) -> tuple[str, SchedulePosition]:
    """The stages of the sweeps of a level in their order, and the position after it."""
    position, letters = SchedulePosition(LEVEL, 0, 0, 0), ""
    while position.level == LEVEL:
        letters += LETTERS[level.stage_at(position.sweep).kind]
        position = level.position_after(position, True, 1, lambda: longest_move)
    return letters, position


@pytest.mark.parametrize(
    ("level", "moving", "resting"),
    [
        (level_of(gauss_newton(3)), "GGG", "G"),
        (level_of(gauss_newton(3), END), "GGGJ", "GJ"),
        (level_of(FIT, gauss_newton(3)), "PGGG", "PG"),
        (level_of(gauss_newton(2), FIT, gauss_newton(4)), "GGPGGGG", "GPG"),
    ],
)
def test_sweeps_continue_while_vertices_move_and_no_stage_is_skipped(level: Level, moving: str, resting: str):
    after = SchedulePosition(LEVEL + 1, 0, 0, 0)
    assert walk(level, 0.11) == (moving, after)
    assert walk(level, 0.09) == (resting, after)
    assert sum(stage.max_sweeps for stage in level.stages) == len(moving)


def test_within_a_sweep_iterations_come_first_then_blocks():
    level = Level(0, stages=(gauss_newton(2, max_iterations=3),))
    position, seen = SchedulePosition(0, 0, 0, 0), []
    while position.level == 0:
        seen.append(tuple(position[1:]))
        position = level.position_after(position, position.block == 1, 3, lambda: 9.0)
    assert seen == [
        (sweep, block, k) for sweep in range(2) for block in range(3) for k in range(1 if block == 1 else 3)
    ]


def test_a_sweep_beyond_the_last_stage_ends_the_level():
    """A branch with fewer sweeps than the run it comes from."""
    level = level_of(FIT, gauss_newton(2))
    assert level.stage_at(7) == level.stages[-1]
    assert level.position_after(SchedulePosition(LEVEL, 7, 0, 0), True, 1, lambda: 9.0) == (LEVEL + 1, 0, 0, 0)


def test_a_sweep_that_no_stage_has_is_one_of_photos_and_the_judge_of_the_end_follows():
    level = level_of(FIT, gauss_newton(2), END)
    assert level.stage_at(7) == level.stages[1]
    assert level.position_after(SchedulePosition(LEVEL, 7, 0, 0), True, 1, lambda: 9.0) == (LEVEL, 3, 0, 0)


def plan(**changes) -> RunPlan:
    values = {
        "first_level": 0,
        "is_smoothed": False,
        "is_fitted_to_points": False,
        "records_fit": True,
    }
    return RunPlan(**values | changes)


def letters_of(options: FairingOptions, plan: RunPlan) -> list[str]:
    """The stages of each level."""
    return ["".join(LETTERS[stage.kind] for stage in level.stages) for level in schedule_of(options, plan).levels]


def test_smoothing_and_the_fit_of_the_start_come_first_at_the_first_level_alone():
    options = small_options(schedule={"blur": [2.0, 1.2, 0.6]}, step={"points": [0.3], "smoothing": [0.1]})
    start = plan(first_level=1, is_smoothed=True, is_fitted_to_points=True)
    assert letters_of(options, start) == ["G", "SJCACAJG", "GJ"]
    assert letters_of(options, replace(start, has_photos_of_points=True)) == ["G", f"SJ{FITTED}G", "GJ"]
    assert letters_of(options, replace(start, is_smoothed=False)) == ["G", "CACAJG", "GJ"]
    assert letters_of(options, replace(start, records_fit=False)) == ["G", "G", "GJ"], "recorded as one step each"


@pytest.mark.parametrize("preset", PRESETS)
def test_no_two_stages_of_a_level_share_a_sweep_and_photos_have_the_first_ones_under_every_plan(preset: str):
    plans = [
        plan(is_smoothed=smoothed, is_fitted_to_points=fitted, has_photos_of_points=True)
        for smoothed in (False, True)
        for fitted in (False, True)
    ]
    numbers: dict[tuple, set[int]] = {}
    for each in plans:
        for level in schedule_of(PRESETS[preset], each).levels:
            sweeps = [
                sweep
                for stage in level.stages
                for sweep in range(stage.first_sweep, stage.first_sweep + stage.max_sweeps)
            ]
            assert len(sweeps) == len(set(sweeps))
            assert level.photos.first_sweep == 0
            for stage in level.stages:
                assert all(level.stage_at(stage.first_sweep + k) == stage for k in range(stage.max_sweeps))
            if each.is_smoothed and level.number == 0:
                numbers.setdefault(("smoothing", level.number), set()).add(level.stages[0].first_sweep)
    assert all(len(first) == 1 for first in numbers.values()), "branches keep their numbers"


def test_a_smoothing_or_fit_is_the_part_of_each_of_its_stages():
    options = small_options(schedule={"blur": [0.6]}, step={"points": [0.3], "smoothing": [0.1]})
    level = schedule_of(options, plan(is_smoothed=True, is_fitted_to_points=True, has_photos_of_points=True)).levels[0]
    fit, stages = len(fit_stages(has_photos_of_points=True)), level.stages
    parts = [stages[:2], stages[2 : 2 + fit], (), ()]
    for part, length in zip(parts, [2, fit, 1, 1], strict=True):
        for stage in stages[:length]:
            assert level.part_of(stage) == part
        stages = stages[length:]
    assert not stages


def test_the_measured_error_of_a_start_holds_at_fine_levels_unless_it_has_been_fitted():
    schedule = {"blur": [3.6, 0.6], "max_sweeps": [5]}
    options = small_options(schedule=schedule, step={"prior": 0.3})

    def sigmas(plan: RunPlan) -> list[tuple[float, float]]:
        return [(level.start_sigma, level.prior) for level in schedule_of(options, plan).levels]

    fitted = plan(start_sigma=4.0, is_fitted_to_points=True)
    weak = (FINE_BLUR, 0.3)
    assert sigmas(plan()) == 2 * [(0.0, 0.3)]
    assert sigmas(fitted) == [weak, (4.0, 1.0)]
    assert sigmas(replace(fitted, represents_surface=True)) == [weak, weak]


def test_progress_rises_from_0_to_1_along_the_schedule():
    levels = (
        Level(0, stages=numbered((gauss_newton(2, 3),), 0)),
        Level(1, stages=(*numbered((FIT,), 9), gauss_newton(2, 3), *numbered((END,), 8))),
    )
    schedule, position, fractions, of_photos = Schedule(levels, 0), SchedulePosition(0, 0, 0, 0), [], []
    while position.level < 2:
        fractions.append(schedule.fraction_done(position, 3))
        if isinstance(levels[position.level].stage_at(position.sweep), Photos):
            of_photos.append(fractions[-1])
        n_blocks = 3 if isinstance(levels[position.level].stage_at(position.sweep), Photos) else 1
        position = levels[position.level].position_after(position, False, n_blocks, lambda: 9.0)
    fractions.append(schedule.fraction_done(position, 3))
    assert fractions == sorted(fractions)
    assert (fractions[0], fractions[-1]) == (0.0, 1.0)
    assert len(of_photos) == 2 * 3 * 3 + 2 * 3 * 3
    assert len(set(of_photos)) == len(of_photos), "fits are fast and count for nothing; photos always do"


def test_a_sweep_without_blocks_has_a_progress():
    schedule = Schedule((Level(0, stages=(gauss_newton(2, 3),)),), 0)
    assert 0 <= schedule.fraction_done(SchedulePosition(0, 0, 0, 1), 0) < 1


def test_the_number_of_blocks_is_bounded_by_the_order():
    assert [most_blocks(order, 50, 6) for order in ("joint", "independent", "sequential")] == [1, 7, 50]


def test_positions_are_ordered_by_execution():
    options = PRESETS["accurate"]
    plan = RunPlan(3, True, True, has_photos_of_points=True, records_fit=True)
    schedule = schedule_of(options, plan)
    executed = [
        SchedulePosition(level.number, stage.first_sweep + sweep, 0, iteration)
        for level in schedule.levels[plan.first_level :]
        for stage in level.stages
        for sweep in range(stage.max_sweeps)
        for iteration in range(stage.max_iterations)
    ]
    assert executed != sorted(executed), "numbers of sweeps alone do not order them"
    assert executed == sorted(executed, key=schedule.order_of)
    assert schedule.order_of(SchedulePosition(options.n_levels, 0, 0, 0)) > schedule.order_of(executed[-1])
    assert schedule.order_of(SchedulePosition(-1, 0, 0, 0)) < schedule.order_of(executed[0])

"""What is recorded, over moments: series, where values changed, watch expressions."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from app.debugger.recorded_values import ITEMS, last_change, value_at
from app.debugger.series import QUANTITIES, Series, series_of, thinned
from app.debugger.watch import parse_watch, watch_series, with_watch
from fairing.errors import InputError
from fairing.run.session import Session
from fairing.trace import SchedulePosition, StepReason, StepRecord
from tests.small_scene import corner_scene, small_options

ITEM = {item.name: item for item in ITEMS}


def record(vertices: list[int], n: int, **changes) -> StepRecord:
    """A step of some vertices whose numbers come from n."""
    u = len(vertices)
    base = StepRecord(
        position=SchedulePosition(0, 0, n, 0), next_position=SchedulePosition(0, 0, n + 1, 0), sweep_moment=0,
        vertices=np.array(vertices), before=np.full((u, 3), float(n)), proposed=np.ones((u, 3)),
        after=np.full((u, 3), n + 1.0), step_px=np.full(u, 0.5 * n), damping=np.zeros(u),
        eigenvalues=np.tile([1.0, 2.0, 4.0], (u, 1)), reasons=np.full(u, StepReason.ACCEPTED, dtype=np.int8),
        objective_before=2.0, objective_after=1.0, faces=np.array([0, 1]),
        face_energy_before=np.array([3.0, 4.0]), face_energy_after=np.array([2.0, 3.0 - 0.1 * n]),
        view_energy_before=np.ones(2), view_energy_after=np.zeros(2), damping_next=np.zeros(u),
        rejections=np.zeros(u, dtype=int),
    )  # fmt: skip
    return replace(base, **changes)


def run_of(steps: list[StepRecord], run_id: int = 1) -> SimpleNamespace:
    return SimpleNamespace(run_id=run_id, length=len(steps), trace=SimpleNamespace(steps=steps))


def test_a_series_reads_new_steps_only_and_begins_again_with_another_run():
    read = []
    series = Series(lambda step, moment: read.append(moment) or float(moment))
    steps = [record([0], n) for n in range(4)]
    series.update(run_of(steps[:2]))
    series.update(run_of(steps))
    assert read == [1, 2, 3, 4]
    series.update(run_of(steps[:1], run_id=2))
    assert read == [1, 2, 3, 4, 1]
    assert series.moments.tolist() == [1]


def test_the_series_of_a_vertex_has_the_steps_about_it_only():
    steps = [record([0], 1), record([1, 2], 2), record([2, 0], 3)]
    series = series_of("step", 0, np.array([1]))
    series.update(run_of(steps))
    assert series.moments.tolist() == [1, 3]
    assert series.values.tolist() == [0.5, 1.5]
    assert series.at(2) == 0.5
    assert series.at(0) != series.at(0)
    energy = series_of("energy", 0, np.array([1, 7]))
    energy.update(run_of(steps))
    assert energy.values == pytest.approx([2.9, 2.7])


def test_what_is_not_known_is_left_out():
    steps = [record([0], 1, eigenvalues=np.zeros((1, 3))), record([0], 2)]
    series = series_of("eigen", None, np.zeros(0, dtype=int))
    series.update(run_of(steps))
    assert (series.moments.tolist(), series.values.tolist()) == ([2], [0.25])


def test_every_quantity_is_known_of_a_real_run_and_of_a_vertex():
    session = Session(corner_scene(), small_options())
    for _ in range(3):
        session.step()
    run = run_of(session.trace.steps)
    for name in QUANTITIES:
        for vertex in (None, 0):
            series = series_of(name, vertex, session.scene.mesh.one_rings[0])
            series.update(run)
            assert len(series.values) == 3, name
            assert np.isfinite(series.values).all()


def test_a_thinned_line_keeps_its_ends_and_the_extremes_of_every_pixel():
    rng = np.random.default_rng(0)
    places, values = np.arange(10_000), rng.normal(size=10_000)
    chosen = thinned(places, values, 100)
    assert len(chosen) <= 202
    assert {0, 9999} <= set(chosen.tolist())
    for pixel in range(100):
        within = places[(places * 100) // 9999 == pixel]
        kept = np.intersect1d(chosen, within)
        assert values[kept].min() == values[within].min()
        assert values[kept].max() == values[within].max()
    assert np.array_equal(thinned(places[:50], values[:50], 100), np.arange(50))


def test_a_value_is_that_of_the_last_step_about_the_vertex():
    steps = [record([0], 1), record([1], 2)]
    item = ITEM["step in the photos, px"]
    assert value_at(item, steps, 2, 0) == 0.5
    assert value_at(item, steps, 0, 0) is None
    assert value_at(ITEM["place in the sweep"], steps, 2, 0) == 3


def test_the_photo_of_the_largest_decrease_is_counted_from_1_as_in_the_page():
    item = ITEM["photo with the largest energy decrease"]
    fell, rose = np.array([0.5, -1.0, 0.0]), np.array([1.5, 1.0, 1.0])
    before = np.ones(3)
    steps = [record([0], n, view_energy_before=before, view_energy_after=after) for n, after in enumerate((fell, rose))]
    assert [item.shown(value_at(item, steps, moment, 0)) for moment in (1, 2)] == ["2", "none"]


def test_the_last_change_is_found_across_steps_about_others_and_repeats():
    damping = [0.0, 0.1, 0.1, 0.1, 0.0]
    steps = []
    for n, value in enumerate(damping):
        steps += [record([0], n, damping=np.array([value])), record([1], n)]
    item = ITEM["damping"]
    assert last_change(item, steps, 10, 0) == 9
    assert last_change(item, steps, 9, 0) == 3
    assert last_change(item, steps, 8, 0) == 3
    assert last_change(item, steps, 3, 0) == 1
    assert last_change(item, steps, 1, 0) is None
    assert last_change(ITEM["place in the sweep"], steps, 10, 0) == 9


def test_every_item_of_a_real_step_can_be_shown():
    session = Session(corner_scene(), small_options())
    session.step()
    for item in ITEMS:
        assert item.shown(value_at(item, session.trace.steps, 1, 0)), item.name


def test_a_watch_is_an_expression_and_its_series_its_values():
    scene = corner_scene()
    watch = parse_watch("energy / 2 + moved(0)", scene)
    series = watch_series(watch)
    steps = [record([0], 2), record([1], 4)]
    series.update(run_of(steps))
    assert series.values == pytest.approx([0.5 * 4.8 + 1.0, 0.5 * 4.6])


def test_watches_point_at_mistakes_and_are_bounded():
    scene = corner_scene()
    with pytest.raises(InputError, match="column 10"):
        parse_watch("energy + +", scene)
    with pytest.raises(InputError, match="cannot be watched"):
        parse_watch("travelled(0)", scene)
    with pytest.raises(InputError, match="expected an expression"):
        parse_watch("  ", scene)
    watches = with_watch((), parse_watch("energy", scene))
    with pytest.raises(InputError, match="already"):
        with_watch(watches, parse_watch("energy", scene))
    for n in range(11):
        watches = with_watch(watches, parse_watch(f"energy + {n}", scene))
    with pytest.raises(InputError, match="at most 12"):
        with_watch(watches, parse_watch("change", scene))

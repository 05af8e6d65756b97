"""Ablation: every setting exists, variants change what they name, and the table shows factors of the committed run."""

import json
from pathlib import Path

import pytest

from app.debugger.option_fields import changed_options
from fairing import options
from fairing.cameras import misfits
from fairing.errors import InputError
from fairing.options import PRESETS
from fairing.run import phases
from fairing.terms import axes
from tests import ablation
from tests.ablation import SETTINGS, Setting, ablation_table, measure_ablation, scaled, set_constant
from tests.family import code_digest
from tests.small_scene import corner_scene


@pytest.mark.parametrize("setting", SETTINGS, ids=lambda setting: setting.name)
def test_every_setting_has_a_value_and_alternatives_of_its_kind(setting: Setting):
    alternatives = setting.alternatives()
    assert alternatives
    for value in alternatives.values():
        assert value != setting.value
        assert isinstance(value, tuple) == isinstance(setting.value, tuple)
        if not setting.name.startswith("fairing."):
            assert changed_options(PRESETS["accurate"], {tuple(setting.name.split(".")): value}) != PRESETS["accurate"]


def test_halves_and_doubles_keep_whole_numbers_whole():
    assert scaled((12, 5, 1, 0), 0.5) == (6, 2, 1, 0)
    assert scaled((0.5, 2.0), 2.0) == (1.0, 4.0)


def test_a_constant_changes_where_it_was_imported_and_no_other_of_its_name_does():
    home, constant, least = (
        "fairing.options.FINE_BLUR",
        options.FINE_BLUR,
        axes.SCALE,
    )
    others = misfits.SCALE
    assert constant == phases.FINE_BLUR
    try:
        set_constant(home, 7.5)
        set_constant("fairing.terms.axes.SCALE", 5)
        assert options.FINE_BLUR == phases.FINE_BLUR == 7.5
        assert axes.SCALE == 5
        assert others == misfits.SCALE
    finally:
        set_constant(home, constant)
        set_constant("fairing.terms.axes.SCALE", least)


def test_the_table_shows_factors_of_the_committed_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    rows = {}
    for scene, error in (("a", 0.1), ("b", 0.4)):
        rows[f"{scene}  as committed"] = {
            "median": error,
            "rms": 2 * error,
            "surface rms": error,
            "samples": 100,
        }
        committed = rows[f"{scene}  as committed"]
        rows[f"{scene} step.prior off"] = {**committed, "median": 2 * error, "samples": 50}
        rows[f"{scene} step.prior halved"] = {**committed, "rms": error, "surface rms": 3 * error}
        rows[f"{scene} step.prior doubled"] = {"failed": "no"} if scene == "b" else rows[f"{scene} step.prior halved"]
    table = ablation_table([Setting("step.prior", off=0.0)], ["a", "b"], rows)
    assert "| `step.prior` | 0.1 | 2.00 / 1.00 / 1.00 / 0.50 | 1.00 / 0.50 / 3.00 / 1.00 | refused on 1 |" in table
    results = tmp_path / "ablation.json"
    results.write_text(json.dumps({key: {"code": code_digest(), **row} for key, row in rows.items()}))
    measure_ablation(["a", "b"], ["step.prior"], results)  # everything is known: nothing runs
    assert results.with_suffix(".md").read_text() in capsys.readouterr().out


def test_an_unknown_setting_is_refused_in_one_line(tmp_path: Path):
    with pytest.raises(InputError, match=r"--settings step\.prio: expected some of cells\.warp"):
        measure_ablation(["a"], ["step.prio"], tmp_path / "ablation.json")


def test_a_variant_runs_with_its_changed_option(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(ablation, "scene_with_truth", lambda name: corner_scene())
    committed = ablation.run_variant("corner", "", None)
    halved = ablation.run_variant("corner", "schedule.max_sweeps", (1,))
    assert 0 < halved["samples"] < committed["samples"]
    assert halved["rms"] != committed["rms"]

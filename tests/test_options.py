"""Options: levels changed by lists or single values, and the form with lists by group in old traces, reports and flags."""

import json
from dataclasses import replace
from typing import Any

import pytest

from app.cli.option_flags import flags_of, options_of
from app.debugger.option_fields import differing_fields
from fairing import PRESETS, FairingOptions, InputError, LevelOptions
from fairing.options import CellOptions, options_from_dict, options_to_dict

FORMER_ACCURATE = {
    "cells": {
        "size": [64, 64, 64, 64, 256],
        "spacing": [1.0],
        "inset": [0.0, 0.0, 0.0, 0.0, 2.0],
        "interpolation": ["bilinear", "bilinear", "bilinear", "bilinear", "cubic"],
        "point_spread": ["as_seen", "as_seen", "as_seen", "as_seen", "common"],
    },
    "eigenspace": {"dimensions": [3, 3, 1, 1, 2], "centered": False},
    "robust": {"sigma_rule": ["paper", "paper", "fixed", "fixed", "paper"]},
    "step": {"smoothing": [0.1, 0.1, 0.1, 0.1, 0.0], "points": [0.3], "creases": [0.0, 0.0, 0.0, 0.0, 1.0]},
    "schedule": {"blur": [6.0, 3.6, 2.0, 1.2, 0.5], "max_sweeps": [12, 5, 3, 3, 5], "max_iterations": [4, 4, 3]},
}
FORMER_PAPER = {
    "cells": {
        "warp": "affine",
        "size": [128],
        "adaptive": False,
        "inset": [0.0],
        "interpolation": ["bilinear"],
        "point_spread": ["as_seen"],
        "weighting": "cell",
    },
    "eigenspace": {"dimensions": [5]},
    "robust": {"sigma_rule": ["paper"]},
    "step": {"solver": "alternating", "prior": 0.0, "smoothing": [0.0], "points": [0.0], "creases": [0.0]},
    "schedule": {
        "blur": [6.0, 4.8, 3.6, 2.4, 1.2],
        "start": "first",
        "order": "sequential",
        "max_sweeps": [10],
        "max_iterations": [20],
    },
}


@pytest.mark.parametrize(("former", "preset"), [(FORMER_ACCURATE, "accurate"), (FORMER_PAPER, "paper")])
def test_lists_by_group_in_old_records_give_the_same_options(former: dict[str, Any], preset: str):
    assert options_from_dict(former) == PRESETS[preset]


def test_a_former_list_shorter_than_the_levels_holds_its_last_value_and_a_longer_one_is_cut():
    found = options_from_dict({"schedule": {"blur": [3.0, 2.0, 1.0]}, "cells": {"size": [32, 48]}})
    assert [(level.blur, level.size, level.max_sweeps) for level in found.levels] == [
        (3, 32, 12),
        (2, 48, 5),
        (1, 48, 3),
    ]


@pytest.mark.parametrize("preset", PRESETS)
def test_options_survive_being_written_and_being_flags(preset: str):
    options = replace(PRESETS[preset], locked_vertices=(1, 2), cells=CellOptions(color=True)).with_levels(
        blur=(2.0, 2.0)
    )
    assert options_from_dict(json.loads(json.dumps(options_to_dict(options)))) == options
    assert options_of(flags_of(options)) == options


def test_levels_take_single_values_and_lists():
    options = FairingOptions().with_levels(dimensions=1, size=(16, 32), smoothing=[0.0])
    assert [level.dimensions for level in options.levels] == [1] * 5
    assert [level.size for level in options.levels] == [16, 32, 32, 32, 32]
    assert [level.smoothing for level in options.levels] == [0.0] * 5
    assert [level.blur for level in options.levels] == [6.0, 3.6, 2.0, 1.2, 0.5]


def test_there_are_as_many_levels_as_blurs():
    default = FairingOptions()
    assert default.with_levels(blur=(6.0, 3.6)).levels == default.levels[:2]
    assert default.with_levels(blur=2.0).levels == (replace(default.levels[0], blur=2.0),)
    longer = default.with_levels(blur=(6.0, 3.6, 2.0, 1.2, 0.5, 0.25))
    assert longer.levels == (*default.levels, replace(default.levels[-1], blur=0.25))


def test_values_by_level_are_as_short_as_they_are_given():
    options = FairingOptions(levels=(LevelOptions(2.0), LevelOptions(2.0, size=32), LevelOptions(2.0, size=32)))
    assert options.by_level("blur") == (2.0, 2.0, 2.0)
    assert options.by_level("size") == (64, 32)
    assert options.by_level("dimensions") == (1,)
    assert FairingOptions().with_levels(**{name: options.by_level(name) for name in vars(options.levels[0])}) == options


def test_levels_that_were_removed_are_no_differences_of_other_options():
    before = FairingOptions()
    assert [f.name for f in differing_fields(before, before.with_levels(blur=(2.0, 1.0)))] == ["schedule.blur"]
    assert [f.name for f in differing_fields(before, before.with_levels(size=64))] == ["cells.size"]
    assert differing_fields(before, FairingOptions()) == []


def test_levels_without_values_and_unknown_fields_are_refused():
    with pytest.raises(InputError, match=r"option cells\.size: expected at least one value, found none"):
        FairingOptions().with_levels(size=())
    with pytest.raises(InputError, match=r"option schedule\.blur: expected at least one value, found none"):
        FairingOptions(levels=())
    with pytest.raises(InputError, match="unknown option of a level: order; known are blur, "):
        FairingOptions().with_levels(order="joint")

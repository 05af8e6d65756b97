"""Options as the page edits them: every field is found, explained, and read back as it was shown."""

import pytest

from app.debugger.option_fields import changed_options, option_fields
from fairing.errors import InputError
from fairing.options import PRESETS, FairingOptions, options_from_dict

FIELDS = {".".join(field.path): field for field in option_fields()}


def test_every_field_of_every_preset_survives_being_shown_and_read():
    for options in PRESETS.values():
        values = {field.path: field.read(field.shown(options)) for field in FIELDS.values()}
        assert changed_options(FairingOptions(), values) == options


def test_every_field_is_explained():
    unexplained = [name for name, field in FIELDS.items() if not field.meaning and "threads" not in name]
    assert unexplained == []


@pytest.mark.parametrize(
    ("name", "typed"),
    [
        ("cells.warp", "fisheye"),
        ("cells.color", "yes"),
        ("eigenspace.dimensions", "3, x"),
        ("eigenspace.dimensions", "2.5"),
        ("step.prior", float("nan")),
        ("step.prior", "1e400"),
        ("step.max_rejections", 1.5),
        ("robust.sigma_rule", "paper guess"),
        ("threads", {"a": 1}),
        ("threads", True),
    ],
)
def test_what_does_not_fit_is_refused_by_name(name: str, typed: object):
    with pytest.raises(InputError, match=f"option {name}"):
        FIELDS[name].read(typed)


def test_every_field_says_what_it_affects_and_when():
    for field in FIELDS.values():
        assert field.effect.startswith("Affects ")
        assert "Takes effect " in field.effect
    assert "only in a new run" in FIELDS["schedule.blur"].effect
    assert "next step" in FIELDS["eigenspace.dimensions"].effect
    assert "identical" in FIELDS["threads"].effect


@pytest.mark.parametrize("values", [{"cells": {"spacing": 0.7}}, {"threads": [1, 2]}, {"step": {"speed": 1}}])
def test_recorded_options_of_another_shape_are_refused_by_name(values):
    with pytest.raises(InputError, match=r"cells\.spacing|threads|speed"):
        options_from_dict(values)

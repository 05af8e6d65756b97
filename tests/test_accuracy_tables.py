"""The command that measures the tables of accuracy: what needs no run."""

import pytest

from tests.accuracy_tables import print_tables, reference_seconds, table
from tests.processors import ROOT


def test_a_table_is_markdown():
    assert table(["start", "end"], [["1 %", "0.5 %"]]) == "| start | end |\n| --- | --- |\n| 1 % | 0.5 % |"


def test_the_guide_names_the_command():
    guide = ROOT / "app" / "guides" / "accuracy.md"
    assert "python -m tests.benchmark --tables" in guide.read_text(encoding="utf-8")


def test_an_unknown_group_is_refused_before_anything_runs():
    with pytest.raises(SystemExit, match=r"expected some of cube, .*found tables"):
        print_tables(["tables"], 0)


def test_the_reference_takes_time():
    assert reference_seconds() > 0

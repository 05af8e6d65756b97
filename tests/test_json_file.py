"""Reports: readable, and the same values as before."""

import json

from app.files.json_file import MANY, write_json


def test_what_is_written_is_read_back_and_no_number_is_left_that_json_does_not_know(tmp_path):
    values = {
        "empty": {}, "none": [], "text": 'a "b"\n', "number": 1.5, "infinite": float("inf"), "point": (1.0, float("nan"), 3.0),
        "nested": {"rows": [{"a": [1, 2]}, {"b": float("nan")}]}, "many": [{"i": i, "x": [float("inf"), i]} for i in range(MANY)],
    }  # fmt: skip
    write_json(tmp_path / "report.json", values)
    text = (tmp_path / "report.json").read_text()
    found = json.loads(text, parse_constant=lambda name: f"{name} is no JSON")
    assert found == {
        **values, "infinite": None, "point": [1.0, None, 3.0], "nested": {"rows": [{"a": [1, 2]}, {"b": None}]},
        "many": [{"i": i, "x": [None, i]} for i in range(MANY)],
    }  # fmt: skip
    assert ' "point": [1.0, null, 3.0],' in text.splitlines()
    assert sum(line.startswith('  {"i"') for line in text.splitlines()) == MANY

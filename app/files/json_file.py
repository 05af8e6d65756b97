"""JSON report files."""

import json
from pathlib import Path
from typing import Any

from fairing.io import write_atomically

MANY = 200  # items from which on a list has one line per item


def write_json(path: Path, values: dict[str, Any]) -> None:
    """Write a JSON file, complete or not at all; numbers that are not finite become null."""
    text = _text(values, "")
    write_atomically(path, lambda file: file.write(text.encode()))


def _text(value: Any, indent: str) -> str:
    """JSON text with indentation; lists of plain values and the items of long lists have one line each.

    Full indentation is too slow for large reports (ledger: indentation of reports).
    """
    deeper = indent + " "
    if isinstance(value, dict) and value:
        lines = [f"{json.dumps(str(key))}: {_text(item, deeper)}" for key, item in value.items()]
        opening, closing = "{", "}"
    elif isinstance(value, list | tuple) and any(isinstance(item, dict | list | tuple) for item in value):
        lines = [_line(item) if len(value) >= MANY else _text(item, deeper) for item in value]
        opening, closing = "[", "]"
    else:
        return _line(value)
    return opening + "\n" + ",\n".join(deeper + line for line in lines) + "\n" + indent + closing


def _line(value: Any) -> str:
    try:
        return json.dumps(value, allow_nan=False)
    except ValueError:
        return json.dumps(_finite(value))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not abs(value) < float("inf") else value

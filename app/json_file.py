"""Reports as JSON files."""

import json
from pathlib import Path
from typing import Any

from fairing.io import write_atomically


def write_json(path: Path, values: dict[str, Any]) -> None:
    """Write a JSON file, complete or not at all; numbers that are not finite become null."""
    text = json.dumps(_finite(values), indent=1, allow_nan=False)
    write_atomically(path, lambda file: file.write(text.encode()))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not abs(value) < float("inf") else value

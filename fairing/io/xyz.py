"""XYZ point files: a point on each line, as text."""

import re
from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.capture import read_text

_COMMENTS = ("#", "//")
_DECIMAL_COMMAS = 6
"""A line of `x,y,z` with decimal commas has this many words between commas."""


def read_xyz(path: Path) -> np.ndarray:
    """Points (n, 3) float: the first three numbers of each line, separated by blanks, semicolons or commas.

    Lines that begin with # or // are comments. A first line with a single number declares how many points follow.

    Raises:
        InputError: no such file, not UTF-8, a line of another kind, numbers with decimal commas, or another number of points
            than declared.
    """
    lines = [
        (number, line.strip())
        for number, line in enumerate(read_text(path, "a scan").splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith(_COMMENTS)
    ]
    if lines and re.fullmatch(r"[0-9]{1,18}", lines[0][1]):
        declared = int(lines.pop(0)[1])
        if declared != len(lines):
            raise InputError(f"{path}: expected {declared} points as declared, found {len(lines)}; it is incomplete")
    has_decimal_points = any("." in line for _, line in lines)
    points = np.empty((len(lines), 3))
    for i, (number, line) in enumerate(lines):
        words = _words(line, has_decimal_points)
        if words is None:
            raise InputError(
                f"{path}: line {number}: expected numbers with decimal points, found commas that may be decimal commas "
                f"({line[:40]!r}); replace them by points"
            )
        try:
            x, y, z = (float(word) for word in words[:3])
            if "_" in "".join(words[:3]):
                raise ValueError("an underscore")
        except ValueError:
            raise InputError(f"{path}: line {number}: expected three numbers, found {line[:60]!r}") from None
        points[i] = x, y, z
    return points


def _words(line: str, has_decimal_points: bool) -> list[str] | None:
    """The words of a line; None where a comma may be a decimal comma."""
    if "," not in line:
        return line.replace(";", " ").split()
    if re.search(r"[;\s]", line) is None:
        words = line.split(",")
        return words if has_decimal_points or len(words) < _DECIMAL_COMMAS else None
    return None if re.search(r",[^\s,]", line) else line.replace(",", " ").split()

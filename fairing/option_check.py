"""Validation of option values before a run."""

from dataclasses import fields, is_dataclass
from typing import Any, Literal, get_args, get_origin, get_type_hints

from fairing.errors import InputError
from fairing.options import LEVEL_GROUPS, FairingOptions, LevelOptions

# name: (lower bound, whether the bound itself is allowed). Numbers that are not listed only have to be finite.
_LOWEST: dict[str, tuple[float, bool]] = {
    "cells.size": (4, True),
    "cells.spacing": (0, False),
    "cells.inset": (0, True),
    "eigenspace.dimensions": (1, True),
    "robust.sigma": (0, False),
    "robust.mad_factor": (0, False),
    "robust.sigma_floor": (0, False),
    "step.max_step": (0, False),
    "step.initial_damping": (0, False),
    "step.max_rejections": (0, True),
    "step.tolerance": (0, True),
    "step.prior": (0, True),
    "step.smoothing": (0, True),
    "step.points": (0, True),
    "step.creases": (0, True),
    "visibility.min_footprint": (0, True),
    "visibility.edge_margin": (0, True),
    "visibility.max_views": (3, True),
    "schedule.blur": (0, True),
    "schedule.max_sweeps": (1, True),
    "schedule.max_iterations": (1, True),
    "schedule.sweep_tolerance": (0, True),
    "threads": (0, True),
}
_BOXES = ("locked_boxes", "region")


def check_options(options: FairingOptions) -> None:
    """Check that all values are in their allowed ranges.

    Raises:
        InputError: with the name of the option, the expected and the given value.
    """
    _check(options, "")
    for level in options.levels:
        _check(level, "")


def _check(options: Any, prefix: str) -> None:
    hints = get_type_hints(type(options))
    for field in fields(options):
        group = LEVEL_GROUPS[field.name] + "." if isinstance(options, LevelOptions) else prefix
        name, value = group + field.name, getattr(options, field.name)
        if is_dataclass(value):
            _check(value, name + ".")
        if is_dataclass(value) or name == "levels":
            continue
        values = value if isinstance(value, tuple) else (value,)
        for item in values:
            _check_type(name, item, hints[field.name])
        if name in _BOXES:
            _check_boxes(name, values)
        for item in values:
            if isinstance(item, bool) or not isinstance(item, int | float):
                continue
            if not abs(item) < float("inf"):
                raise InputError(f"option {name}: expected a finite number, found {item}")
            low, inclusive = _LOWEST.get(name, (-float("inf"), True))
            if item < low or (item == low and not inclusive):
                raise InputError(
                    f"option {name}: expected {'at least' if inclusive else 'more than'} {low}, found {item}"
                )


def _check_type(name: str, item: Any, hint: Any) -> None:
    """Refuse a value that is not of the option's type; for a tuple, of its items' type."""
    if get_origin(hint) is tuple:
        hint = get_args(hint)[0]
    if get_origin(hint) is Literal:
        if item not in get_args(hint):
            raise InputError(f"option {name}: expected one of {', '.join(get_args(hint))}, found {item!r:.60}")
        return
    allowed = (int, float) if hint is float else (hint,)
    if not isinstance(item, allowed) or (isinstance(item, bool) and hint is not bool):
        raise InputError(f"option {name}: expected a value of type {hint.__name__}, found {item!r:.60}")


def _check_boxes(name: str, values: tuple[float, ...]) -> None:
    if len(values) % 6 or (name == "region" and len(values) > 6):
        raise InputError(f"option {name}: expected x0 y0 z0 x1 y1 z1, found {len(values)} numbers")
    for i in range(0, len(values), 6):
        if any(low > high for low, high in zip(values[i : i + 3], values[i + 3 : i + 6], strict=True)):
            found = " ".join(f"{value:g}" for value in values[i : i + 6])
            raise InputError(f"option {name}: expected x0 <= x1, y0 <= y1, z0 <= z1, found {found}")

"""Option fields: the options as a flat list with type, meaning and effect, and the parser of typed values."""

import ast
import inspect
import typing
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from typing import Any, Literal

from fairing.errors import InputError
from fairing.options import FairingOptions

NOT_COMPARABLE = "energies of sweeps before and after the change do not compare, residuals at the finest level do"
NEXT_STEP = "from the next step on"
# By group: what its options affect, and from when on if they are applied at the present moment.
GROUP_EFFECTS: dict[str, tuple[str, str]] = {
    "cells": (f"how cells are read from the photos; {NOT_COMPARABLE}", NEXT_STEP),
    "eigenspace": (f"which part of the cells the eigenspace explains; {NOT_COMPARABLE}", NEXT_STEP),
    "robust": (f"the weight of large residuals; {NOT_COMPARABLE}", NEXT_STEP),
    "step": ("the size and acceptance of steps; the energy is measured as before", NEXT_STEP),
    "visibility": (f"which photos and samples are used; {NOT_COMPARABLE}", NEXT_STEP),
    "schedule": ("levels, sweeps and their order", "only in a new run"),
    "general": ("which vertices may move", NEXT_STEP),
}
SPEED_ONLY = ("the speed only; the result stays identical", NEXT_STEP)


@dataclass(frozen=True)
class OptionField:
    """One option.

    Attributes:
        path: names from the top, such as ("cells", "warp").
        meaning: the documentation string of the field.
        kind: "choice", "switch", "whole", "number" or "list".
        choices: valid values of a choice, or of the items of a list; empty: numbers.
        whole: whether the numbers of a list are whole.
    """

    path: tuple[str, ...]
    meaning: str
    kind: Literal["choice", "switch", "whole", "number", "list"]
    choices: tuple[str, ...] = ()
    whole: bool = False

    @property
    def label(self) -> str:
        return self.path[-1].replace("_", " ")

    @property
    def group(self) -> str:
        """The group of options it belongs to."""
        return self.path[0] if len(self.path) > 1 else "general"

    @property
    def effect(self) -> str:
        """What it affects and when, in two sentences."""
        what, when = SPEED_ONLY if self.path == ("threads",) else GROUP_EFFECTS[self.group]
        return f"Affects {what}. Takes effect {when}."

    def of(self, options: FairingOptions) -> Any:
        """The value of this field."""
        value: Any = options
        for name in self.path:
            value = getattr(value, name)
        return value

    def shown(self, options: FairingOptions) -> Any:
        """The value for a widget: a list as text."""
        value = self.of(options)
        return ", ".join(_plain(part) for part in value) if self.kind == "list" else value

    def read(self, typed: object) -> Any:
        """Parse a value sent by a browser.

        Raises:
            InputError: it is not valid for this field.
        """
        name = ".".join(self.path)
        if self.kind == "switch":
            if not isinstance(typed, bool):
                raise InputError(f"option {name}: expected on or off, found {typed!r}")
            return typed
        if self.kind == "choice":
            return self._choice(name, str(typed))
        if self.kind == "list":
            parts = str(typed)[:400].replace(",", " ").split()
            return tuple(self._choice(name, p) if self.choices else _number(name, p, self.whole) for p in parts)
        return _number(name, typed, self.kind == "whole")

    def _choice(self, name: str, typed: str) -> str:
        if typed not in self.choices:
            raise InputError(f"option {name}: expected one of {', '.join(self.choices)}, found {typed}")
        return typed


def option_fields(kind: type = FairingOptions, above: tuple[str, ...] = ()) -> list[OptionField]:
    """All fields of the options; groups follow the fields of their owner."""
    hints, meanings = typing.get_type_hints(kind), field_meanings(kind)
    own, nested = [], []
    for field in fields(kind):
        hint, path = hints[field.name], (*above, field.name)
        if is_dataclass(hint) and isinstance(hint, type):
            nested += option_fields(hint, path)
        else:
            own.append(_field(path, hint, meanings.get(field.name, "")))
    return own + nested


def changed_options(options: FairingOptions, values: dict[tuple[str, ...], Any]) -> FairingOptions:
    """The options with the fields at these paths replaced."""
    return _changed(options, values, ())


@cache
def field_meanings(kind: type) -> dict[str, str]:
    """The documentation string under each field of a dataclass, by field name."""
    body = ast.parse(inspect.getsource(kind).lstrip()).body[0]
    assert isinstance(body, ast.ClassDef)
    meanings = {}
    for statement, following in zip(body.body, body.body[1:], strict=False):
        if (
            isinstance(statement, ast.AnnAssign)
            and isinstance(statement.target, ast.Name)
            and isinstance(following, ast.Expr)
            and isinstance(following.value, ast.Constant)
        ):
            meanings[statement.target.id] = " ".join(str(following.value.value).split())
    return meanings


def _field(path: tuple[str, ...], hint: Any, meaning: str) -> OptionField:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is Literal:
        return OptionField(path, meaning, "choice", tuple(map(str, arguments)))
    if origin is tuple:
        part = arguments[0]
        if typing.get_origin(part) is Literal:
            return OptionField(path, meaning, "list", tuple(map(str, typing.get_args(part))))
        return OptionField(path, meaning, "list", whole=part is int)
    if hint is bool:
        return OptionField(path, meaning, "switch")
    return OptionField(path, meaning, "whole" if hint is int else "number")


def _changed(options: Any, values: dict[tuple[str, ...], Any], above: tuple[str, ...]) -> Any:
    changes = {}
    for field in fields(options):
        path, current = (*above, field.name), getattr(options, field.name)
        if is_dataclass(current):
            changes[field.name] = _changed(current, values, path)
        elif path in values:
            changes[field.name] = values[path]
    return replace(options, **changes)


def _plain(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _number(name: str, typed: object, whole: bool) -> int | float:
    try:
        value = float(typed) if isinstance(typed, int | float | str) and not isinstance(typed, bool) else float("nan")
    except ValueError:
        value = float("nan")
    if not abs(value) < float("inf") or (whole and value != int(value)):
        raise InputError(f"option {name}: expected a {'whole ' if whole else ''}number, found {typed!r:.40}")
    return int(value) if whole else value

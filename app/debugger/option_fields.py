"""Option fields: the options as a flat list with type, meaning and effect, and the parser of typed values."""

import ast
import inspect
import sys
import typing
from dataclasses import dataclass, is_dataclass
from functools import cache
from itertools import pairwise
from typing import Any, Literal

from fairing.errors import InputError
from fairing.options import LEVEL_GROUPS, FairingOptions, LevelOptions, options_from_dict

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
Kind = Literal["choice", "switch", "whole", "number", "list"]
SPEED_ONLY = ("the speed only; the result stays identical", NEXT_STEP)


@dataclass(frozen=True)
class OptionField:
    """One option.

    Attributes:
        path: group, if it belongs to one, and name, such as ("cells", "warp").
        hint: type of its value; of an option by level a tuple.
        meaning: the documentation string of the field.
        kind: "choice", "switch", "whole", "number" or "list".
        choices: valid values of a choice, or of the items of a list; empty: numbers.
        whole: whether the numbers of a list are whole.
    """

    path: tuple[str, ...]
    hint: Any
    meaning: str
    kind: Kind
    choices: tuple[str, ...] = ()
    whole: bool = False

    @property
    def name(self) -> str:
        return ".".join(self.path)

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
        """The value of this field; by level see `FairingOptions.by_level`."""
        if LEVEL_GROUPS.get(self.path[-1]) == self.group:
            return options.by_level(self.path[-1])
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
        name = self.name
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


@cache
def option_fields() -> tuple[OptionField, ...]:
    """All options: those without a group, then group by group, in each those by level first."""
    own, grouped = [], []
    for name, hint, meaning in _explained(FairingOptions):
        if is_dataclass(hint):
            grouped += [
                _field((name, part), tuple[kind, ...], f"{about} One value per level.")
                for part, kind, about in _explained(LevelOptions)
                if LEVEL_GROUPS[part] == name
            ]
            grouped += [_field((name, part), kind, about) for part, kind, about in _explained(hint)]
        elif name != "levels":
            own.append(_field((name,), hint, meaning))
    return (*own, *grouped)


def changed_options(options: FairingOptions, values: dict[tuple[str, ...], Any]) -> FairingOptions:
    """The options with the fields at these paths replaced; those by level as by `FairingOptions.with_levels`."""
    nested: dict[str, Any] = {path[0]: {} for path in values if len(path) > 1}
    for (*group, name), value in values.items():
        (nested[group[0]] if group else nested)[name] = value
    return options_from_dict(nested, options)


def differing_fields(before: FairingOptions, after: FairingOptions) -> list[OptionField]:
    """The fields that differ; levels that were added or removed make a difference of the blur alone."""
    same_blurs = before.with_levels(blur=after.by_level("blur"))
    return [f for f in option_fields() if f.of(before if f.name == "schedule.blur" else same_blurs) != f.of(after)]


@cache
def field_meanings(kind: type) -> dict[str, str]:
    """The documentation string under each field of a dataclass, by field name."""
    body = _classes(kind.__module__)[kind.__name__].body
    meanings = {}
    for statement, following in pairwise(body):
        if (
            isinstance(statement, ast.AnnAssign)
            and isinstance(statement.target, ast.Name)
            and isinstance(following, ast.Expr)
            and isinstance(following.value, ast.Constant)
        ):
            meanings[statement.target.id] = " ".join(str(following.value.value).split())
    return meanings


@cache
def _classes(module: str) -> dict[str, ast.ClassDef]:
    """The classes of a module, parsed once for all of them."""
    statements = ast.parse(inspect.getsource(sys.modules[module])).body
    return {statement.name: statement for statement in statements if isinstance(statement, ast.ClassDef)}


def _explained(kind: Any) -> list[tuple[str, Any, str]]:
    """Name, type and documentation string of the fields of a dataclass."""
    meanings = field_meanings(kind)
    return [(name, hint, meanings.get(name, "")) for name, hint in typing.get_type_hints(kind).items()]


def _field(path: tuple[str, ...], hint: Any, meaning: str) -> OptionField:
    is_list = typing.get_origin(hint) is tuple
    item = typing.get_args(hint)[0] if is_list else hint
    choices = tuple(map(str, typing.get_args(item))) if typing.get_origin(item) is Literal else ()
    of_type: dict[type, Kind] = {bool: "switch", int: "whole", float: "number"}
    kind = "list" if is_list else "choice" if choices else of_type[item]
    return OptionField(path, hint, meaning, kind, choices, whole=item is int)


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

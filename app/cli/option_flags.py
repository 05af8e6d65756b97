"""Command line flags of the options: one for each, named by its group; options by level take lists."""

from dataclasses import asdict, field, make_dataclass
from typing import Annotated, Any, get_type_hints

import tyro

from app.debugger.option_fields import option_fields
from fairing.options import FairingOptions, options_from_dict


def flags_of(default: FairingOptions) -> Any:
    """The flags and their defaults: an instance of a dataclass, with another one for each group, for `tyro`."""
    members: dict[str, list[tuple[str, Any, Any]]] = {}
    for option in option_fields():
        hint = Annotated[option.hint, tyro.conf.arg(help=option.meaning or None)]
        members.setdefault(option.group, []).append((option.path[-1], hint, field(default=option.of(default))))
    hints = get_type_hints(FairingOptions)
    top = members.pop("general")
    for name, options in members.items():
        group = make_dataclass(name, options, frozen=True, namespace={"__doc__": hints[name].__doc__})
        top.append((name, group, field(default=group())))
    return make_dataclass("Options", top, frozen=True)()


def options_of(flags: Any) -> FairingOptions:
    """The options that flags, as `flags_of` made them, were set to.

    Raises:
        InputError: a list is empty.
    """
    return options_from_dict(asdict(flags))

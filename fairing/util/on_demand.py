"""Packages whose rooms are opened when somebody enters them.

The whole engine takes a second to import. What needs one room of it, as the command line needs the options, does not
wait for the others.
"""

import importlib
from collections.abc import Callable
from typing import Any


def on_demand(package: str, rooms: dict[str, str]) -> Callable[[str], Any]:
    """The `__getattr__` of a package (PEP 562).

    Args:
        rooms: the module of every name that the package offers.
    """

    def enter(name: str) -> Any:
        if name not in rooms:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(importlib.import_module(rooms[name]), name)

    return enter

"""Lazy imports: submodules of a package are imported on first use.

Importing the whole engine takes a second. Code that needs one part of it, such as the command line, which needs the options,
does not wait for the others.
"""

import importlib
from collections.abc import Callable
from typing import Any


def on_demand(package: str, modules: dict[str, str]) -> Callable[[str], Any]:
    """The `__getattr__` of a package (PEP 562) that imports names from submodules on first use.

    Args:
        package: name of the package.
        modules: the module of every public name of the package.
    """

    def import_name(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(importlib.import_module(modules[name]), name)

    return import_name

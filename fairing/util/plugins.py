"""Plugins: what other installed packages offer, by entry points (Python's `importlib.metadata`)."""

from functools import cache
from importlib.metadata import entry_points
from typing import Any

from fairing.errors import InputError


@cache
def offered(group: str) -> dict[str, Any]:
    """The objects of all entry points of a group by their names, in the order of the names.

    Raises:
        InputError: a package offers something that cannot be imported, or two offer the same name.
    """
    found: dict[str, Any] = {}
    for entry in sorted(entry_points(group=group), key=lambda entry: entry.name):
        package = entry.value if entry.dist is None else entry.dist.name
        if entry.name in found:
            raise InputError(
                f"package {package}: offers {entry.name} of {group}, as another one does; uninstall one of them"
            )
        try:
            found[entry.name] = entry.load()
        except Exception as error:
            raise InputError(
                f"package {package}: {entry.name} of {group} cannot be loaded ({type(error).__name__}: {error}); "
                "mend or uninstall it"
            ) from error
    return found

"""A norm of one's own in the header of a trace: its values, so that the run continues and is shown without its code."""

from dataclasses import replace
from typing import Any

from fairing.errors import InputError
from fairing.norms.built_in import OWN
from fairing.norms.norm import Tabulated
from fairing.options import FairingOptions
from fairing.trace import Trace


def header_of_norm(norm: Tabulated | None) -> dict[str, Any]:
    """The entry of a header, see `Tabulated.facts`; none without a norm of one's own."""
    return {} if norm is None else {"own_norm": norm.facts}


def options_with_norm(options: FairingOptions) -> FairingOptions:
    """Options that name the norm of one's own."""
    return replace(options, robust=replace(options.robust, norm=OWN))


def recorded_norm(trace: Trace, given: Tabulated | None) -> Tabulated | None:
    """The norm of one's own that a run was recorded with; None without one.

    Args:
        given: a norm that the user asks for.

    Raises:
        InputError: the recorded one makes no sense, or another one is given.
    """
    recorded = Tabulated.of_facts(trace.header["own_norm"]) if "own_norm" in trace.header else None
    if given is not None and (recorded is None or recorded.digest != given.digest):
        name = "a norm of the options" if recorded is None else f"the own norm {recorded.name} ({recorded.file})"
        raise InputError(
            f"trace: recorded with {name}, found {given.name} ({given.file}) or other code; leave it out, or branch"
        )
    return recorded

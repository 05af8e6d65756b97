"""Overload memory: numba remembers which overload of a function fits which types, for the life of a process.

numba tries the overloads of a function, of `+` or an index more than ten, at every call that it compiles. Of 6,200 calls in
a step of the engine, 5,400 repeat an earlier one (ledger: compilation with remembered overloads).
"""

import contextlib
from typing import Any


def remember_overloads() -> None:
    """Make numba remember overloads from now on; what it compiles is the same.

    This relies on internals of numba: a version without them compiles as before.
    """
    with contextlib.suppress(ImportError, AttributeError):
        from numba.core.targetconfig import ConfigStack
        from numba.core.types.functions import BaseFunction

        BaseFunction.get_call_type = _remembering(BaseFunction.get_call_type, ConfigStack.top_or_none)


def _remembering(resolve: Any, flags_of_caller: Any) -> Any:
    """`BaseFunction.get_call_type`, which returns the signature of a call, with a memory."""
    known: dict[Any, tuple[Any, Any]] = {}

    def get_call_type(function: Any, context: Any, args: Any, kws: Any) -> Any:
        if not hasattr(function, "_impl_keys"):
            return resolve(function, context, args, kws)
        # An overload is compiled with the flags of the function that calls it, fast arithmetic among them.
        flags = flags_of_caller()
        call = function, context, tuple(args), tuple(kws.items()), flags and flags.summary()
        if call in known:
            signature, implementation = known[call]
            function._impl_keys[signature.args] = implementation
            return signature
        signature = resolve(function, context, args, kws)
        if signature is not None:
            known[call] = signature, function._impl_keys[signature.args]
        return signature

    return get_call_type

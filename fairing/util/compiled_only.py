"""Options of compiled functions that only compiled functions call."""

from typing import Any

COMPILED_ONLY: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Beside a function, numba compiles one that calls it from Python and one that calls it from C; these leave both out, which
saves a sixth of the time until a step is compiled. Called from Python, such a function ends the process."""

"""Overloads that numba remembers: the same code from less work."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numba import njit
from numba.core import targetconfig
from numba.core.types.functions import BaseFunction

from app.debugger.overload_memory import remember_overloads


def _sums(x: np.ndarray, y: float) -> float:
    total = 0.0
    for k in range(len(x)):
        total += max(x[k] * x[k], y) + min(x[k], 2.0) / (y + 1.0)
    return total


def _assembly(fastmath: bool) -> str:
    """The instructions of `_sums`, compiled anew, without the names that numba counts or makes of addresses."""
    compiled: Any = njit(fastmath=fastmath)(_sums)
    compiled(np.ones(3), 2.0)
    (text,) = compiled.inspect_asm().values()
    lines = [line for line in text.splitlines() if re.match(r"\s+[a-z]", line)]
    return re.sub(r'\S*_ZN\S*|\.const\.[^",]*', "name", "\n".join(lines))


@pytest.fixture
def resolved(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The functions whose overloads numba has tried."""
    functions: list[Any] = []
    resolve: Callable[..., Any] = BaseFunction.get_call_type

    def count(function: Any, *call: Any) -> Any:
        functions.append(function)
        return resolve(function, *call)

    monkeypatch.setattr(BaseFunction, "get_call_type", count)
    return functions


def test_compiled_code_is_the_same_with_either_arithmetic(resolved: list[Any]):
    expected = _assembly(False), _assembly(True)
    assert expected[0] != expected[1]
    remember_overloads()
    assert (_assembly(False), _assembly(True)) == expected
    assert (_assembly(True), _assembly(False)) == expected[::-1]


def test_calls_that_repeat_are_not_resolved_again(resolved: list[Any]):
    remember_overloads()
    _assembly(False)
    first = len(resolved)
    assert first > 5
    _assembly(False)
    assert len(resolved) == first


def test_a_numba_without_these_internals_compiles_as_before(monkeypatch: pytest.MonkeyPatch):
    resolve = BaseFunction.get_call_type
    monkeypatch.delattr(targetconfig, "ConfigStack")
    remember_overloads()
    assert BaseFunction.get_call_type is resolve

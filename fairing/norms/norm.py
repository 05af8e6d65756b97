"""Robust norms: three functions of the residual in units of the scale sigma, which the kernels read from tables.

```python
class Tukey(fairing.Norm):
    "Tukey's biweight: residuals beyond 3 sigma have no influence."

    name = "tukey"

    def rho(self, x):
        return 3 * (1 - (1 - np.minimum(x / 3, 1) ** 2) ** 3)

    def weight(self, x):
        return 2 * (1 - np.minimum(x / 3, 1) ** 2) ** 2
```
"""

import base64
import hashlib
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from scipy.optimize import minimize_scalar

from fairing.errors import InputError
from fairing.kernels.data import NormLoop

INTERVALS = 4096
"""Of a table, uniform in 1 / (1 + x). Interpolation errs by some (1 + x)^2 / INTERVALS^2 of the value: 1e-7 at x = 1, 1e-5 at
x = 10. (ledger: norm of one's own: table)"""
NEAREST, FARTHEST = 1e-4, 1e6
"""Where the functions are evaluated instead of at 0 and at infinity."""
STEP = 1e-4
"""Of the differences that give the weight of a norm without one, relative to max(1, x)."""


class Norm:
    """A robust norm: a subclass gives it a name and `rho`; the first line of its docstring says what it does.

    All functions take x = |e| / sigma, (r,) float, at least 0, and return (r,) float.

    Attributes:
        name: a word, as shown.
        outlier_threshold: x beyond which a residual loses influence, infinite if never; None: found from `weight`.
        kernel: the compiled loop; those of one's own read a table.
    """

    name: str = ""
    outlier_threshold: float | None = None
    kernel: ClassVar[NormLoop] = NormLoop.TABLE

    def rho(self, x: np.ndarray) -> np.ndarray:
        """The loss: 0 at 0, nowhere falling; like x^2 near 0, as the strengths of the other terms assume."""
        raise NotImplementedError

    def weight(self, x: np.ndarray) -> np.ndarray:
        """rho'(x) / x, at least 0; by default from differences of `rho`."""
        step = STEP * np.maximum(1, x)
        return (self.rho(x + step) - self.rho(np.abs(x - step))) / (2 * step * x)

    def squared_scale(self, sigma: np.ndarray) -> np.ndarray:
        """The square of what divides residuals, grey levels^2, from sigma (m,) float, grey levels."""
        return sigma**2

    @property
    def meaning(self) -> str:
        """What it does, in a line."""
        return (type(self).__doc__ or "a norm of one's own").strip().splitlines()[0]


@dataclass(frozen=True, eq=False)
class Tabulated:
    """A norm as a run uses and records it.

    Attributes:
        name, meaning: see `Norm`.
        file: with its code; empty where it was typed, as in a notebook.
        outlier_threshold: x beyond which a residual loses influence; infinite if never.
        table: (2, INTERVALS + 1) float32: rho(x) / x^2 and rho'(x) / x at 1 / (1 + x) = 0, 1 / INTERVALS ... 1.
        kernel: the compiled loop.
        squared_scale: see `Norm`.
    """

    name: str
    meaning: str
    file: str
    outlier_threshold: float
    table: np.ndarray
    kernel: NormLoop = NormLoop.TABLE
    squared_scale: Callable[[np.ndarray], np.ndarray] = field(default=np.square)

    def rho(self, x: np.ndarray) -> np.ndarray:
        """The loss at x = |e| / scale, float of any shape, as the kernels interpolate it."""
        return self._at(x, self.table[0]) * np.asarray(x, dtype=float) ** 2

    def weight(self, x: np.ndarray) -> np.ndarray:
        """rho'(x) / x at x = |e| / scale, float of any shape, as the kernels interpolate it."""
        return self._at(x, self.table[1])

    @cached_property
    def digest(self) -> str:
        """Changes with the values of its functions."""
        return hashlib.blake2b(self.table.tobytes() + repr(self.outlier_threshold).encode(), digest_size=16).hexdigest()

    @cached_property
    def facts(self) -> dict[str, Any]:
        """For the header of a trace: all that continues the run, without the code."""
        return {
            "name": self.name,
            "meaning": self.meaning,
            "file": self.file,
            "outlier_threshold": self.outlier_threshold if np.isfinite(self.outlier_threshold) else None,
            "table": base64.b64encode(self.table.astype("<f4").tobytes()).decode(),
        }

    @classmethod
    def of_facts(cls, facts: Any) -> "Tabulated":
        """The inverse of `facts`.

        Raises:
            InputError: the facts are none that `facts` returns.
        """
        try:
            names = facts["name"], facts["meaning"], facts["file"]
            threshold = np.inf if facts["outlier_threshold"] is None else float(facts["outlier_threshold"])
            table = np.frombuffer(base64.b64decode(facts["table"], validate=True), dtype="<f4").reshape(2, -1)
            is_sound = all(isinstance(name, str) for name in names) and threshold > 0
            if not is_sound or table.shape[1] != INTERVALS + 1 or not (np.isfinite(table) & (table >= 0)).all():
                raise ValueError
        except (KeyError, TypeError, ValueError):
            raise InputError(
                f"header: expected own_norm with a name, a threshold and a table of 2 x {INTERVALS + 1} values of at least 0; "
                "record the run again"
            ) from None
        return cls(*names, threshold, table.astype(np.float32))

    def _at(self, x: np.ndarray, values: np.ndarray) -> np.ndarray:
        return np.interp(1 / (1 + np.abs(np.asarray(x, dtype=float))), np.linspace(0, 1, INTERVALS + 1), values)


def tabulated(norm: Norm) -> Tabulated:
    """A norm as a run uses it.

    Raises:
        InputError: its code raised an exception, or did not return what `Norm` asks for.
    """
    if isinstance(norm, type) and issubclass(norm, Norm):
        raise InputError(f"norm: expected an instance, found the class {norm.__name__}; write norm={norm.__name__}()")
    if not isinstance(norm, Norm):
        raise InputError(f"norm: expected an instance of fairing.Norm, found {type(norm).__name__}")
    kind, file = type(norm).__name__, getattr(sys.modules.get(type(norm).__module__), "__file__", None) or ""
    if not isinstance(norm.name, str) or not norm.name.isidentifier():
        raise InputError(f"norm {kind}: expected a name such as 'tukey', found {norm.name!r:.60}")
    v = np.linspace(0, 1, INTERVALS + 1)
    x = np.clip((1 - v) / np.maximum(v, 1e-300), NEAREST, FARTHEST)

    def values(what: str, function: Callable[[np.ndarray], np.ndarray], at: np.ndarray) -> np.ndarray:
        try:
            with np.errstate(all="ignore"):
                found = np.asarray(function(at.copy()), dtype=float)
        except NotImplementedError:
            raise InputError(f"norm {norm.name}: expected a method {what}(self, x), found none") from None
        except Exception as error:
            frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
            place = f" ({Path(file).name}, line {frames[-1].lineno})" if frames else ""
            raise InputError(f"norm {norm.name}: {what} raised {type(error).__name__}: {error}{place}") from error
        if found.shape != at.shape:
            raise InputError(
                f"norm {norm.name}: expected {what} to return an array of the shape of x, {at.shape}, found {found.shape}"
            )
        wrong = ~(found >= -1e-12) | ~np.isfinite(found)
        if wrong.any():
            k = int(np.argmax(wrong))
            raise InputError(
                f"norm {norm.name}: expected {what}(x) finite and at least 0 for x from 0 to {FARTHEST:.0e}, "
                f"found {found[k]:.6g} at x = {at[k]:.6g}"
            )
        return np.maximum(found, 0)

    at_zero = values("rho", norm.rho, np.zeros(1))[0]
    if at_zero > 1e-12:
        raise InputError(f"norm {norm.name}: expected rho(0) = 0, found {at_zero:.6g}")
    rho, weight = values("rho", norm.rho, x), values("weight", norm.weight, x)
    table = np.stack([rho / x**2, weight]).astype(np.float32)
    threshold = _threshold(norm, x, weight) if norm.outlier_threshold is None else norm.outlier_threshold
    if not isinstance(threshold, int | float) or not threshold > 0:
        raise InputError(f"norm {norm.name}: expected an outlier_threshold above 0, found {threshold!r:.60}")
    return Tabulated(norm.name, norm.meaning, file, float(threshold), table, norm.kernel, norm.squared_scale)


def _threshold(norm: Norm, x: np.ndarray, weight: np.ndarray) -> float:
    """Where the influence x * weight is largest; infinite if it does not fall by 1 % beyond."""
    influence = x * weight
    best = int(np.argmax(influence))  # x falls with the index
    if influence[:best].min(initial=np.inf) > 0.99 * influence[best]:
        return float("inf")
    bounds = (x[min(best + 1, len(x) - 1)], x[best - 1])
    found = minimize_scalar(lambda at: -at * norm.weight(np.array([at]))[0], bounds=bounds, options={"xatol": 1e-9})
    return float(found.x)

"""Terms of one's own: residuals written in Python, which pull at the vertices in every sweep of the photos like the built-in terms.

```python
class Planarity(fairing.OwnTerm):
    "Neighbouring faces that do not lie in one plane."

    name = "planarity"
    strength = 0.1

    def begin(self, scene, vertices):
        pairs = ...  # (r, 4) int: the vertices of two faces that share an edge

        def residual(vertices):
            a, b, c, d = vertices[pairs].transpose(1, 0, 2)
            normal = np.cross(b - a, c - a)
            return ((d - a) * normal).sum(axis=1) / np.linalg.norm(normal, axis=1)

        return fairing.Residuals(pairs, residual)
```
"""

import hashlib
import inspect
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from fairing.errors import Cancelled, InputError
from fairing.geometry.independent_sets import independent_sets
from fairing.optimize.loss import LeastSquares, Loss
from fairing.optimize.rows import Linearised, Rows, SumOfRows
from fairing.scene import Scene
from fairing.terms.closest_points import average_information
from fairing.terms.names import TERMS


@dataclass(frozen=True, eq=False)
class Residuals:
    """What a term of one's own minimises during a sweep.

    Attributes:
        ids: (r, c) int: the vertices that each residual depends on.
        residual: from vertices (n, 3) float, world units, to (r,) float.
        loss: of the residuals, in their unit.
    """

    ids: np.ndarray
    residual: Callable[[np.ndarray], np.ndarray]
    loss: Loss = field(default_factory=LeastSquares)


class OwnTerm:
    """A term of one's own: a subclass gives it a name and `begin`; the first line of its docstring says what adds to its energy.

    Attributes:
        name: a word or two, as in tables and conditions.
        strength: 1: at an average vertex it determines as much as the photos do.
        file: with the code of the subclass; empty where it was typed, as in a notebook.
    """

    name: str = ""
    strength: float = 0.3
    file: str = ""
    _code: bytes = b""

    def __init_subclass__(cls) -> None:
        """Keep the code as it is now: a file may change while a run uses it."""
        super().__init_subclass__()
        cls.file = getattr(sys.modules.get(cls.__module__), "__file__", None) or ""
        with suppress(OSError, TypeError):
            cls._code = Path(cls.file).read_bytes() if cls.file else inspect.getsource(cls).encode()

    def begin(self, scene: Scene, vertices: np.ndarray) -> Residuals:
        """The residuals of a sweep that begins with vertices (n, 3) float, world units.

        What they are measured against, such as neighbours or closest points, is found here and stays for the sweep.
        """
        raise NotImplementedError

    @property
    def meaning(self) -> str:
        """What adds to its energy."""
        return (type(self).__doc__ or "a term of one's own").strip().splitlines()[0]

    @property
    def digest(self) -> str:
        """Changes with its code and strength."""
        return hashlib.blake2b(self._code + repr(self.strength).encode(), digest_size=16).hexdigest()


@dataclass(frozen=True, eq=False)
class OwnRows(SumOfRows):
    """sum_r information rho(residual_r) with residuals of one's own, see `fairing.optimize.rows.Term`.

    Attributes:
        ids, residual: see `Residuals`; its mistakes are raised as InputError.
        step: world units: half of that of the central differences.
        sets: of vertices of which no residual depends on two.
    """

    name: str
    ids: np.ndarray
    residual: Callable[[np.ndarray], np.ndarray]
    loss: Loss
    information: float
    step: float
    sets: list[np.ndarray] = field(repr=False)

    def rows_at(self, vertices: np.ndarray) -> Rows:
        """The residuals as rows that are linear around vertices (n, 3) float, world units."""
        residuals, derivatives = self.residual(vertices), np.zeros((*self.ids.shape, 3))
        for members in self.sets:
            row, corner = np.nonzero(np.isin(self.ids, members))
            for axis in range(3):
                there, back = vertices.copy(), vertices.copy()
                there[members, axis] += self.step
                back[members, axis] -= self.step
                change = (self.residual(there) - self.residual(back)) / (2 * self.step)
                derivatives[row, corner, axis] = change[row]
        information = np.full(len(residuals), self.information)
        return Rows(self.name, self.ids, derivatives, residuals, vertices, information, self.loss)

    def linearise(self, vertices: np.ndarray) -> Linearised:
        return self.rows_at(vertices).linearise(vertices)

    def hessians(self, vertices: np.ndarray) -> np.ndarray:
        return self.rows_at(vertices).hessians(vertices)

    def around(self, ids: np.ndarray) -> "OwnRows":
        near, residual = np.isin(self.ids, ids).any(axis=1), self.residual
        return replace(self, ids=self.ids[near], residual=lambda vertices: residual(vertices)[near])

    def energies(self, vertices: np.ndarray) -> np.ndarray:
        return self.information * self.loss.value(self.residual(vertices))


def begun(term: OwnTerm, scene: Scene, vertices: np.ndarray, free: np.ndarray, typical: float) -> OwnRows | None:
    """A term of one's own in a sweep that begins with vertices (n, 3) float, world units; None if it determines nothing.

    Args:
        free: (n,) bool: vertices that may move.
        typical: information of the photos at an average vertex, energy / world unit^2.

    Raises:
        InputError: the term's code raised an exception, or did not return what `Residuals` and `OwnTerm` ask for.
    """
    found = _called(term, "begin", lambda: term.begin(scene, vertices))
    ids = _ids(term, found, len(vertices))

    def residual(places: np.ndarray) -> np.ndarray:
        values = np.asarray(_called(term, "residual", lambda: found.residual(places)), dtype=float)
        if values.shape != (len(ids),) or not np.isfinite(values).all():
            what = f"shape {values.shape}" if values.shape != (len(ids),) else "values that are not finite"
            raise InputError(
                f"term {term.name}: expected {len(ids)} finite residuals, one for each row of ids, found {what}"
            )
        return values

    sets = independent_sets(ids, np.unique(ids), len(vertices))
    rows = OwnRows(term.name, ids, residual, found.loss, 1.0, 1e-6 * scene.mesh.diagonal, sets)
    average = average_information(rows, vertices, free)
    if average == 0 or term.strength == 0:
        return None
    return replace(rows, information=term.strength * typical / average)


def check_terms(terms: Sequence[OwnTerm]) -> None:
    """Refuse terms that cannot be told apart from each other or from the built-in ones, or are none.

    Raises:
        InputError: with what is wrong.
    """
    names = list(TERMS)
    for term in terms:
        kind = type(term).__name__
        if isinstance(term, type) and issubclass(term, OwnTerm):
            raise InputError(
                f"terms: expected instances, found the class {term.__name__}; write terms=[{term.__name__}()]"
            )
        if not isinstance(term, OwnTerm):
            raise InputError(f"terms: expected instances of fairing.OwnTerm, found {kind}")
        if not term.name or not all(word.isidentifier() for word in term.name.split(" ")):
            raise InputError(f"term {kind}: expected a name of words such as 'planarity', found {term.name!r:.60}")
        if term.name in names:
            raise InputError(f"term {kind}: there is a term with the name {term.name!r} already; give it another one")
        if not 0 <= term.strength < np.inf:
            raise InputError(f"term {term.name}: expected a strength of at least 0, found {term.strength!r:.60}")
        names.append(term.name)


def _ids(term: OwnTerm, found: Any, count: int) -> np.ndarray:
    if not isinstance(found, Residuals):
        raise InputError(f"term {term.name}: expected begin to return fairing.Residuals, found {type(found).__name__}")
    ids = np.asarray(found.ids)
    if ids.ndim != 2 or ids.dtype.kind not in "iu" or (ids.size and not (ids.min() >= 0 and ids.max() < count)):
        raise InputError(
            f"term {term.name}: expected ids (r, c) of vertices, whole numbers from 0 to {count - 1}; found an array of shape "
            f"{ids.shape} and type {ids.dtype}"
        )
    return ids


def _called(term: OwnTerm, part: str, call: Callable[[], Any]) -> Any:
    try:
        return call()
    except (Cancelled, InputError):
        raise
    except Exception as error:
        raise InputError(
            f"term {term.name}: {part} raised {type(error).__name__}: {error}{_place(term, error)}"
        ) from error


def _place(term: OwnTerm, error: Exception) -> str:
    """Where in the term's own file an exception comes from."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == term.file]
    return f" ({Path(term.file).name}, line {frames[-1].lineno})" if frames else ""

"""Terms of an objective: robust rows, and quadratic anchors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
from scipy.sparse import bsr_array, coo_array, csc_array, diags_array

from fairing.optimize.loss import Loss


class Linearised(NamedTuple):
    """Attributes:
    matrix: (3 n, 3 n): normal matrix of the term, energy / world unit^2.
    gradient: (n, 3) float: of its energy, energy / world unit.
    """

    matrix: csc_array
    gradient: np.ndarray


class Term(Protocol):
    """A part of an objective."""

    @property
    def name(self) -> str:
        """One of `fairing.terms.names.TERMS`, or that of a term of one's own."""
        ...

    def total(self, vertices: np.ndarray) -> float:
        """Energy at positions (n, 3) float, world units."""
        ...

    def by_vertex(self, vertices: np.ndarray) -> np.ndarray:
        """(n,) float: the energy that each vertex shares in; a row counts for each of its vertices."""
        ...

    def linearise(self, vertices: np.ndarray) -> Linearised:
        """Normal equations at positions (n, 3) float, world units."""
        ...

    def hessians(self, vertices: np.ndarray) -> np.ndarray:
        """(n, 3, 3) float: normal matrix of each vertex, the others held."""
        ...

    def around(self, ids: np.ndarray) -> "Term":
        """What of the term depends on vertices `ids` (u,) int."""
        ...


class SumOfRows:
    """Energy of a term that is a sum over rows, each of which depends on several vertices.

    Attributes:
        ids: (r, c) int: the vertices of each row.
    """

    ids: np.ndarray

    def energies(self, vertices: np.ndarray) -> np.ndarray:
        """(r,) float: of the rows with the vertices at positions (n, 3), world units."""
        raise NotImplementedError

    def total(self, vertices: np.ndarray) -> float:
        """See `Term`."""
        return float(self.energies(vertices).sum())

    def by_vertex(self, vertices: np.ndarray) -> np.ndarray:
        """See `Term`."""
        energies = np.repeat(self.energies(vertices), self.ids.shape[1])
        return np.bincount(self.ids.ravel(), weights=energies, minlength=len(vertices))


@dataclass(frozen=True, eq=False)
class Rows(SumOfRows):
    """sum_r information_r rho(residual_r), with residuals that are linear in the vertices they depend on.

    Attributes:
        name: see `Term`.
        ids: (r, c) int: the vertices of each residual.
        derivatives: (r, c, 3) float: of the residuals by these vertices.
        residuals: (r,) float: at `begun`.
        begun: (n, 3) float, world units.
        information: (r,) float, >= 0.
        loss: rho, in the unit of the residuals.
    """

    name: str
    ids: np.ndarray
    derivatives: np.ndarray
    residuals: np.ndarray
    begun: np.ndarray
    information: np.ndarray
    loss: Loss

    def residuals_at(self, vertices: np.ndarray) -> np.ndarray:
        """(r,) float: with the vertices at positions (n, 3), world units."""
        moves = (vertices - self.begun)[self.ids]
        return self.residuals + np.einsum("rci,rci->r", self.derivatives, moves)

    def weights_at(self, vertices: np.ndarray) -> np.ndarray:
        """(r,) float: information times the robust weight; 0 where the loss rejects a residual."""
        return self.information * self.loss.weight(self.residuals_at(vertices))

    def linearise(self, vertices: np.ndarray) -> Linearised:
        residuals = self.residuals_at(vertices)
        weights = self.information * self.loss.weight(residuals)
        J = self.matrix(len(vertices))
        gradient = J.T @ (weights * residuals)
        return Linearised(csc_array(J.T @ diags_array(weights) @ J), gradient.reshape(-1, 3))

    def matrix(self, n_vertices: int) -> csc_array:
        """(r, 3 n) derivatives of the residuals by all coordinates."""
        columns = (3 * self.ids[:, :, None] + np.arange(3)).ravel()
        index = np.repeat(np.arange(len(self.ids)), 3 * self.ids.shape[1])
        shape = (len(self.ids), 3 * n_vertices)
        return coo_array((self.derivatives.ravel(), (index, columns)), shape=shape).tocsc()

    def hessians(self, vertices: np.ndarray) -> np.ndarray:
        result, weights = np.zeros((len(vertices), 3, 3)), self.weights_at(vertices)
        for corner in range(self.ids.shape[1]):
            d = self.derivatives[:, corner]
            np.add.at(result, self.ids[:, corner], weights[:, None, None] * d[:, :, None] * d[:, None])
        return result

    def around(self, ids: np.ndarray) -> "Rows":
        near = np.isin(self.ids, ids).any(axis=1)
        of_rows = {name: getattr(self, name)[near] for name in ("ids", "derivatives", "residuals", "information")}
        return replace(self, **of_rows)

    def scaled(self, by_vertex: np.ndarray) -> "Rows":
        """With information times factors (n,) float of the vertices, see `weighted`."""
        return self.weighted(by_vertex[self.ids])

    def weighted(self, factors: np.ndarray) -> "Rows":
        """With information times the mean of factors (r, c) float of its vertices, by how much each moves the residual."""
        share = np.linalg.norm(self.derivatives, axis=2)
        share /= np.maximum(share.sum(axis=1, keepdims=True), 1e-300)
        return replace(self, information=self.information * (share * factors).sum(axis=1))

    def energies(self, vertices: np.ndarray) -> np.ndarray:
        return self.information * self.loss.value(self.residuals_at(vertices))


@dataclass(frozen=True, eq=False)
class Anchor:
    """sum_v (x_v - a_v)^T B_v (x_v - a_v) / 2: every vertex x is held to a place a.

    Attributes:
        name: see `Term`.
        precision: (n, 3, 3) float: B.
        places: (n, 3) float, world units: a.
    """

    name: str
    precision: np.ndarray
    places: np.ndarray

    @classmethod
    def uniform(cls, name: str, strength: np.ndarray | float, places: np.ndarray) -> "Anchor":
        """An anchor of equal strength in all directions, (n,) float or one for all vertices, energy / world unit^2."""
        return cls(name, np.broadcast_to(strength, len(places))[:, None, None] * np.eye(3), places)

    def total(self, vertices: np.ndarray) -> float:
        return float(self.by_vertex(vertices).sum())

    def by_vertex(self, vertices: np.ndarray) -> np.ndarray:
        offset = vertices - self.places
        return 0.5 * np.einsum("vi,vij,vj->v", offset, self.precision, offset)

    def linearise(self, vertices: np.ndarray) -> Linearised:
        n = len(vertices)
        matrix = bsr_array((self.precision, np.arange(n), np.arange(n + 1))).tocsc()
        return Linearised(matrix, np.einsum("vij,vj->vi", self.precision, vertices - self.places))

    def hessians(self, vertices: np.ndarray) -> np.ndarray:
        return self.precision

    def around(self, ids: np.ndarray) -> "Anchor":
        return self


def linearised_sum(terms: Sequence[Term], vertices: np.ndarray) -> Linearised:
    """The normal equations of all terms together at positions (n, 3) float, world units."""
    n = 3 * len(vertices)
    each = [term.linearise(vertices) for term in terms]
    return Linearised(
        sum((one.matrix for one in each), csc_array((n, n))),
        sum((one.gradient for one in each), np.zeros(vertices.shape)),
    )

"""One iteration of reweighted least squares: every term's part of the step, the fold guard, and acceptance.

The step is -H^-1 (g_1 + ... + g_T) with the normal matrix H of all terms; the part of term t is -H^-1 g_t, one more right-hand
side of the same factorization.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from fairing.optimize.rows import Term

OBJECTIVE_TOLERANCE = 1e-9  # relative: objectives that differ by less are equal

Guard = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""From vertices (n, 3), ids (u,) and steps (u, 3) to steps that fold no face, and (u,) bool: whose steps were shortened."""


class Iteration(NamedTuple):
    """Attributes:
    proposed: (u, 3) float, world units: steps before they are limited.
    after: (n, 3) float: positions after the step if it is accepted, else before it.
    folds: (u,) bool: vertices whose step was shortened because a face would fold.
    objectives: before the step, and after the step that was tried.
    accepted: whether it does not raise the objective.
    """

    proposed: np.ndarray
    after: np.ndarray
    folds: np.ndarray
    objectives: tuple[float, float]
    accepted: bool


def iterate(terms: Sequence[Term], vertices: np.ndarray, ids: np.ndarray, guard: Guard) -> Iteration:
    """One iteration from vertices (n, 3) float, world units.

    Args:
        ids: (u,) int: vertices that move.
    """
    proposed = step_parts(terms, vertices, ids).sum(axis=-1)[ids]
    return tried(proposed, vertices, ids, guard, lambda places: sum(term.total(places) for term in terms))


def tried(
    proposed: np.ndarray,
    vertices: np.ndarray,
    ids: np.ndarray,
    guard: Guard,
    objective: Callable[[np.ndarray], float],
) -> Iteration:
    """The iteration of proposed steps (u,) of vertices `ids` (u,) int, as far as they fold no face; accepted unless the objective
    rises."""
    steps, folds = guard(vertices, ids, proposed)
    after = vertices.copy()
    after[ids] += steps
    before, then = objective(vertices), objective(after)
    accepted = then <= before * (1 + OBJECTIVE_TOLERANCE)
    return Iteration(proposed, after if accepted else vertices, folds, (before, then), accepted)


def step_parts(terms: Sequence[Term], vertices: np.ndarray, ids: np.ndarray) -> np.ndarray:
    """(n, 3, T) float: the part of each term in the step of vertices `ids` (u,) int, world units; 0 for the others.

    Together the terms must determine every vertex of `ids`.
    """
    parts = np.zeros((*vertices.shape, len(terms)))
    if len(ids) == 0 or not terms:
        return parts
    linear = [term.linearise(vertices) for term in terms]
    columns = (3 * ids[:, None] + np.arange(3)).ravel()
    H = sum((each.matrix for each in linear[1:]), linear[0].matrix)
    gradients = np.stack([each.gradient.ravel()[columns] for each in linear], axis=-1)
    solution = splu(csc_array(H[:, columns][columns])).solve(-gradients)
    parts[ids] = solution.reshape(len(ids), 3, len(terms))
    return parts

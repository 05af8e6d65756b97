"""Flip records without photos, for tests."""

import numpy as np

from fairing.triangulation import FlipRecord, FlipTrace
from fairing.triangulation.quads import find_quads


def grid_mesh(side: int) -> tuple[np.ndarray, np.ndarray]:
    """A flat grid, every square cut along the same diagonal."""
    v, u = np.mgrid[:side, :side]
    vertices = np.stack([u.ravel(), v.ravel(), np.zeros(side * side)], axis=1).astype(float)
    corner = (v[:-1, :-1] * side + u[:-1, :-1]).ravel()
    lower = np.stack([corner, corner + 1, corner + side], axis=1)
    upper = np.stack([corner + 1, corner + side + 1, corner + side], axis=1)
    return vertices, np.concatenate([lower, upper])


def flipped_at_random(vertices: np.ndarray, faces: np.ndarray, rounds: int, per_round: int) -> FlipTrace:
    """A record of flips without a reason, with energies that fall."""
    trace, rng, energy = FlipTrace({}, vertices, faces), np.random.default_rng(0), 1000.0
    for round_ in range(rounds):
        before = energy
        falls = rng.uniform(0.1, 1, per_round)
        for fall in falls:
            quads = find_quads(trace.faces_at(len(trace)))
            edges = {tuple(sorted(pair)) for pair in quads.edge.tolist()}
            free = [k for k, c in enumerate(quads.opposite.tolist()) if tuple(sorted(c)) not in edges]
            k = int(rng.choice(free))
            trace.append(
                FlipRecord(
                    round_, quads.edge[k], quads.opposite[k], quads.faces[k], (2.0, 2.0 - fall), (0.2, 0.2 - 0.1 * fall), 5,
                    (before, before - falls.sum() - 1),
                )
            )  # fmt: skip
        energy = before - falls.sum() - 1
    return trace

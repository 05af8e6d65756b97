"""Records of flips and face splits without photos, for tests."""

import numpy as np

from fairing.triangulation import FlipRecord, FlipTrace, SplitRound
from fairing.triangulation.quads import find_quads
from fairing.triangulation.subdivision import subdivided


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


def round_of_splits(
    vertices: np.ndarray, faces: np.ndarray, parts: list[list[int]], judges: list[int], after: list[float]
) -> SplitRound:
    """A round with parts of these faces, held-out points at 2 standard deviations before, and split where they end below 1.5.

    The corners and new vertices of split faces rise by half of the distance of two vertices.
    """
    chosen, part = np.concatenate(parts).astype(int), np.repeat(np.arange(len(parts)), [len(each) for each in parts])
    errors = np.column_stack([np.full(len(parts), 2.0), after])
    is_split = errors[:, 1] < 1.5
    is_chosen = np.zeros(len(faces), dtype=bool)
    is_chosen[chosen[is_split[part]]] = True
    moved, divided, parent = subdivided(vertices, faces, is_chosen)
    moved[np.unique(divided[is_chosen[parent]])] += [0, 0, 0.5 * np.linalg.norm(vertices[1] - vertices[0])]
    return SplitRound(
        vertices,
        faces,
        chosen,
        np.linspace(1, 2, len(chosen)),
        part,
        np.array(judges),
        errors,
        np.full(len(parts), 2.5),
        is_split,
        moved,
    )


def split_by_hand(vertices: np.ndarray, faces: np.ndarray) -> FlipTrace:
    """A record without flips of two rounds of splits of a grid of 5 x 5: of three parts two are split, then of one none."""
    first = round_of_splits(vertices, faces, [[5], [0, 16], [26]], [9, 30, 3], [1.0, 1.2, 1.9])
    second = round_of_splits(*first.result(), [[7]], [8], [1.8])
    trace = FlipTrace({}, *second.result())
    trace.splits = (first, second)
    return trace

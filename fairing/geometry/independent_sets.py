"""Sets of vertices that do not depend on each other, by greedy coloring."""

import numpy as np


def independent_sets(rows: np.ndarray, ids: np.ndarray, count: int) -> list[np.ndarray]:
    """Sets of vertices `ids` (k,) int of which no row (r, c) int has two (Curtis, Powell, Reid 1974).

    Args:
        rows: vertices that depend on each other, such as the corners of a face.
        count: number of all vertices.
    """
    neighbours: list[set[int]] = [set() for _ in range(count)]
    for row in rows.tolist():
        for vertex in row:
            neighbours[vertex].update(row)
    color = np.full(count, -1)
    for vertex in ids.tolist():
        taken = {int(color[other]) for other in neighbours[vertex]}
        color[vertex] = next(c for c in range(len(taken) + 1) if c not in taken)
    return [np.flatnonzero(color == c) for c in range(color.max(initial=-1) + 1)]

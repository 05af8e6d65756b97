"""Subdivision: chosen faces in four, their neighbours in two or three, so that no edge ends within another."""

import numpy as np

_MIDDLE = (3, 4, 5)
"""Places after the three corners of a face: middle of the edge from corner k to the next."""


def _pattern(code: int) -> list[list[int]]:
    """Parts of a face, by corners and middles; bit k of the code: edge k is divided."""
    divided = [k for k in range(3) if code >> k & 1]
    if len(divided) == 0:
        return [[0, 1, 2]]
    if len(divided) == 3:
        return [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]
    if len(divided) == 1:
        a, b, c = np.roll((0, 1, 2), -divided[0]).tolist()
        return [[a, _MIDDLE[a], c], [_MIDDLE[a], b, c]]
    whole = 3 - sum(divided)
    a, b, c = np.roll((0, 1, 2), -whole).tolist()
    return [[a, b, _MIDDLE[b]], [a, _MIDDLE[b], _MIDDLE[c]], [_MIDDLE[c], _MIDDLE[b], c]]


_PATTERNS = [np.array(_pattern(code)) for code in range(8)]


def divided_edges(n_vertices: int, faces: np.ndarray, is_chosen: np.ndarray) -> np.ndarray:
    """(k,) int, ascending: the edges of the chosen faces, from vertex a to b > a as the number a * n_vertices + b.

    `subdivided` adds their middles in this order.

    Args:
        faces: (m, 3) int.
        is_chosen: (m,) bool.
    """
    return np.unique(_edge_keys(n_vertices, faces)[is_chosen])


def _edge_keys(n_vertices: int, faces: np.ndarray) -> np.ndarray:
    """(m, 3) int: the number, as in `divided_edges`, of the edge from each corner to the next."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)
    return edges[:, :, 0] * n_vertices + edges[:, :, 1]


def subdivided(
    vertices: np.ndarray, faces: np.ndarray, is_chosen: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The mesh with new vertices in the middle of all edges of the chosen faces.

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        is_chosen: (m,) bool.

    Returns:
        vertices (n + k, 3), the old ones first; faces (q, 3) int in the order of those they are parts of; and these, (q,) int.
    """
    keys, new = _edge_keys(len(vertices), faces), divided_edges(len(vertices), faces, is_chosen)
    number = np.searchsorted(new, keys)
    is_divided = np.isin(keys, new)
    places = np.hstack([faces, len(vertices) + number])
    codes = is_divided @ np.array([1, 2, 4])
    parts, parents = [], []
    for code, pattern in enumerate(_PATTERNS):
        ids = np.flatnonzero(codes == code)
        parts.append(places[ids][:, pattern].reshape(-1, 3))
        parents.append(np.repeat(ids, len(pattern)))
    parent = np.concatenate(parents)
    order = np.argsort(parent, kind="stable")
    middles = (vertices[new // len(vertices)] + vertices[new % len(vertices)]) / 2
    return np.vstack([vertices, middles]), np.concatenate(parts)[order], parent[order]

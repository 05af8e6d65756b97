"""Tracks: keypoints of several photos that show the same point, joined from pairwise matches."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fairing.features.matching import Matches


@dataclass(frozen=True, eq=False)
class Tracks:
    """Tracks in compressed rows: track t has the observations `offsets[t]` to `offsets[t + 1]`, in the order of the photos.

    Attributes:
        offsets: (t + 1,) int.
        photos: (o,) int: photo of each observation.
        keypoints: (o,) int: its keypoint in that photo.
    """

    offsets: np.ndarray
    photos: np.ndarray
    keypoints: np.ndarray

    def __len__(self) -> int:
        return len(self.offsets) - 1


def join_tracks(counts: Sequence[int], pairs: np.ndarray, matches: Sequence[Matches], min_views: int) -> Tracks:
    """Tracks of at least `min_views` photos, none with two keypoints of one photo.

    Matches are edges between keypoints. A connected component with two keypoints of one photo is joined anew, its best
    matches first, leaving out every match that would bring two keypoints of one photo together.

    Args:
        counts: keypoints of each photo.
        pairs: (q, 2) int: the two photos of each element of `matches`.
    """
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    n = int(first[-1])
    photo_of = np.repeat(np.arange(len(counts)), counts)
    nothing = np.zeros(0, dtype=np.int64)
    i = np.concatenate([nothing, *(first[a] + m.indices[:, 0] for (a, _), m in zip(pairs, matches, strict=True))])
    j = np.concatenate([nothing, *(first[b] + m.indices[:, 1] for (_, b), m in zip(pairs, matches, strict=True))])
    distance = np.concatenate([np.zeros(0), *(m.distance for m in matches)])
    graph = coo_array((np.ones(len(i), dtype=np.int8), (i, j)), shape=(n, n))
    n_components, component = connected_components(graph, directed=False)
    key = component.astype(np.int64) * len(counts) + photo_of
    conflicting = np.zeros(n_components, dtype=bool)
    values, repeats = np.unique(key, return_counts=True)
    conflicting[values[repeats > 1] // len(counts)] = True
    edges = np.flatnonzero(conflicting[component[i]])
    best_first = edges[np.lexsort((j[edges], i[edges], distance[edges]))]
    component = component.astype(np.int64)
    apart = np.flatnonzero(conflicting[component])
    component[apart] = n_components + apart  # each keypoint alone
    _join_without_conflict(component, photo_of, i[best_first].tolist(), j[best_first].tolist())
    size = np.bincount(component)
    kept = np.flatnonzero(size[component] >= min_views)
    order = kept[np.argsort(component[kept], kind="stable")]  # by component, then photo and keypoint
    sizes = np.diff(np.flatnonzero(np.diff(component[order], prepend=-1, append=-1)))
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    by_first = np.argsort(order[offsets[:-1]], kind="stable")
    order = np.concatenate([nothing, *(order[offsets[t] : offsets[t + 1]] for t in by_first)])
    offsets = np.concatenate([[0], np.cumsum(sizes[by_first])])
    return Tracks(offsets, photo_of[order], order - first[photo_of[order]])


def _join_without_conflict(component: np.ndarray, photo_of: np.ndarray, i: list[int], j: list[int]) -> None:
    """Join components (n,) along edges i[e], j[e] in turn, unless both have a keypoint of the same photo; in place."""
    members: dict[int, list[int]] = {}
    for a, b in zip(i, j, strict=True):
        one, other = int(component[a]), int(component[b])
        if one == other:
            continue
        left, right = members.get(one, [a]), members.get(other, [b])
        if set(photo_of[left].tolist()) & set(photo_of[right].tolist()):
            continue
        component[right] = one
        members[one] = left + right
        members.pop(other, None)

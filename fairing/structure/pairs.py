"""Pairs of photos to match: all of them, or of many photos the neighbours in the order of their names and the most similar ones."""

from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np
from scipy.cluster.vq import kmeans2

MOST_EXHAUSTIVE = 80
"""Photos; of more not all pairs are matched."""
NEIGHBOURS = 10
"""Photos after each one in the order of their names that it is matched with."""
SIMILAR = 20
"""Most similar photos that each one is matched with."""
_WORDS = 64
_SAMPLED, _PER_PHOTO = 40_000, 2_000
"""Descriptors: of all photos, to find words; of each photo, to describe it."""


def pairs_to_match(
    n_photos: int, descriptors: Callable[[int], np.ndarray], on_photo: Callable[[int], None] = lambda done: None
) -> list[tuple[int, int]]:
    """Pairs (i, j), i < j, of photos in the order of their names.

    Args:
        descriptors: returns those of a photo, (n, d); only called for more than `MOST_EXHAUSTIVE` photos.
        on_photo: called with the number of photos that have been described.
    """
    if n_photos <= MOST_EXHAUSTIVE:
        return list(combinations(range(n_photos), 2))
    near = {(i, j) for i in range(n_photos) for j in range(i + 1, min(i + 1 + NEIGHBOURS, n_photos))}
    each = []
    for i in range(n_photos):
        each.append(_sample(descriptors(i), _PER_PHOTO, i))
        on_photo(i + 1)
    return sorted(near | similar_pairs(each))


def similar_pairs(descriptors: Sequence[np.ndarray]) -> set[tuple[int, int]]:
    """Pairs (i, j), i < j, of each photo with the `SIMILAR` photos most similar to it.

    Similarity is the scalar product of vectors of locally aggregated descriptors (Jegou et al., CVPR 2010) with signed square
    roots: a photo is described by the sums of the differences between its descriptors and the nearest of `_WORDS` words.

    Args:
        descriptors: (n_i, d) of each photo.
    """
    share = max(1, _SAMPLED // len(descriptors))
    sampled = np.concatenate([_sample(each, share, i) for i, each in enumerate(descriptors)]).astype(np.float32)
    if len(sampled) < _WORDS:
        return set()
    # `seed` is called `rng` since SciPy 1.15, which still takes the former name.
    words, _ = kmeans2(
        sampled, _WORDS, iter=8, minit="points", seed=np.random.default_rng(0)  # pyright: ignore[reportCallIssue]
    )  # fmt: skip
    signatures = np.stack([_signature(each.astype(np.float32), words) for each in descriptors])
    likeness = signatures @ signatures.T
    np.fill_diagonal(likeness, -np.inf)
    best = np.argsort(-likeness, axis=1, kind="stable")[:, :SIMILAR]
    return {(min(i, j), max(i, j)) for i, row in enumerate(best.tolist()) for j in row if i != j}


def _signature(descriptors: np.ndarray, words: np.ndarray) -> np.ndarray:
    """(words * d,) float: the photo's vector, of unit length; zero without descriptors."""
    sums = np.zeros_like(words)
    if len(descriptors):
        distance = (words**2).sum(axis=1) - 2 * descriptors @ words.T
        nearest = distance.argmin(axis=1)
        np.add.at(sums, nearest, descriptors - words[nearest])
    flat = (np.sign(sums) * np.sqrt(np.abs(sums))).ravel()
    return flat / (np.linalg.norm(flat) or 1.0)


def _sample(rows: np.ndarray, count: int, seed: int) -> np.ndarray:
    if len(rows) <= count:
        return rows
    return rows[np.random.default_rng(seed).choice(len(rows), count, replace=False)]

"""Displacement: the translation at which the points confirm a mesh that they contradict where it is."""

from itertools import product

import numpy as np

from fairing.placement.frames import MeshFrame
from fairing.placement.sightings import CLOSE, Sightings

FEW_RAYS, MANY_RAYS = 400, 2000
"""About that many rays are cast at every place on the first grid, and at the later ones."""
REACH, STEP = 0.6, 0.1
"""Of the mesh's diagonal: how far the first places lie from the present one, and from each other."""
FINEST = 0.005
"""Of the diagonal: the search halves its step until it is below."""
CONTRADICTION = 0.5
"""A ray that meets the mesh elsewhere counts that much against a place."""


def best_translation(sightings: Sightings) -> MeshFrame:
    """The frame, moved along the axes alone, in which most rays meet the mesh at their point.

    Places on a grid around the present one, and around the one with the middle of the mesh at the median of the points where
    that is farther, then around the best at half the step each time. The tolerance is the step, but at least `CLOSE`.
    """
    size = sightings.diagonal
    offset = np.median(sightings.targets, axis=0) - sightings.middle
    middles = [np.zeros(3)] + ([offset] if np.linalg.norm(offset) > REACH * size else [])

    def score(shift: np.ndarray, tolerance: float, rays: int) -> float:
        step = max(1, len(sightings.targets) // rays)
        miss, reach = sightings.misses(MeshFrame("", np.eye(3), shift), step)
        with np.errstate(invalid="ignore"):
            confirmed = int((np.abs(miss) <= np.minimum(tolerance, reach)).sum())
        return confirmed - CONTRADICTION * (int(np.isfinite(miss).sum()) - confirmed)

    def best(places: list[np.ndarray], tolerance: float, rays: int) -> np.ndarray:
        return places[int(np.argmax([score(place, tolerance, rays) for place in places]))]

    n = round(REACH / STEP)
    grid = STEP * size * np.array(list(product(range(-n, n + 1), repeat=3)), dtype=float)
    shift = best([middle + place for middle in middles for place in grid], STEP, FEW_RAYS)
    width = STEP / 2
    around = np.array(list(product((0, -1, 1), repeat=3)), dtype=float)
    while width >= FINEST:
        shift = best([shift + width * size * place for place in around], max(width, CLOSE), MANY_RAYS)
        width /= 2
    moved = ", ".join(f"{value:.4g}" for value in shift)
    return MeshFrame(f"moved by ({moved})", np.eye(3), shift)

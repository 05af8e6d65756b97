"""Alignment of creases with image edges: a robust least squares fit of the vertices to the measured offsets.

Priors hold the faces on their planes, the edges and faces of a building parallel to its axes and, weakly, the vertices where
they are. (ledger: creases, Manhattan frame)
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from typing import NamedTuple

import numpy as np

from fairing.creases.edges import Creases, find_creases
from fairing.creases.offsets import Offsets, measure_offsets
from fairing.geometry.normals import unit_normals
from fairing.geometry.pixel_size import pixel_size
from fairing.optimize.iteration import step_parts
from fairing.optimize.loss import GemanMcClure
from fairing.optimize.rows import Anchor, Rows
from fairing.photo import grey_levels
from fairing.scene import View
from fairing.terms.axes import related, relations
from fairing.terms.names import IMAGE_EDGES, START

# px: largest offset, and scale of the Geman-McClure loss of an offset. Offsets are measured anew in each stage.
# (ledger: stages of the alignment)
STAGES = ((6.0, 2.0), (3.5, 1.2), (2.0, 0.5))
ITERATIONS = 12  # of reweighting, in each stage
CONVERGED = 1e-4  # px
PRIORS = 6.0  # strength of both priors
PLANE = 0.3  # of the prior to the planes, for a large face
LARGE_FACE = 30.0  # px, square root of the area
PLANE_SCALE = 1.0  # px, of its Geman-McClure loss
POSITION = 0.1  # of the prior to the positions


class Alignment(NamedTuple):
    """Attributes:
    vertices: (n, 3) float: aligned positions, world units.
    information: (n, 3, 3) float, 1 / world unit^2: normal matrix of each vertex in its offsets and relations alone, px^2.
    is_building: whether the mesh has a Manhattan frame, so that offsets of parallel creases confirm each other.
    """

    vertices: np.ndarray
    information: np.ndarray
    is_building: bool


def aligned_to_image_edges(
    views: Sequence[View],
    vertices: np.ndarray,
    faces: np.ndarray,
    locked: np.ndarray,
    orientation: int,
    reach: float,
    executor: Executor,
    raise_if_cancelled: Callable[[], None] = lambda: None,
) -> Alignment:
    """Move the creases of a mesh onto image edges nearby, with the relations of its Manhattan frame (`fairing.terms.axes`).

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        locked: (n,) bool: vertices that stay.
        orientation: see `find_creases`.
        reach: px, at least 2: stages that look farther are left out.
        executor: runs one task for each photo; the result does not depend on it.

    Raises:
        Cancelled: by `raise_if_cancelled`.
    """
    creases = find_creases(vertices, faces, orientation)
    information = np.zeros((len(vertices), 3, 3))
    pixel = pixel_size([view.camera for view in views], vertices)
    free = np.flatnonzero(~locked & np.isfinite(pixel))
    if len(creases.ends) == 0 or len(free) == 0:
        return Alignment(vertices, information, False)
    position = Anchor(
        START, PRIORS * (POSITION / np.nan_to_num(pixel, nan=1.0))[:, None, None] ** 2 * np.eye(3), vertices
    )
    found_axes = relations(vertices, faces, pixel)
    holding = _planes(vertices, faces, pixel), position, related(found_axes, vertices)
    moved = vertices
    for largest, scale in STAGES:
        if largest > reach:
            continue

        def measured(view: View, at: np.ndarray = moved, largest: float = largest) -> Offsets:
            raise_if_cancelled()
            return measure_offsets(grey_levels(view.photo.full_depth()), view.camera, at, faces, creases, largest)

        found = Offsets(*(np.concatenate(part) for part in zip(*executor.map(measured, views), strict=True)))
        offsets = _offsets(found, creases, moved, scale)
        for _ in range(ITERATIONS):
            raise_if_cancelled()
            step = step_parts((offsets, *holding), moved, free).sum(axis=-1)
            moved = moved + step
            if np.abs(step[free] / pixel[free, None]).max() < CONVERGED:
                break
        information = _by_vertex(found, creases, offsets.weights_at(moved), len(vertices))
        information += holding[2].hessians(moved)
    return Alignment(moved, information, len(found_axes.pairs) > 0)


def _planes(vertices: np.ndarray, faces: np.ndarray, pixel: np.ndarray) -> Rows:
    """Distances of the corners from the planes of their faces, px; small faces hold less.

    Args:
        pixel: (n,) float: size of a pixel, world units.
    """
    normals, doubled = unit_normals(vertices, faces)
    size = np.nan_to_num(pixel[faces], nan=np.inf)
    derivatives = (normals[:, None] / size[:, :, None]).reshape(-1, 1, 3)
    side = np.sqrt(0.5 * doubled) / size.mean(axis=1)
    strength = PRIORS * np.repeat((PLANE * np.minimum(1.0, side / LARGE_FACE)) ** 2, 3)
    nothing = np.zeros(len(derivatives))
    return Rows(START, faces.reshape(-1, 1), derivatives, nothing, vertices, strength, GemanMcClure(PLANE_SCALE))


def _shares(found: Offsets) -> np.ndarray:
    """(s, 2) float: how much of the move of each end a segment makes."""
    return np.column_stack([1 - found.along, found.along])


def _offsets(found: Offsets, creases: Creases, vertices: np.ndarray, scale: float) -> Rows:
    """Distances of the segments of creases from image edges, px, where they were measured: with the vertices (n, 3) there."""
    derivatives = _shares(found)[:, :, None] * found.px_per_move[:, None]
    ends = creases.ends[found.crease]
    return Rows(IMAGE_EDGES, ends, derivatives, -found.offset, vertices, found.weight, GemanMcClure(scale))


def _by_vertex(found: Offsets, creases: Creases, weight: np.ndarray, count: int) -> np.ndarray:
    """(count, 3, 3) float, 1 / world unit^2: the sum of the weighted segments by the vertex they move."""
    outer = found.px_per_move[:, :, None] * found.px_per_move[:, None]
    result = np.zeros((count, 3, 3))
    for end, share in zip(creases.ends[found.crease].T, _shares(found).T, strict=True):
        np.add.at(result, end, (weight * share)[:, None, None] * outer)
    return result

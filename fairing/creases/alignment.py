"""Alignment of creases with image edges: a robust least squares fit of the vertices to the measured offsets.

Priors hold the faces on their planes, the edges and faces of a building parallel to its axes and, weakly, the vertices where
they are. (ledger: creases, Manhattan frame)
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csc_array, diags_array
from scipy.sparse.linalg import splu

from fairing.creases.edges import Creases, find_creases
from fairing.creases.offsets import Offsets, measure_offsets
from fairing.geometry.geman_mcclure import geman_mcclure_weights
from fairing.geometry.manhattan import relations
from fairing.geometry.normals import unit_normals
from fairing.geometry.pixel_size import pixel_size
from fairing.scene import View

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
    """Move the creases of a mesh onto image edges nearby, with the relations of its Manhattan frame (`fairing.geometry.manhattan`).

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
    columns = (3 * free[:, None] + np.arange(3)).ravel()
    planes, strength = _planes(vertices, faces, pixel)
    planes = planes[:, columns]
    position = np.repeat((POSITION / pixel[free]) ** 2, 3)
    related = relations(vertices, faces, pixel)
    every_difference = related.matrix(len(vertices))
    differing, at_start = every_difference[:, columns], every_difference @ vertices.ravel()
    moved = vertices.copy()
    for largest, scale in STAGES:
        if largest > reach:
            continue

        def measured(view: View, at: np.ndarray = moved, largest: float = largest) -> Offsets:
            raise_if_cancelled()
            return measure_offsets(view.photo.load(), view.camera, at, faces, creases, largest)

        found = Offsets(*(np.concatenate(part) for part in zip(*executor.map(measured, views), strict=True)))
        J = _rows(found, creases, vertices.size)[:, columns]
        so_far = (moved - vertices).ravel()[columns]
        differences = at_start + differing @ so_far
        step, residual = np.zeros(len(columns)), found.offset
        for _ in range(ITERATIONS):
            raise_if_cancelled()
            weight = found.weight * geman_mcclure_weights(residual, scale)
            off_plane = planes @ (so_far + step)
            holds = PRIORS * strength * geman_mcclure_weights(off_plane, PLANE_SCALE)
            relates = related.weights(differences + differing @ step)
            H = J.T @ diags_array(weight) @ J + planes.T @ diags_array(holds) @ planes + diags_array(PRIORS * position)
            H += differing.T @ diags_array(relates) @ differing
            target = J.T @ (weight * found.offset) - planes.T @ (holds * (planes @ so_far)) - PRIORS * position * so_far
            target -= differing.T @ (relates * differences)
            last, step = step, splu(csc_array(H)).solve(target)
            residual = found.offset - J @ step
            if np.abs((step - last) / np.repeat(pixel[free], 3)).max() < CONVERGED:
                break
        moved = moved.copy()
        moved[free] += step.reshape(-1, 3)
        information = _by_vertex(found, creases, found.weight * geman_mcclure_weights(residual, scale), len(vertices))
        information += related.hessians(related.weights(differences + differing @ step), len(vertices))
    return Alignment(moved, information, len(related.pairs) > 0)


def _planes(vertices: np.ndarray, faces: np.ndarray, pixel: np.ndarray) -> tuple[csc_array, np.ndarray]:
    """Distances of the corners from the planes of their faces, and the strength of the prior to them.

    Args:
        pixel: (n,) float: size of a pixel, world units.

    Returns:
        (3 m, 3 n) matrix from moves, world units, to distances, px; (3 m,) float.
    """
    normals, doubled = unit_normals(vertices, faces)
    size = np.nan_to_num(pixel[faces], nan=np.inf)
    rows = normals[:, None] / size[:, :, None]
    side = np.sqrt(0.5 * doubled) / size.mean(axis=1)
    columns = (3 * faces[:, :, None] + np.arange(3)).ravel()
    index = np.repeat(np.arange(3 * len(faces)), 3)
    matrix = coo_array((rows.ravel(), (index, columns)), shape=(3 * len(faces), vertices.size)).tocsc()
    return matrix, np.repeat((PLANE * np.minimum(1.0, side / LARGE_FACE)) ** 2, 3)


def _shares(found: Offsets) -> np.ndarray:
    """(s, 2) float: how much of the move of each end a segment makes."""
    return np.column_stack([1 - found.along, found.along])


def _rows(found: Offsets, creases: Creases, n_coordinates: int) -> csc_array:
    """(s, n_coordinates) matrix from moves of the vertices, world units, to moves of the segments across, px."""
    values = _shares(found)[:, :, None] * found.px_per_move[:, None]
    columns = 3 * creases.ends[found.crease][:, :, None] + np.arange(3)
    rows = np.repeat(np.arange(len(found.offset)), 6)
    return coo_array((values.ravel(), (rows, columns.ravel())), shape=(len(found.offset), n_coordinates)).tocsc()


def _by_vertex(found: Offsets, creases: Creases, weight: np.ndarray, count: int) -> np.ndarray:
    """(count, 3, 3) float, 1 / world unit^2: the sum of the weighted segments by the vertex they move."""
    outer = found.px_per_move[:, :, None] * found.px_per_move[:, None]
    result = np.zeros((count, 3, 3))
    for end, share in zip(creases.ends[found.crease].T, _shares(found).T, strict=True):
        np.add.at(result, end, (weight * share)[:, None, None] * outer)
    return result

"""Cell layout: how many samples each face gets at a level, and the border that is left out."""

from dataclasses import dataclass

import numpy as np

from fairing.options import FairingOptions

# Each 1.25 to 1.5 times the one before (ledger: grid sizes).
GRID_SIZES = (8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
# A cell up to this size is never made smaller, so that faces of usual size lose no information.
LEAST_LARGEST = 64
# Samples of all cells of a level: beyond it, the largest cells are made smaller (ledger: samples of a level).
MAX_SAMPLES = 10_000_000


@dataclass(frozen=True, eq=False)
class CellLayout:
    """The sample grids of a level, and the grid of each face.

    Attributes:
        grid_sizes: (g,) int: samples along a leg of each grid.
        grid_start: (g + 1,) int64: where the samples of each grid start in `ramp`.
        ramp: (2, total) float32: barycentric weights of corners 0 and 1 at the samples, see `cell_grid`.
        face_grid: (m,) int64: the grid of each face.
        inset: (m,) float: border left out, as a fraction of the face's height.
    """

    grid_sizes: np.ndarray
    grid_start: np.ndarray
    ramp: np.ndarray
    face_grid: np.ndarray
    inset: np.ndarray

    @property
    def samples(self) -> np.ndarray:
        """(m,) int: samples of each face."""
        return np.diff(self.grid_start)[self.face_grid]


def cell_grid(size: int) -> np.ndarray:
    """(2, size * (size + 1) / 2) float32: barycentric weights of corners 0 and 1 at the samples of a cell.

    Sample (row r, column c) of the right triangle lies at ((c + 1/3) / size, (r + 1/3) / size), c + r < size, so that
    the three corners are treated alike.
    """
    row, column = np.nonzero(np.add.outer(np.arange(size), np.arange(size)) < size)
    return np.stack([(column + 1 / 3) / size, (row + 1 / 3) / size]).astype(np.float32)


def plan_cells(
    options: FairingOptions,
    level: int,
    longest_edge: np.ndarray,
    height: np.ndarray,
    is_candidate: np.ndarray,
) -> CellLayout:
    """Choose a grid for each face by its largest footprint, and its inset by its mean height in the photos.

    Args:
        longest_edge, height: (m, V) float, px, see `Footprints`.
        is_candidate: (m, V) bool: photos that show the face by its outline.
    """
    at = options.levels[level]
    size, adaptive = at.size, options.cells.adaptive
    grid_sizes = [s for s in GRID_SIZES if s < size] + [size] if adaptive else [size]
    needed = np.where(is_candidate, longest_edge, 0).max(axis=1) / (at.spacing * max(1.0, at.blur))
    face_grid = np.minimum(np.searchsorted(grid_sizes, needed), len(grid_sizes) - 1)
    if adaptive:
        face_grid = np.minimum(face_grid, _largest_grid(np.array(grid_sizes), face_grid, is_candidate.sum(axis=1)))
    grids = [cell_grid(s) for s in grid_sizes]
    grid_start = np.concatenate([[0], np.cumsum([grid.shape[1] for grid in grids])])
    mean_height = np.where(is_candidate, height, 0).sum(1) / np.maximum(is_candidate.sum(1), 1)
    # At most 0.08 of the height, else small faces would lose everything.
    inset = np.minimum(at.inset / np.maximum(mean_height, 1e-9), 0.08)
    return CellLayout(
        np.array(grid_sizes),
        grid_start.astype(np.int64),
        np.concatenate(grids, axis=1),
        face_grid.astype(np.int64),
        inset,
    )


def _largest_grid(grid_sizes: np.ndarray, face_grid: np.ndarray, n_photos: np.ndarray) -> int:
    """The largest grid with which all cells together have at most `MAX_SAMPLES` samples; at least `LEAST_LARGEST`.

    Args:
        grid_sizes: (g,) int.
        face_grid: (m,) int: the grid that each face would need.
        n_photos: (m,) int: photos that show the face.
    """
    samples = grid_sizes * (grid_sizes + 1) // 2
    fitting = (
        k
        for k in range(len(grid_sizes) - 1, -1, -1)
        if grid_sizes[k] <= LEAST_LARGEST or (samples[np.minimum(face_grid, k)] * n_photos).sum() <= MAX_SAMPLES
    )
    return next(fitting, 0)

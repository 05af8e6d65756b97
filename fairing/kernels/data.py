"""Input of the kernels that stays fixed while vertices move."""

from enum import IntEnum, auto
from typing import NamedTuple

import numpy as np


class Task(IntEnum):
    """What to compute beside the energies: nothing, residual statistics, normal equations by either solver."""

    ENERGY = auto()
    STATISTICS = auto()
    ALTERNATING = auto()
    VARIABLE_PROJECTION = auto()


class NormLoop(IntEnum):
    """Which loop of `fairing.kernels.robust.weigh` computes a norm; TABLE: any norm, by a table."""

    GEMAN_MCCLURE = auto()
    HUBER = auto()
    LEAST_SQUARES = auto()
    TABLE = auto()


class KernelData(NamedTuple):
    """The fixed data of m faces, V views and P pairs of a face and a view, built by `fairing.cells.context.build_context`.

    Attributes:
        faces: (m, 3) int64.
        image_from_world: (C, 3, 4) float64: of the V views, then of photos stored at reduced resolution.
        pixels: flat float32, grey levels: the planes (channels, height, width) of blurred photos, or of patches of them, one
            after another.
        channels: planes of a photo.
        pair_start: (m + 1,) int64: the pairs of face f are pair_start[f] : pair_start[f + 1].
        pair_view: (P,) int64: view id.
        pair_camera: (P,) int64: the index in `image_from_world` of the pair's photo as it is stored.
        pair_base: (P,) int64: where the pair's photo, or patch of it, starts in `pixels`.
        pair_frame: (P, 4) int64: that patch's left and top pixel, width and height.
        pair_weight: (P,) float64: photo pixels a cell sample stands for, times the photo's weight.
        pair_mask: (P,) int64: where the samples' mask starts in `masks`, or -1 if every sample counts.
        masks: flat uint8: 1 where a sample counts.
        face_dimensions: (m,) int64: k; 0 for a face that takes no part.
        face_inset: (m,) float64: border left out, as a fraction of the face's height.
        face_grid: (m,) int64: cell grid of each face.
        grid_start: (g + 1,) int64: where each grid starts in `ramp`.
        ramp: (2, total) float32: barycentric weights of corner 0 and 1 at the cells' samples.
        affine, cubic, remove_bias, centered: bool.
        norm: a `NormLoop`.
        norm_table: (2, t + 1) float32, see `fairing.norms.norm.Tabulated`.
    """

    faces: np.ndarray
    image_from_world: np.ndarray
    pixels: np.ndarray
    channels: int
    pair_start: np.ndarray
    pair_view: np.ndarray
    pair_camera: np.ndarray
    pair_base: np.ndarray
    pair_frame: np.ndarray
    pair_weight: np.ndarray
    pair_mask: np.ndarray
    masks: np.ndarray
    face_dimensions: np.ndarray
    face_inset: np.ndarray
    face_grid: np.ndarray
    grid_start: np.ndarray
    ramp: np.ndarray
    affine: bool
    cubic: bool
    remove_bias: bool
    centered: bool
    norm: int
    norm_table: np.ndarray

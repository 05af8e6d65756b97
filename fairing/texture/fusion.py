"""Fusion of texture samples: one image and a gain for each photo of each face, and the exposures of the photos."""

import numba
import numpy as np

from fairing.texture.layout import AtlasLayout
from fairing.texture.texels import SOURCE, columns, place, rows

OUTLIER = 20.0  # grey levels, sigma of the Geman-McClure weight
ROUNDS = 4
LARGEST_GAIN = 4.0


def exposures(
    layout: AtlasLayout, chosen: np.ndarray, log_gain: np.ndarray, n_views: int
) -> tuple[np.ndarray, np.ndarray]:
    """Separate the gains of faces in photos into a gain of each face and an exposure of each photo.

    log c_fv = a_f + g_v in least squares, with median g = 0.

    Args:
        chosen: (m, s) int: views of each face, -1 for none.
        log_gain: (m, s) float: log c_fv.
        n_views: V.

    Returns:
        exp(a): (m,) float, and exp(g): (V,) float.
    """
    face, slot = np.nonzero(chosen >= 0)
    view, value = chosen[face, slot], log_gain[face, slot]
    count = np.maximum(np.bincount(face, minlength=len(chosen)), 1)
    # With a_f eliminated, each face contributes: its gains minus their mean equal its views' exposures minus their mean.
    shares = np.zeros((len(chosen), n_views), dtype=np.float32)
    shares[face, view] = 1
    weight = layout.legs.prod(axis=1) / count
    normal = np.diag(np.bincount(view, weight[face] * count[face], n_views)) - shares.T @ (shares * weight[:, None])
    mean = np.bincount(face, value, len(chosen)) / count
    right = np.bincount(view, weight[face] * count[face] * (value - mean[face]), n_views)
    exposure = np.linalg.lstsq(normal, right, rcond=1e-9)[0]
    exposure -= np.median(exposure)  # the median, so that one outlying photo does not shift the rest
    return np.exp(np.bincount(face, value - exposure[view], len(chosen)) / count), np.exp(exposure)


@numba.njit(nogil=True)
def _fuse(members, starts, colors, weights, corner, legs, is_turned, gutter, image, log_gain):
    """Fit U and c of every face robustly (alternating weighted least squares from the median); U is written to `image`."""
    n_slots = weights.shape[1]
    values = np.empty(n_slots)
    for m in range(members.shape[0]):
        face, start = members[m], starts[m]
        n = starts[m + 1] - start
        U = np.full((n, 3), -1.0)  # negative: unknown
        for t in range(n):
            for k in range(3):
                count = 0
                for s in range(n_slots):
                    if weights[start + t, s] > 1:
                        at = count
                        while at > 0 and values[at - 1] > colors[start + t, s, k]:
                            values[at] = values[at - 1]
                            at -= 1
                        values[at] = colors[start + t, s, k]
                        count += 1
                if count > 0:
                    U[t, k] = 0.5 * (values[(count - 1) // 2] + values[count // 2])
        gain = np.ones(n_slots)
        for _ in range(ROUNDS):
            above, below = np.zeros(n_slots), np.zeros(n_slots)
            for t in range(n):
                for s in range(n_slots):
                    if weights[start + t, s] > 1:
                        trust = weights[start + t, s] * _trust(colors[start + t, s], U[t], gain[s])
                        for k in range(3):
                            above[s] += trust * U[t, k] * colors[start + t, s, k]
                            below[s] += trust * U[t, k] * U[t, k]
            for s in range(n_slots):
                if below[s] > 0:
                    gain[s] = min(max(above[s] / below[s], 1 / LARGEST_GAIN), LARGEST_GAIN)
            for t in range(n):
                r, g, b, total = 0.0, 0.0, 0.0, 0.0
                known = False
                for s in range(n_slots):
                    known = known or weights[start + t, s] > 1
                for s in range(n_slots):
                    weight = weights[start + t, s]
                    if weight > 1 or (weight == 1 and not known):
                        trust = weight * gain[s] * (_trust(colors[start + t, s], U[t], gain[s]) if known else 1.0)
                        r += trust * colors[start + t, s, 0]
                        g += trust * colors[start + t, s, 1]
                        b += trust * colors[start + t, s, 2]
                        total += trust * gain[s]
                if total > 0:
                    U[t, 0], U[t, 1], U[t, 2] = r / total, g / total, b / total
        for s in range(n_slots):
            log_gain[face, s] = np.log(gain[s])
        w, h = legs[face, 0], legs[face, 1]
        t = 0
        for row in range(rows(h, gutter)):
            for column in range(columns(row, w, h, gutter)):
                y, x = place(row, column, corner[face], w, h, is_turned[face], gutter)
                if U[t, 0] >= 0:
                    image[y, x] = U[t].astype(np.float32)
                t += 1


@numba.njit(nogil=True, inline="always")
def _trust(color, U, gain):
    """Geman-McClure weight of a colour (3,) given its prediction gain * U."""
    squared = 0.0
    for k in range(3):
        squared += (color[k] - gain * U[k]) ** 2 / 3
    return 1 / (1 + squared / OUTLIER**2) ** 2


@numba.njit(nogil=True)
def _multiply(corner, legs, is_turned, gutter, gain, image):
    """Multiply the texels of each face by its gain (m,), in place."""
    for face in range(legs.shape[0]):
        w, h = legs[face, 0], legs[face, 1]
        for row in range(rows(h, gutter)):
            for column in range(columns(row, w, h, gutter)):
                y, x = place(row, column, corner[face], w, h, is_turned[face], gutter)
                for k in range(3):
                    image[y, x, k] *= gain[face]


def _cached_for(source):
    @numba.njit(cache=True, nogil=True)
    def fuse(*arguments):
        """See `_fuse`."""
        assert source >= 0
        _fuse(*arguments)

    @numba.njit(cache=True, nogil=True)
    def multiply(*arguments):
        """See `_multiply`."""
        assert source >= 0
        _multiply(*arguments)

    return fuse, multiply


fuse, multiply = _cached_for(SOURCE)

"""Fusion of texture samples: one image and a gain for each photo of each face, and the exposures of the photos."""

import numba
import numpy as np

from fairing.texture.layout import AtlasLayout
from fairing.texture.texels import SOURCE, columns, place, rows
from fairing.util.compiled_only import COMPILED_ONLY

OUTLIER = 20.0  # grey levels, sigma of the Geman-McClure weight
ROUNDS = 4
LARGEST_GAIN = 4.0
HIDDEN = (
    1000.0  # grey level of texels in photos that do not see them: above all others, so that no other ranks after it
)


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


@numba.njit(nogil=True, **COMPILED_ONLY)
def _fuse(members, starts, colors, weights, corner, legs, is_turned, gutter, image, log_gain):
    """Fit U and c of every face robustly (alternating weighted least squares from the median); U is written to `image`.

    A texel that no photo sees gets the mean of what lies in front of it in the photos.
    """
    n_slots = weights.shape[1]
    most = 0
    for m in range(members.shape[0]):
        most = max(most, starts[m + 1] - starts[m])
    # Of one face: its colours, and their weights, 0 in the photos that do not see a texel.
    planes, seen = np.empty((n_slots, 3, most), dtype=np.float32), np.empty((n_slots, most), dtype=np.float32)
    U = np.empty((3, most), dtype=np.float32)
    sums = np.empty((4, most), dtype=np.float32)
    for m in range(members.shape[0]):
        face, start = members[m], starts[m]
        n = starts[m + 1] - start
        gain = np.ones(n_slots, dtype=np.float32)
        for t in range(n):
            for s in range(n_slots):
                weight = weights[start + t, s]
                seen[s, t] = weight if weight > 1 else 0
                for k in range(3):
                    planes[s, k, t] = colors[start + t, s, k] if weight > 1 else HIDDEN
        _median(planes, seen, n, U)
        for _ in range(ROUNDS):
            sums[:, :n] = 0
            for s in range(n_slots):
                gain[s] = _gain(planes[s], seen[s], n, U, gain[s])
            for s in range(n_slots):
                _add_image(planes[s], seen[s], n, U, gain[s], sums)
            for t in range(n):
                if sums[3, t] > 0:
                    for k in range(3):
                        U[k, t] = sums[k, t] / sums[3, t]
        for s in range(n_slots):
            log_gain[face, s] = np.log(gain[s])
        w, h = legs[face, 0], legs[face, 1]
        t = 0
        for row in range(rows(h, gutter)):
            for column in range(columns(row, w, h, gutter)):
                y, x = place(row, column, corner[face], w, h, is_turned[face], gutter)
                if U[0, t] >= 0:
                    for k in range(3):
                        image[y, x, k] = U[k, t]
                else:
                    _hidden_texel(colors[start + t], weights[start + t], gain, image[y, x])
                t += 1


@numba.njit(nogil=True, **COMPILED_ONLY)
def _median(planes, seen, n, U):
    """U (3, n): of the photos that see a texel, channel by channel; -1 where none does.

    By rank, because rows of comparisons are vectorised and sorting each texel is not.
    """
    n_slots = planes.shape[0]
    count, rank = np.zeros(n, dtype=np.float32), np.empty(n, dtype=np.float32)
    for s in range(n_slots):
        for t in range(n):
            count[t] += np.float32(seen[s, t] > 0)
    for k in range(3):
        for t in range(n):
            U[k, t] = np.float32(0) if count[t] > 0 else np.float32(-1)
        for s in range(n_slots):
            rank[:] = 0
            for r in range(n_slots):
                if r != s:
                    _add_smaller(planes[r, k], planes[s, k], r < s, rank)
            _add_middle(planes[s, k], seen[s], rank, count, U[k])


@numba.njit(nogil=True, **COMPILED_ONLY)
def _add_smaller(values, than, or_equal, rank):
    """Add 1 to `rank` where values < than, or where they are equal if that counts, too."""
    for t in range(rank.shape[0]):
        is_equal = or_equal and values[t] == than[t]
        rank[t] += np.float32(values[t] < than[t] or is_equal)


@numba.njit(nogil=True, **COMPILED_ONLY)
def _add_middle(values, seen, rank, count, median):
    """Add half of each value that is the lower, and half of each that is the upper, of the `count` middle ones."""
    half = np.float32(0.5)
    for t in range(rank.shape[0]):
        lower, upper = np.floor(half * (count[t] - 1)), np.floor(half * count[t])
        share = np.float32(rank[t] == lower) + np.float32(rank[t] == upper)
        median[t] += half * share * values[t] if seen[t] > 0 else np.float32(0)


@numba.njit(nogil=True, inline="always")
def _trust(weight, r, g, b):
    """Weight of a texel times the Geman-McClure weight of its residual."""
    one = np.float32(1)
    inverse = one / (one + (r * r + g * g + b * b) * np.float32(1 / (3 * OUTLIER**2)))
    return weight * inverse * inverse


@numba.njit(nogil=True, fastmath=True, **COMPILED_ONLY)
def _gain(colors, weight, n, U, gain):
    """The gain of a photo (3, n) on the image U, or as it was if the photo sees no texel."""
    above, below = np.float32(0), np.float32(0)
    for t in range(n):
        trust = _trust(
            weight[t], colors[0, t] - gain * U[0, t], colors[1, t] - gain * U[1, t], colors[2, t] - gain * U[2, t]
        )
        above += trust * (U[0, t] * colors[0, t] + U[1, t] * colors[1, t] + U[2, t] * colors[2, t])
        below += trust * (U[0, t] * U[0, t] + U[1, t] * U[1, t] + U[2, t] * U[2, t])
    if below <= 0:
        return gain
    return min(max(above / below, np.float32(1 / LARGEST_GAIN)), np.float32(LARGEST_GAIN))


@numba.njit(nogil=True, fastmath=True, **COMPILED_ONLY)
def _add_image(colors, weight, n, U, gain, sums):
    """Add a photo's part of the numerators of U and, last, of their common denominator to `sums` (4, n)."""
    for t in range(n):
        trust = gain * _trust(
            weight[t], colors[0, t] - gain * U[0, t], colors[1, t] - gain * U[1, t], colors[2, t] - gain * U[2, t]
        )
        sums[0, t] += trust * colors[0, t]
        sums[1, t] += trust * colors[1, t]
        sums[2, t] += trust * colors[2, t]
        sums[3, t] += trust * gain


@numba.njit(nogil=True, **COMPILED_ONLY)
def _hidden_texel(colors, weights, gain, texel):
    """Fit one texel (3,) to the photos (s, 3) whose faces lie in front of it, if there are any."""
    total = np.float32(0)
    for s in range(weights.shape[0]):
        total += gain[s] * gain[s] if weights[s] == 1 else np.float32(0)
    if total > 0:
        for k in range(3):
            texel[k] = 0
            for s in range(weights.shape[0]):
                if weights[s] == 1:
                    texel[k] += gain[s] * colors[s, k] / total


@numba.njit(nogil=True, **COMPILED_ONLY)
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

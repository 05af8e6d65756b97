"""The robust norm of residuals, and the residual statistics that determine its scale."""

import numpy as np

from fairing.kernels.compiled import fast, never_inline, plain
from fairing.kernels.data import NormLoop
from fairing.kernels.rows import STRIP

HISTOGRAM_BINS = 2048
HISTOGRAM_STEP = 0.0625  # grey levels


@fast
def weigh(residual, norm, table, squared_scale, weights):
    """Robust weight rho'(e) / e of every residual, into `weights`; returns the sum of rho(e).

    The built-in norms behave as e^2 / sigma^2 near zero.

    Args:
        residual: (p,) float32, grey levels.
        norm: a `NormLoop`, as an integer.
        table: (2, t + 1) float32: rho(x) / x^2 and rho'(x) / x at v = 1 / (1 + x) = 0, 1 / t ... 1, with x = |e| / sigma; used with
            `NormLoop.TABLE`, linear in between.
        squared_scale: sigma squared, grey levels^2 (sigma itself for the printed Geman-McClure form).
        weights: (p,) float32, out.
    """
    never_inline()  # pyright: ignore[reportCallIssue]
    s2 = np.float32(squared_scale)
    total = np.float32(0)
    two, one = np.float32(2), np.float32(1)
    if norm == NormLoop.GEMAN_MCCLURE:
        for t in range(residual.shape[0]):
            squared = residual[t] * residual[t]
            inverse = one / (s2 + squared)
            total += squared * inverse
            weights[t] = two * s2 * inverse * inverse
    elif norm == NormLoop.HUBER:
        inverse = one / s2
        sigma = np.sqrt(s2)
        for t in range(residual.shape[0]):
            size = abs(residual[t])
            total += size * size if size <= sigma else two * size * sigma - s2
            weights[t] = two * inverse * min(one, sigma / max(size, sigma))
        total *= inverse
    elif norm == NormLoop.TABLE:
        inverse = one / s2
        sigma = np.sqrt(s2)
        intervals = np.float32(table.shape[1] - 1)
        last = np.int32(table.shape[1] - 2)
        for t in range(residual.shape[0]):
            size = abs(residual[t])
            place = intervals * sigma / (sigma + size)
            k = max(np.int32(0), min(np.int32(place), last))  # also where the residual is not finite
            part = place - np.float32(k)
            total += (table[0, k] + part * (table[0, k + 1] - table[0, k])) * size * size
            weights[t] = inverse * (table[1, k] + part * (table[1, k + 1] - table[1, k]))
        total *= inverse
    else:
        inverse = one / s2
        for t in range(residual.shape[0]):
            total += residual[t] * residual[t]
            weights[t] = two * inverse
        total *= inverse
    return total


@plain
def residual_statistics(residual, mask_weight, masked, index, found):
    """Largest and median absolute residual, grey levels, of the samples that count, into found[0] and found[1]."""
    n, p = residual.shape
    histograms = np.zeros((4, HISTOGRAM_BINS + 1), dtype=np.int32)
    for i in range(n):
        for start in range(0, p, STRIP):
            stop = min(start + STRIP, p)
            bins = index[: stop - start]
            found[0] = max(found[0], _bins(residual[i, start:stop], bins))
            if masked:
                for t in range(bins.shape[0]):
                    if mask_weight[i, start + t] == 0:
                        bins[t] = HISTOGRAM_BINS  # masked residuals are zero, so they never are the largest
            _count(bins, histograms)
    found[1] = _median_from_histograms(histograms)


@fast
def _bins(residual, index):
    """Histogram bins of absolute residuals; returns the largest."""
    per_level, last = np.float32(1 / HISTOGRAM_STEP), np.float32(HISTOGRAM_BINS - 1)
    largest = np.float32(0)
    for t in range(residual.shape[0]):
        size = abs(residual[t])
        largest = max(largest, size)
        index[t] = np.int32(min(size * per_level, last))
    return largest


@plain
def _count(index, histograms):
    """Count bins in four histograms in turn, so that a count does not wait for that of a neighbour in the same bin."""
    for t in range(index.shape[0]):
        histograms[t & 3, index[t]] += 1


@plain
def _median_from_histograms(histograms):
    """Median, grey levels, interpolated linearly within its bin."""
    total, below = 0.0, 0.0
    for b in range(HISTOGRAM_BINS):
        total += histograms[0, b] + histograms[1, b] + histograms[2, b] + histograms[3, b]
    half = total / 2
    for b in range(HISTOGRAM_BINS):
        count = float(histograms[0, b] + histograms[1, b] + histograms[2, b] + histograms[3, b])
        if below + count >= half and count > 0:
            return HISTOGRAM_STEP * (b + (half - below) / count)
        below += count
    return HISTOGRAM_STEP * HISTOGRAM_BINS

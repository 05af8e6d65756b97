"""Interpolation of photos: bilinear or cubic B-spline, values and exact gradients at a strip of coordinates.

A strip is read in passes (addresses, loads, interpolation), because the loads are the only part that does not vectorise.
Neighbouring pixels are copied in one load (ledger: pixel copies).
"""

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from fairing.kernels.compiled import by_sample, fast


def _pixel_copier(count):
    """A compiled function (target, t, source, i) that copies `count` neighbouring float32 by one load and one store.

    LLVM does not merge these loads itself.
    """

    @intrinsic
    def copy(typing_context, target, t, source, i):
        def generate(context, builder, signature, arguments):
            run = ir.VectorType(ir.FloatType(), count).as_pointer()
            places = [
                builder.bitcast(builder.gep(context.make_array(kind)(context, builder, array).data, [at]), run)
                for kind, array, at in ((target, arguments[0], arguments[1]), (source, arguments[2], arguments[3]))
            ]
            store = builder.store(builder.load(places[1], align=4), places[0])
            store.align = 4
            return context.get_dummy_value()

        return types.void(target, types.int64, source, types.int64), generate

    return copy


_copy_two, _copy_four = _pixel_copier(2), _pixel_copier(4)


@fast
def addresses(x, y, stride, index):
    """Flat index of the pixel above and to the left of each position, into `index` (n,) int32."""
    step = np.int32(stride)
    for s in range(x.shape[0]):
        index[s] = np.int32(y[s]) * step + np.int32(x[s])


@fast
def load_bilinear(image, stride, index, taps):
    """Copy the 2 x 2 pixels of each position into two rows of `taps`."""
    upper, lower = taps[0], taps[1]
    for s in range(index.shape[0]):
        i = np.int64(index[s])
        _copy_two(upper, 2 * s, image, i)  # pyright: ignore[reportCallIssue]
        _copy_two(lower, 2 * s, image, i + stride)


@by_sample
def bilinear(x, y, taps, cell, gx, gy):
    """Value and exact gradient of the bilinear surface at a strip of coordinates."""
    upper, lower = taps[0], taps[1]
    for s in range(x.shape[0]):
        fx, fy = x[s] - np.floor(x[s]), y[s] - np.floor(y[s])
        left = np.uint64(s) * np.uint64(2)  # unsigned indices skip the test for negative ones
        right = left + np.uint64(1)
        top, bottom = upper[right] - upper[left], lower[right] - lower[left]
        above = upper[left] + fx * top
        down = lower[left] + fx * bottom - above
        cell[s] = above + fy * down
        gx[s] = top + fy * (bottom - top)
        gy[s] = down


@fast
def load_cubic(image, stride, index, taps):
    """Copy the 4 x 4 pixels of each position into four rows of `taps`."""
    row0, row1, row2, row3 = taps[0], taps[1], taps[2], taps[3]
    for s in range(index.shape[0]):
        i = np.int64(index[s]) - stride - 1
        _copy_four(row0, 4 * s, image, i)  # pyright: ignore[reportCallIssue]
        _copy_four(row1, 4 * s, image, i + stride)
        _copy_four(row2, 4 * s, image, i + 2 * stride)
        _copy_four(row3, 4 * s, image, i + 3 * stride)


@by_sample
def _spline(f):
    """Weights of four neighbouring coefficients of the cubic B-spline, and their derivatives, at fraction f."""
    one, two, three, four, sixth, half = (
        np.float32(1), np.float32(2), np.float32(3), np.float32(4), np.float32(1 / 6), np.float32(0.5),
    )  # fmt: skip
    r = one - f
    a, b, d = r * r * r * sixth, (four - three * f * f * (two - f)) * sixth, f * f * f * sixth
    da, db, dd = -half * r * r, half * f * (three * f - four), half * f * f
    return a, b, one - a - b - d, d, da, db, -da - db - dd, dd


@by_sample
def cubic(x, y, taps, cell, gx, gy):
    """Value and exact gradient of the cubic B-spline at a strip of coordinates."""
    row0, row1, row2, row3 = taps[0], taps[1], taps[2], taps[3]
    for s in range(x.shape[0]):
        ax, bx, cx, dx, dax, dbx, dcx, ddx = _spline(x[s] - np.floor(x[s]))
        ay, by, cy, dy, day, dby, dcy, ddy = _spline(y[s] - np.floor(y[s]))
        i = np.uint64(s) * np.uint64(4)
        j, k, m = i + np.uint64(1), i + np.uint64(2), i + np.uint64(3)
        # Down the columns first, then along the row.
        v0 = ay * row0[i] + by * row1[i] + cy * row2[i] + dy * row3[i]
        v1 = ay * row0[j] + by * row1[j] + cy * row2[j] + dy * row3[j]
        v2 = ay * row0[k] + by * row1[k] + cy * row2[k] + dy * row3[k]
        v3 = ay * row0[m] + by * row1[m] + cy * row2[m] + dy * row3[m]
        w0 = day * row0[i] + dby * row1[i] + dcy * row2[i] + ddy * row3[i]
        w1 = day * row0[j] + dby * row1[j] + dcy * row2[j] + ddy * row3[j]
        w2 = day * row0[k] + dby * row1[k] + dcy * row2[k] + ddy * row3[k]
        w3 = day * row0[m] + dby * row1[m] + dcy * row2[m] + ddy * row3[m]
        cell[s] = ax * v0 + bx * v1 + cx * v2 + dx * v3
        gx[s] = dax * v0 + dbx * v1 + dcx * v2 + ddx * v3
        gy[s] = ax * w0 + bx * w1 + cx * w2 + dx * w3

"""The hot loops, compiled: sample the cells of a face, fit its eigenspace, weigh the residual, build the normal equations.

One call works through a list of faces. Every face is computed on its own, in a fixed order of operations, and written to
its own place, so that the result does not depend on how the list is shared among threads. Cells are float32; sums over
pairs of cells, energies and normal equations are collected in float64.

What makes the loops fast, found by measuring:
- A strip of samples is read in passes (coordinates, addresses, loads, interpolation), because the loads are the only part that
  does not vectorise. Neighbouring pixels are copied in one load: 0.54 ns a sample against 1.08 one by one.
- `error_model="numpy"`: Python's check for division by zero is a branch, and a loop with a branch does not vectorise
  (coordinates 0.21 ns a sample against 2, robust weights 0.12 against 1.2).
- Loops run over `range(n)` of slices, which spares the test for negative indices; sums of several rows are made in one pass.
- Lost: hat * G and the basis taken off in one pass instead of two (2.96 ns a sample for the normal equations, 2.95 before).
- Eigenspace and normal equations go through a face in blocks of BLOCK samples, so that what a block needs stays in cache.
"""

from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

STRIP = 512
BLOCK = 1024  # normal equations: 4.0 ns a sample with 256 (hats not yet on the basis), 2.9 with 512, 2.7 with 1024
HISTOGRAM_BINS = 2048
HISTOGRAM_STEP = 0.0625  # grey levels
FILL_ITERATIONS = 3

SOLVER_NONE, SOLVER_ALTERNATING, SOLVER_VARIABLE_PROJECTION = 0, 1, 2
NORM_GEMAN_MCCLURE, NORM_HUBER, NORM_LEAST_SQUARES = 0, 1, 2

# Reassociation lets sums vectorise; the code that results is fixed, so runs repeat to the bit on one kind of processor.
_FAST = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}
# Without "numpy" every division is a branch.
_plain = njit(cache=True, nogil=True, error_model="numpy")
_fast = njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST)
# For what sums nothing up. numba optimises a function once more when it links it from its cache: reassociated again, the
# cubic sampler rounded differently in `show_face` than in `evaluate_faces` compiled earlier.
_by_sample = njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST - {"reassoc"})


@intrinsic
def _stay_one_function(typing_context):
    """Keep LLVM from inlining the function this stands in.

    Inlined into `evaluate_faces` and `show_face` it would be optimised for each, and round differently: their energies are
    to agree to the bit.
    """

    def generate(context, builder, signature, arguments):
        builder.function.attributes.add("noinline")
        return context.get_dummy_value()

    return types.void(), generate


class KernelData(NamedTuple):
    """What stays fixed while vertices move (built by `fairing.cells.CellContext`). P pairs of face and view, V views.

    Attributes:
        faces: (m, 3) int64.
        image_from_world: (V, 3, 4) float64.
        pixels: flat float32: the planes (channels, height, width) of blurred photos, or of parts of them, one after another.
        channels: planes a photo.
        pair_start: (m + 1,) int64: the pairs of face f are pair_start[f] : pair_start[f + 1].
        pair_view: (P,) int64.
        pair_base: (P,) int64: where the pair's photo, or part of it, starts in `pixels`.
        pair_frame: (P, 4) int64: that part's left and top pixel, width and height.
        pair_weight: (P,) float64: photo pixels a cell sample stands for, times the photo's weight.
        pair_mask: (P,) int64: where the samples' mask starts in `masks`, or -1 if every sample counts.
        masks: flat uint8.
        face_dimensions: (m,) int64: k; 0 for a face that takes no part.
        face_inset: (m,) float64: border left out, as a fraction of the face's height.
        face_grid: (m,) int64: which cell grid.
        grid_start: (g + 1,) int64.
        ramp: (2, total) float32: barycentric weights of corner 0 and 1 at the cells' samples.
        affine, cubic, remove_bias, centered: bool.
        norm: NORM_*.
    """

    faces: np.ndarray
    image_from_world: np.ndarray
    pixels: np.ndarray
    channels: int
    pair_start: np.ndarray
    pair_view: np.ndarray
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


@_by_sample
def _coordinates(q, ramp0, ramp1, limits, x, y, w):
    """Photo coordinates of a strip of samples; q (3, 3): the corners' homogeneous pixels, near the origin."""
    x2, y2, w2 = np.float32(q[2, 0]), np.float32(q[2, 1]), np.float32(q[2, 2])
    x0, y0, w0 = np.float32(q[0, 0]) - x2, np.float32(q[0, 1]) - y2, np.float32(q[0, 2]) - w2
    x1, y1, w1 = np.float32(q[1, 0]) - x2, np.float32(q[1, 1]) - y2, np.float32(q[1, 2]) - w2
    x_low, x_high, y_low, y_high = limits
    for s in range(ramp0.shape[0]):
        a, b = ramp0[s], ramp1[s]
        inverse = np.float32(1) / (w2 + a * w0 + b * w1)
        w[s] = inverse
        x[s] = min(max((x2 + a * x0 + b * x1) * inverse, x_low), x_high)
        y[s] = min(max((y2 + a * y0 + b * y1) * inverse, y_low), y_high)


def _pixel_copier(count):
    """A compiled function (target, t, source, i): copies `count` neighbouring float32 by one load and one store.

    LLVM does not merge loads whose neighbourhood it would have to prove.
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


@_fast
def _addresses(x, y, stride, index):
    """Where the pixel up and left of each place is."""
    step = np.int32(stride)
    for s in range(x.shape[0]):
        index[s] = np.int32(y[s]) * step + np.int32(x[s])


@_fast
def _load_bilinear(image, stride, index, taps):
    upper, lower = taps[0], taps[1]
    for s in range(index.shape[0]):
        i = np.int64(index[s])
        _copy_two(upper, 2 * s, image, i)  # pyright: ignore[reportCallIssue]
        _copy_two(lower, 2 * s, image, i + stride)


@_by_sample
def _bilinear(x, y, taps, cell, gx, gy):
    """Value and exact gradient of the bilinear surface at a strip of coordinates."""
    upper, lower = taps[0], taps[1]
    for s in range(x.shape[0]):
        fx, fy = x[s] - np.floor(x[s]), y[s] - np.floor(y[s])
        left = np.uint64(s) * np.uint64(2)  # an unsigned index needs no test for being negative
        right = left + np.uint64(1)
        top, bottom = upper[right] - upper[left], lower[right] - lower[left]
        above = upper[left] + fx * top
        down = lower[left] + fx * bottom - above
        cell[s] = above + fy * down
        gx[s] = top + fy * (bottom - top)
        gy[s] = down


@_fast
def _load_cubic(image, stride, index, taps):
    row0, row1, row2, row3 = taps[0], taps[1], taps[2], taps[3]
    for s in range(index.shape[0]):
        i = np.int64(index[s]) - stride - 1
        _copy_four(row0, 4 * s, image, i)  # pyright: ignore[reportCallIssue]
        _copy_four(row1, 4 * s, image, i + stride)
        _copy_four(row2, 4 * s, image, i + 2 * stride)
        _copy_four(row3, 4 * s, image, i + 3 * stride)


@_by_sample
def _spline(f):
    """Weights of four neighbouring coefficients of the cubic B-spline, and their derivatives, at fraction f."""
    one, two, three, four, sixth, half = (
        np.float32(1), np.float32(2), np.float32(3), np.float32(4), np.float32(1 / 6), np.float32(0.5),
    )  # fmt: skip
    r = one - f
    a, b, d = r * r * r * sixth, (four - three * f * f * (two - f)) * sixth, f * f * f * sixth
    da, db, dd = -half * r * r, half * f * (three * f - four), half * f * f
    return a, b, one - a - b - d, d, da, db, -da - db - dd, dd


@_by_sample
def _cubic(x, y, taps, cell, gx, gy):
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


@_fast
def _to_affine(gx, gy, jx, jy, out):
    for s in range(gx.shape[0]):
        out[s] = gx[s] * jx + gy[s] * jy


@_fast
def _to_homography(gx, gy, x, y, w, J, out0, out1, out2):
    """Derivative by the world axes of a point seen through a homography at a strip of coordinates."""
    a0, a1, a2, b0, b1, b2, c0, c1, c2 = (
        J[0, 0], J[1, 0], J[2, 0], J[0, 1], J[1, 1], J[2, 1], J[3, 0], J[4, 0], J[5, 0],
    )  # fmt: skip
    for s in range(gx.shape[0]):
        u, v = gx[s] * w[s], gy[s] * w[s]
        r = u * x[s] + v * y[s]
        out0[s] = u * a0 + v * b0 - r * c0
        out1[s] = u * a1 + v * b1 - r * c1
        out2[s] = u * a2 + v * b2 - r * c2


@_fast
def _dot(a, b):
    total = np.float32(0)
    for s in range(a.shape[0]):
        total += a[s] * b[s]
    return total


@_fast
def _dot_three(a, b0, b1, b2):
    total0, total1, total2 = np.float32(0), np.float32(0), np.float32(0)
    for s in range(a.shape[0]):
        total0 += a[s] * b0[s]
        total1 += a[s] * b1[s]
        total2 += a[s] * b2[s]
    return total0, total1, total2


@_fast
def _add_rows(target, factors, rows, start):
    """target += sum of factors[m] * rows[m, start : ...], four rows in a pass.

    `start` is an argument because numba does not know of rows[:, start:] that its rows are contiguous.
    """
    stop = start + target.shape[0]
    m, left = 0, factors.shape[0]
    while left > 0:
        f0, row0 = factors[m], rows[m, start:stop]
        if left == 1:
            for s in range(target.shape[0]):
                target[s] += f0 * row0[s]
            return
        f1, row1 = factors[m + 1], rows[m + 1, start:stop]
        if left == 2:
            for s in range(target.shape[0]):
                target[s] += f0 * row0[s] + f1 * row1[s]
            return
        f2, row2 = factors[m + 2], rows[m + 2, start:stop]
        if left == 3:
            for s in range(target.shape[0]):
                target[s] += f0 * row0[s] + f1 * row1[s] + f2 * row2[s]
            return
        f3, row3 = factors[m + 3], rows[m + 3, start:stop]
        for s in range(target.shape[0]):
            target[s] += f0 * row0[s] + f1 * row1[s] + f2 * row2[s] + f3 * row3[s]
        m, left = m + 4, left - 4


@_plain
def _corner_pixels(data, vertices, face, view, q):
    """Homogeneous pixels of a face's corners with weight near 1 where the affine warp asks for it."""
    P = data.image_from_world[view]
    for j in range(3):
        v = data.faces[face, j]
        for r in range(3):
            q[j, r] = P[r, 0] * vertices[v, 0] + P[r, 1] * vertices[v, 1] + P[r, 2] * vertices[v, 2] + P[r, 3]
        if data.affine:
            q[j, 0] /= q[j, 2]
            q[j, 1] /= q[j, 2]
            q[j, 2] = 1.0


@_plain
def sample_face(data, vertices, face, corner, want_gradient, cells, G, hats, strip, taps, index):
    """Cells of a face, and the derivative of every sample with respect to the face's corners.

    de/d eta = grad I . (hat * J_image_wrt_point), Eq. 5-11 with the image's gradient; hat is kept apart, in `hats`.

    Args:
        corner: 0, 1 or 2 for the derivative by one corner, -1 for all three.
        want_gradient: fill G.
        cells: (n, p * channels) float32, out.
        G: (c, n, p * channels) float32, out: c = 3 world axes, or 9 with the affine warp and corner -1.
        hats: (3, p * channels) float32, out: barycentric weights of the three corners.
        strip, taps, index: scratch.

    Returns:
        False if a corner lies behind a camera (nothing is usable then).
    """
    _stay_one_function()  # pyright: ignore[reportCallIssue]
    grid = data.face_grid[face]
    first, last = data.grid_start[grid], data.grid_start[grid + 1]
    p = last - first
    inset = data.face_inset[face]
    shrink = np.float32(1 - 3 * inset)
    shift = np.float32(inset)
    for channel in range(data.channels):
        for s in range(p):
            a, b = shift + shrink * data.ramp[0, first + s], shift + shrink * data.ramp[1, first + s]
            t = channel * p + s
            hats[0, t], hats[1, t], hats[2, t] = a, b, np.float32(1) - a - b
    q = np.empty((3, 3))
    for i in range(data.pair_start[face + 1] - data.pair_start[face]):
        pair = data.pair_start[face] + i
        view = data.pair_view[pair]
        _corner_pixels(data, vertices, face, view, q)
        if q[0, 2] <= 0 or q[1, 2] <= 0 or q[2, 2] <= 0:
            return False
        # The corner nearest the origin, less two pixels, becomes the origin: float32 then resolves 1e-5 pixels.
        left, top, width, height = data.pair_frame[pair]
        ox = np.floor(min(q[0, 0] / q[0, 2], q[1, 0] / q[1, 2], q[2, 0] / q[2, 2])) - 2
        oy = np.floor(min(q[0, 1] / q[0, 2], q[1, 1] / q[1, 2], q[2, 1] / q[2, 2])) - 2
        ox = min(max(ox, left), left + width - 5.0)
        oy = min(max(oy, top), top + height - 5.0)
        scale = 1 / q[2, 2]
        for j in range(3):
            q[j, 0] = (q[j, 0] - ox * q[j, 2]) * scale
            q[j, 1] = (q[j, 1] - oy * q[j, 2]) * scale
            q[j, 2] *= scale
        limits = (
            np.float32(1), np.float32(left + width - 2.001 - ox),
            np.float32(1), np.float32(top + height - 2.001 - oy),
        )  # fmt: skip
        P = data.image_from_world[view]
        J = np.empty((9, 2), dtype=np.float32)
        if data.affine:
            for j in range(3):
                v = data.faces[face, j]
                depth = P[2, 3]
                for b in range(3):
                    depth += P[2, b] * vertices[v, b]
                for b in range(3):
                    J[3 * j + b, 0] = (P[0, b] - (q[j, 0] + ox) * P[2, b]) / depth
                    J[3 * j + b, 1] = (P[1, b] - (q[j, 1] + oy) * P[2, b]) / depth
        else:
            for b in range(3):
                J[b, 0] = (P[0, b] - ox * P[2, b]) * scale
                J[b, 1] = (P[1, b] - oy * P[2, b]) * scale
                J[b + 3, 0] = P[2, b] * scale
        for channel in range(data.channels):
            plane = data.pair_base[pair] + channel * width * height + (np.int64(oy) - top) * width + np.int64(ox) - left
            image = data.pixels[plane:]
            for start in range(0, p, STRIP):
                count = min(STRIP, p - start)
                x, y, w = strip[0, :count], strip[1, :count], strip[2, :count]
                gx, gy = strip[3, :count], strip[4, :count]
                t = channel * p + start
                _coordinates(q, hats[0, start : start + count], hats[1, start : start + count], limits, x, y, w)
                cell = cells[i, t : t + count]
                _addresses(x, y, width, index[:count])
                if data.cubic:
                    _load_cubic(image, width, index[:count], taps)
                    _cubic(x, y, taps, cell, gx, gy)
                else:
                    _load_bilinear(image, width, index[:count], taps)
                    _bilinear(x, y, taps, cell, gx, gy)
                if not want_gradient:
                    continue
                if data.affine:
                    low = 0 if corner < 0 else 3 * corner
                    for c in range(9 if corner < 0 else 3):
                        _to_affine(gx, gy, J[low + c, 0], J[low + c, 1], G[c, i, t : t + count])
                else:
                    out0, out1, out2 = G[0, i, t : t + count], G[1, i, t : t + count], G[2, i, t : t + count]
                    _to_homography(gx, gy, x, y, w, J, out0, out1, out2)
    return True


@_plain
def _apply_masks(data, face, p, cells, mask_weight, G, components):
    """Zero the derivative where a sample is masked; returns whether any is, and fills mask_weight (n, p * channels)."""
    any_masked = False
    n = data.pair_start[face + 1] - data.pair_start[face]
    for i in range(n):
        if data.pair_mask[data.pair_start[face] + i] >= 0:
            any_masked = True
    if not any_masked:
        return False
    for i in range(n):
        start = data.pair_mask[data.pair_start[face] + i]
        for channel in range(data.channels):
            for s in range(p):
                mask_weight[i, channel * p + s] = 1 if start < 0 or data.masks[start + s] else 0
        if start >= 0:
            for c in range(components):
                derivative, weight = G[c, i], mask_weight[i]
                for t in range(p * data.channels):
                    derivative[t] *= weight[t]
    return True


@_fast
def _remove_means(cells, mask_weight, masked):
    """Subtract from each cell its mean over the samples that count (the bias between photos)."""
    _stay_one_function()  # pyright: ignore[reportCallIssue]
    for i in range(cells.shape[0]):
        cell = cells[i]
        total, count = 0.0, float(cell.shape[0])
        if masked:
            weight = mask_weight[i]
            count = 0.0
            for t in range(cell.shape[0]):
                total += weight[t] * cell[t]
                count += weight[t]
        else:
            for t in range(cell.shape[0]):
                total += cell[t]
        mean = np.float32(total / max(count, 1.0))
        for t in range(cell.shape[0]):
            cell[t] -= mean


@_fast
def _take_mean_off(cells, mean):
    """Subtract the mean cell from all; mean: (p,) scratch."""
    n = cells.shape[0]
    mean[:] = 0
    _add_rows(mean, np.full(n, np.float32(1 / n)), cells, 0)
    for i in range(n):
        cell = cells[i]
        for t in range(cell.shape[0]):
            cell[t] -= mean[t]


@_plain
def _gram_matrix(cells, gram):
    """gram (n, n) float64 = cells cells^T, block by block of samples."""
    n, p = cells.shape
    gram[:] = 0
    for start in range(0, p, BLOCK):
        stop = min(start + BLOCK, p)
        for i in range(n):
            cell, j = cells[i, start:stop], 0
            while j + 2 <= i:
                products = _dot_three(cell, cells[j, start:stop], cells[j + 1, start:stop], cells[j + 2, start:stop])
                for b in range(3):
                    gram[i, j + b] += products[b]
                j += 3
            while j <= i:
                gram[i, j] += _dot(cell, cells[j, start:stop])
                j += 1
    for i in range(n):
        for j in range(i):
            gram[j, i] = gram[i, j]


@_plain
def _decompose(cells, k, V, singular_values):
    """First k left singular vectors of the cells through the n x n Gram matrix; signs fixed so that runs compare.

    Fills V (n, k); returns the factors (k, n) that make the basis images out of the cells.
    """
    n = cells.shape[0]
    gram = np.empty((n, n))
    _gram_matrix(cells, gram)
    values, vectors = np.linalg.eigh(gram)
    for m in range(n):
        singular_values[m] = np.sqrt(max(values[n - 1 - m], 0.0))
    factors = np.zeros((k, n), dtype=np.float32)
    for m in range(k):
        column = vectors[:, n - 1 - m]
        largest = 0
        for i in range(n):
            if abs(column[i]) > abs(column[largest]) * (1 + 1e-9):
                largest = i
        sign = 1.0 if column[largest] >= 0 else -1.0
        if singular_values[m] > 1e-6 * singular_values[0] and singular_values[m] > 0:
            for i in range(n):
                V[i, m] = sign * column[i]
                factors[m, i] = V[i, m] / singular_values[m]
        else:
            V[:, m] = 0
    return factors


@_plain
def fit_face(cells, k, centered, mask_weight, masked, basis, V, singular_values, residual):
    """Eigenspace and residual of one face's cells (n, p).

    residual = I - U c (Eq. 1). Masked samples are filled from the reconstruction itself, starting from the mean of the other
    cells: a fixed number of rounds, so that the energy is a function of the vertices alone. Their residual is zero.
    Centred: the mean cell is taken off `cells` in place first. The last row of the basis, (k + 1, p), is scratch.
    """
    _stay_one_function()  # pyright: ignore[reportCallIssue]
    n, p = cells.shape
    if masked:
        _fill_with_mean(cells, mask_weight, residual)
    back = np.empty((n, k), dtype=np.float32)
    for _ in range(FILL_ITERATIONS + 1 if masked else 1):
        if centered:
            _take_mean_off(cells, basis[k])
        factors = _decompose(cells, k, V, singular_values)
        for i in range(n):
            for m in range(k):
                back[i, m] = -singular_values[m] * V[i, m]
        for start in range(0, p, BLOCK):
            stop = min(start + BLOCK, p)
            for m in range(k):
                basis[m, start:stop] = 0
                _add_rows(basis[m, start:stop], factors[m], cells, start)
            for i in range(n):
                residual[i, start:stop] = cells[i, start:stop]
                _add_rows(residual[i, start:stop], back[i], basis, start)
        if masked:
            _fill_with_reconstruction(cells, mask_weight, residual)


@_fast
def _fill_with_mean(cells, mask_weight, scratch):
    """Give masked samples the mean of the other cells; scratch: (n, p) with n at least 2, overwritten."""
    n, p = cells.shape
    total, count = scratch[0], scratch[1]
    total[:] = 0
    count[:] = 0
    for i in range(n):
        cell, weight = cells[i], mask_weight[i]
        for t in range(p):
            total[t] += weight[t] * cell[t]
            count[t] += weight[t]
    for t in range(p):
        total[t] /= max(count[t], np.float32(1))
    for i in range(n):
        cell, weight = cells[i], mask_weight[i]
        for t in range(p):
            cell[t] = weight[t] * cell[t] + (np.float32(1) - weight[t]) * total[t]


@_fast
def _fill_with_reconstruction(cells, mask_weight, residual):
    """Give masked samples their reconstruction; their residual becomes zero."""
    for i in range(cells.shape[0]):
        cell, weight, rest = cells[i], mask_weight[i], residual[i]
        for t in range(cell.shape[0]):
            cell[t] -= (np.float32(1) - weight[t]) * rest[t]
            rest[t] *= weight[t]


@_fast
def _weigh(residual, norm, scale, weights):
    """Robust weight rho'(e) / e of every residual; returns the sum of rho(e).

    `scale` is sigma squared (sigma itself for the printed Geman-McClure form); all norms behave as e^2 / sigma^2 near zero.
    """
    _stay_one_function()  # pyright: ignore[reportCallIssue]
    s2 = np.float32(scale)
    total = np.float32(0)
    two, one = np.float32(2), np.float32(1)
    if norm == NORM_GEMAN_MCCLURE:
        for t in range(residual.shape[0]):
            squared = residual[t] * residual[t]
            inverse = one / (s2 + squared)
            total += squared * inverse
            weights[t] = two * s2 * inverse * inverse
    elif norm == NORM_HUBER:
        inverse = one / s2
        sigma = np.sqrt(s2)
        for t in range(residual.shape[0]):
            size = abs(residual[t])
            total += (size * size if size <= sigma else two * size * sigma - s2) * inverse
            weights[t] = two * inverse * min(one, sigma / max(size, sigma))
    else:
        inverse = one / s2
        for t in range(residual.shape[0]):
            total += residual[t] * residual[t] * inverse
            weights[t] = two * inverse
    return total


@_fast
def _times(a, b, out):
    for t in range(out.shape[0]):
        out[t] = a[t] * b[t]


@_fast
def _sum(a):
    total = np.float32(0)
    for t in range(a.shape[0]):
        total += a[t]
    return total


@_fast
def _subtract(a, number):
    for t in range(a.shape[0]):
        a[t] -= number


@_fast
def _sums_of_three(d0, d1, d2, weight, residual):
    """The nine sums of one corner in one pass: g by axis, and H's lower triangle by rows."""
    zero = np.float32(0)
    g0, g1, g2, h00, h10, h11, h20, h21, h22 = zero, zero, zero, zero, zero, zero, zero, zero, zero
    for t in range(d0.shape[0]):
        w0, w1, w2 = weight[t] * d0[t], weight[t] * d1[t], weight[t] * d2[t]
        g0 += w0 * residual[t]
        g1 += w1 * residual[t]
        g2 += w2 * residual[t]
        h00 += w0 * d0[t]
        h10 += w1 * d0[t]
        h11 += w1 * d1[t]
        h20 += w2 * d0[t]
        h21 += w2 * d1[t]
        h22 += w2 * d2[t]
    return g0, g1, g2, h00, h10, h11, h20, h21, h22


@_plain
def _project_views(G, start, stop, forth, back, projected):
    """G (n, p) becomes (I - V V^T) G in a block of samples; forth: V^T, back: -V; projected: (k, BLOCK) scratch."""
    for m in range(forth.shape[0]):
        row = projected[m, : stop - start]
        row[:] = 0
        _add_rows(row, forth[m], G, start)
    for i in range(G.shape[0]):
        _add_rows(G[i, start:stop], back[i], projected, 0)


@_plain
def _add_dots(row, axes, start, sums):
    """sums (n, 3) += the products of a row with three components of the derivative, for each view."""
    stop = start + row.shape[0]
    for i in range(sums.shape[0]):
        products = _dot_three(row, axes[0, i, start:stop], axes[1, i, start:stop], axes[2, i, start:stop])
        sums[i, 0] += products[0]
        sums[i, 1] += products[1]
        sums[i, 2] += products[2]


@_plain
def _columns(G, hats, first, i, start, stop, columns):
    """hat * G of view i by the corners' axes, for a block of samples."""
    for j in range(columns.shape[0] // 3):
        hat = hats[first + j, start:stop]
        for b in range(3):
            source = G[3 * j + b if G.shape[0] == 9 else b, i, start:stop]
            _times(hat, source, columns[3 * j + b, : stop - start])


@_plain
def _add_products(columns, width, weight, residual, H, g, scaled):
    """Add sum of w D_a D_b and w e D_a of a block, `width` samples, to the lower triangle of H and to g."""
    rows = columns.shape[0]
    if rows == 3:
        sums = _sums_of_three(columns[0, :width], columns[1, :width], columns[2, :width], weight, residual)
        g[0] += sums[0]
        g[1] += sums[1]
        g[2] += sums[2]
        H[0, 0] += sums[3]
        H[1, 0] += sums[4]
        H[1, 1] += sums[5]
        H[2, 0] += sums[6]
        H[2, 1] += sums[7]
        H[2, 2] += sums[8]
        return
    for a in range(rows):
        _times(weight, columns[a, :width], scaled)
        g[a] += _dot(scaled, residual)
        for b in range(0, a + 1, 3):
            products = _dot_three(scaled, columns[b, :width], columns[b + 1, :width], columns[b + 2, :width])
            for c in range(3):
                H[a, b + c] += products[c]


@_plain
def _normal_equations(G, hats, corner, remove_bias, project, basis, V, residual, weights, pair_weight, H, g):
    """Add one face's H (9, 9) and g (9,): sum of w D_a D_b and w e D_a over views and samples.

    D is the derivative of the residual: hat * G for the alternating solver; with `project`, variable projection,
    (I - U U^T) J (I - V V^T), because the refitted U and c answer to the vertex (Golub and Pereyra 1973, Kaufman 1975).

    One round over the blocks projects the views and finds the columns' means and coefficients along the basis; a second takes
    these off and sums. V^T acts on views and U^T on samples, so their order does not matter.
    """
    n, p = G.shape[1:]
    k = basis.shape[0]
    first, rows = (0, 9) if corner < 0 else (3 * corner, 3)
    corner = max(corner, 0)
    columns = np.empty((rows, BLOCK), dtype=np.float32)
    scaled = np.empty(BLOCK, dtype=np.float32)
    means = np.zeros((n, rows))
    along = np.zeros((k, n, rows))
    basis_sums = np.zeros(k)
    if project or remove_bias:
        projected = np.empty((k, BLOCK), dtype=np.float32)
        forth, back = np.empty((k, n), dtype=np.float32), np.empty((n, k), dtype=np.float32)
        for i in range(n):
            for m in range(k):
                forth[m, i] = V[i, m]
                back[i, m] = -V[i, m]
        for start in range(0, p, BLOCK):
            stop = min(start + BLOCK, p)
            if project:
                for c in range(G.shape[0]):
                    _project_views(G[c], start, stop, forth, back, projected)
            if remove_bias:
                for m in range(k):
                    basis_sums[m] += _sum(basis[m, start:stop])
            for a in range(0, rows, 3):
                hat = hats[corner + a // 3, start:stop]
                axes = G[a : a + 3] if G.shape[0] == 9 else G[:3]
                if remove_bias:
                    _add_dots(hat, axes, start, means[:, a : a + 3])
                if project:
                    for m in range(k):
                        # The hat goes onto the basis, once for all views.
                        _times(hat, basis[m, start:stop], scaled[: stop - start])
                        _add_dots(scaled[: stop - start], axes, start, along[m, :, a : a + 3])
        means /= p
        for i in range(n):
            for a in range(rows):
                for m in range(k):
                    along[m, i, a] -= means[i, a] * basis_sums[m]
    taken_off = (-along.transpose(1, 2, 0)).astype(np.float32).copy()
    sums, slope = np.zeros((n, rows, rows)), np.zeros((n, rows))
    for start in range(0, p, BLOCK):
        stop = min(start + BLOCK, p)
        for i in range(n):
            _columns(G, hats, corner, i, start, stop, columns)
            for a in range(rows):
                column = columns[a, : stop - start]
                if remove_bias:
                    _subtract(column, np.float32(means[i, a]))
                if project:
                    _add_rows(column, taken_off[i, a], basis, start)
            _add_products(
                columns, stop - start, weights[i, start:stop], residual[i, start:stop], sums[i], slope[i],
                scaled[: stop - start],
            )  # fmt: skip
    for i in range(n):
        for a in range(rows):
            g[first + a] += pair_weight[i] * slope[i, a]
            for b in range(a + 1):
                H[first + a, first + b] += pair_weight[i] * sums[i, a, b]
    for a in range(first, first + rows):
        for b in range(first, a):
            H[b, a] = H[a, b]


@_fast
def _bins(residual, index):
    """Histogram bins of absolute residuals; returns the largest."""
    per_level, last = np.float32(1 / HISTOGRAM_STEP), np.float32(HISTOGRAM_BINS - 1)
    largest = np.float32(0)
    for t in range(residual.shape[0]):
        size = abs(residual[t])
        largest = max(largest, size)
        index[t] = np.int32(min(size * per_level, last))
    return largest


@_plain
def _count(index, histograms):
    """Count bins in four histograms in turn: a count need not wait for that of a neighbour in the same bin."""
    for t in range(index.shape[0]):
        histograms[t & 3, index[t]] += 1


@_plain
def _statistics(residual, mask_weight, masked, index, found):
    """Largest and median absolute residual of the samples that count; found: (3,) float64, out, the first two."""
    n, p = residual.shape
    histograms = np.zeros((4, HISTOGRAM_BINS + 1), dtype=np.int32)
    for i in range(n):
        for start in range(0, p, STRIP):
            strip = slice(start, min(start + STRIP, p))
            bins = index[: strip.stop - start]
            found[0] = max(found[0], _bins(residual[i, strip], bins))
            if masked:
                for t in range(bins.shape[0]):
                    if mask_weight[i, start + t] == 0:
                        bins[t] = HISTOGRAM_BINS  # a masked residual is zero, and is not the largest
            _count(bins, histograms)
    histogram = histograms.sum(axis=0)[:HISTOGRAM_BINS].astype(np.float64)
    found[1] = _median_from_histogram(histogram, histogram.sum())


@_plain
def _median_from_histogram(histogram, total):
    half, below = total / 2, 0.0
    for b in range(histogram.shape[0]):
        if below + histogram[b] >= half and histogram[b] > 0:
            return HISTOGRAM_STEP * (b + (half - below) / histogram[b])
        below += histogram[b]
    return HISTOGRAM_STEP * histogram.shape[0]


@_plain
def evaluate_faces(data, vertices, todo, corners, sigma_scale, solver, energy, pair_energy, H, g, statistics):
    """Energy and normal equations of the faces `todo`.

    Args:
        data: KernelData.
        vertices: (n, 3) float64.
        todo: (F,) int64 face ids.
        corners: (F,) int64: which corner moves, -1 for all.
        sigma_scale: (m,) float64: the robust norm's scale by face.
        solver: SOLVER_*; with SOLVER_NONE only energies are filled.
        energy: (F,) float64, out: sum of weight * rho(e); infinite if a corner lies behind a camera.
        pair_energy: (P,) float64, out: the same by pair, for the pairs of `todo`.
        H, g: (F, 9, 9), (F, 9) float64, out.
        statistics: (F, 3) float64, out: largest and median absolute residual, grey levels; the k-th singular value
            squared over the mean of the later ones.
    """
    n_most, p_most = 1, 1
    for f in todo:
        n_most = max(n_most, data.pair_start[f + 1] - data.pair_start[f])
        p_most = max(p_most, data.grid_start[data.face_grid[f] + 1] - data.grid_start[data.face_grid[f]])
    p_most *= data.channels
    k_most = max(1, data.face_dimensions.max()) + 1
    want = solver != SOLVER_NONE
    all_components = 9 if data.affine and corners.min() < 0 else 3
    cells_buffer = np.empty(n_most * p_most, dtype=np.float32)
    residual_buffer = np.empty(n_most * p_most, dtype=np.float32)
    weights_buffer = np.empty(n_most * p_most, dtype=np.float32)
    mask_buffer = np.empty(n_most * p_most if data.masks.shape[0] > 0 else 1, dtype=np.float32)
    G_buffer = np.empty(all_components * n_most * p_most if want else 1, dtype=np.float32)
    hats_buffer = np.empty(3 * p_most, dtype=np.float32)
    basis_buffer = np.empty(k_most * p_most, dtype=np.float32)
    strip = np.empty((5, STRIP), dtype=np.float32)
    taps = np.empty((4, 4 * STRIP), dtype=np.float32)
    index = np.empty(STRIP, dtype=np.int32)
    singular_values = np.empty(n_most)
    for at in range(todo.shape[0]):
        face = todo[at]
        corner = corners[at]
        energy[at] = 0
        statistics[at] = 0
        H[at] = 0
        g[at] = 0
        k = data.face_dimensions[face]
        if k == 0:
            continue
        first, n = data.pair_start[face], data.pair_start[face + 1] - data.pair_start[face]
        p = data.grid_start[data.face_grid[face] + 1] - data.grid_start[data.face_grid[face]]
        pc = p * data.channels
        components = 9 if data.affine and corner < 0 else 3
        cells = cells_buffer[: n * pc].reshape(n, pc)
        residual = residual_buffer[: n * pc].reshape(n, pc)
        weights = weights_buffer[: n * pc].reshape(n, pc)
        mask_weight = mask_buffer[: n * pc].reshape(n, pc) if data.masks.shape[0] > 0 else mask_buffer.reshape(1, 1)
        G = G_buffer[: components * n * pc if want else 0].reshape(components if want else 0, n, pc)
        hats = hats_buffer[: 3 * pc].reshape(3, pc)
        if not sample_face(data, vertices, face, corner, want, cells, G, hats, strip, taps, index):
            energy[at] = np.inf
            continue
        masked = _apply_masks(data, face, p, cells, mask_weight, G, components if want else 0)
        if data.remove_bias:
            _remove_means(cells, mask_weight, masked)
        V = np.zeros((n, k + 1))
        basis = basis_buffer[: (k + 1) * pc].reshape(k + 1, pc)
        fit_face(cells, k, data.centered, mask_weight, masked, basis, V, singular_values, residual)
        for i in range(n):
            rho = _weigh(residual[i], data.norm, sigma_scale[face], weights[i])
            pair_energy[first + i] = data.pair_weight[first + i] * rho
            energy[at] += pair_energy[first + i]
        if want:
            used = k
            if data.centered:
                V[:, k] = 1 / np.sqrt(n)
                basis[k, :] = 0
                used = k + 1
            _normal_equations(
                G, hats, corner, data.remove_bias, solver == SOLVER_VARIABLE_PROJECTION, basis[:used], V[:, :used], residual,
                weights, data.pair_weight[first : first + n], H[at], g[at],
            )  # fmt: skip
        else:
            _statistics(residual, mask_weight, masked, index, statistics[at])
            later = (singular_values[k:n] ** 2).mean()
            statistics[at, 2] = singular_values[k - 1] ** 2 / max(later, 1e-300)


@_plain
def show_face(
    data, vertices, face, scale, raw, bias, residual, weights, mask_weight, basis, V, singular_values, pair_energy
):
    """The same computation as in `evaluate_faces` for one face, with everything it passes through kept for display.

    It stands in this file because a compiled function of another file would not notice that those it calls changed.

    Args:
        scale: the robust norm's scale of the face.
        raw, residual, weights, mask_weight: (n, p * channels) float32, out: cells as sampled, I - U c, rho'(e) / e, and
            1 where a sample counts.
        bias: (n,) float32, out: mean taken off each cell.
        basis: (k + 1, p * channels) float32, out; the last row is scratch.
        V: (n, k + 1) float64, out: right singular vectors.
        singular_values: (n,) float64, out.
        pair_energy: (n,) float64, out.

    Returns:
        The cells (n, p * channels) as the eigenspace was fitted to them: masked samples filled in, means taken off
        where the options ask for it; None where a corner lies behind a camera.
    """
    n, pc = raw.shape
    k = data.face_dimensions[face]
    G = np.empty((0, n, pc), dtype=np.float32)
    hats = np.empty((3, pc), dtype=np.float32)
    strip = np.empty((5, STRIP), dtype=np.float32)
    taps = np.empty((4, 4 * STRIP), dtype=np.float32)
    index = np.empty(STRIP, dtype=np.int32)
    if not sample_face(data, vertices, face, -1, False, raw, G, hats, strip, taps, index):
        return None
    cells = raw.copy()
    mask_weight[:] = 1
    masked = _apply_masks(data, face, pc // data.channels, cells, mask_weight, G, 0)
    if data.remove_bias:
        _remove_means(cells, mask_weight, masked)
        bias[:] = raw[:, 0] - cells[:, 0]
    if k > 0:
        fit_face(cells, k, data.centered, mask_weight, masked, basis, V, singular_values, residual)
        first = data.pair_start[face]
        for i in range(n):
            rho = _weigh(residual[i], data.norm, scale, weights[i])
            pair_energy[i] = data.pair_weight[first + i] * rho
    return cells

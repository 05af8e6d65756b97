"""The hot loops, compiled: sample the cells of a face, fit its eigenspace, weigh the residual, build the normal equations.

One call works through a list of faces. Every face is computed on its own, in a fixed order of operations, and written to
its own place, so that the result does not depend on how the list is shared among threads. Cells are float32; sums over
pairs of cells, energies and normal equations are collected in float64.

The sampling is split into three passes over short strips (coordinates, loads, interpolation), because the loads are the only
part that does not vectorise: 238 M samples/s against 178 M in one loop.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

STRIP = 512
HISTOGRAM_BINS = 2048
HISTOGRAM_STEP = 0.0625  # grey levels
FILL_ITERATIONS = 3

SOLVER_NONE, SOLVER_ALTERNATING, SOLVER_VARIABLE_PROJECTION = 0, 1, 2
NORM_GEMAN_MCCLURE, NORM_HUBER, NORM_LEAST_SQUARES = 0, 1, 2

# Reassociation lets sums vectorise; the code that results is fixed, so runs repeat to the bit on one kind of processor.
_FAST = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}


class KernelData(NamedTuple):
    """What stays fixed while vertices move (built by `fairing.cells.CellContext`). P pairs of face and view, V views.

    Attributes:
        faces: (m, 3) int64.
        image_from_world: (V, 3, 4) float64.
        view_size: (V, 2) int64: width and height in pixels.
        pixels: flat float32: the planes (channels, height, width) of all blurred photos, one after another.
        channels: planes a photo.
        pair_start: (m + 1,) int64: the pairs of face f are pair_start[f] : pair_start[f + 1].
        pair_view: (P,) int64.
        pair_base: (P,) int64: where the photo of the pair starts in `pixels`.
        pair_weight: (P,) float64: photo pixels a cell sample stands for.
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
    view_size: np.ndarray
    pixels: np.ndarray
    channels: int
    pair_start: np.ndarray
    pair_view: np.ndarray
    pair_base: np.ndarray
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


@njit(cache=True, nogil=True, fastmath=_FAST)
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


@njit(cache=True, nogil=True, fastmath=_FAST)
def _bilinear(image, stride, x, y, index, taps, cell, gx, gy):
    """Value and exact gradient of the bilinear surface at a strip of coordinates."""
    count = x.shape[0]
    for s in range(count):
        index[s] = np.int32(y[s]) * np.int32(stride) + np.int32(x[s])
    right, below = np.uint32(1), np.uint32(stride)
    for s in range(count):
        i = np.uint32(index[s])
        taps[0, s] = image[i]
        taps[1, s] = image[i + right]
        taps[2, s] = image[i + below]
        taps[3, s] = image[i + below + right]
    for s in range(count):
        fx = x[s] - np.float32(np.int32(x[s]))
        fy = y[s] - np.float32(np.int32(y[s]))
        top, bottom = taps[1, s] - taps[0, s], taps[3, s] - taps[2, s]
        upper = taps[0, s] + fx * top
        down = taps[2, s] + fx * bottom - upper
        cell[s] = upper + fy * down
        gx[s] = top + fy * (bottom - top)
        gy[s] = down


@njit(cache=True, nogil=True, fastmath=_FAST)
def _cubic(image, stride, x, y, cell, gx, gy):
    """Value and exact gradient of the cubic B-spline with coefficients `image` at a strip of coordinates."""
    one, two, three, four, sixth, half = (
        np.float32(1), np.float32(2), np.float32(3), np.float32(4), np.float32(1 / 6), np.float32(0.5),
    )  # fmt: skip
    for s in range(x.shape[0]):
        ix, iy = np.int64(x[s]), np.int64(y[s])
        fx, fy = x[s] - np.float32(ix), y[s] - np.float32(iy)
        rx, ry = one - fx, one - fy
        ax, bx = rx * rx * rx * sixth, (four - three * fx * fx * (two - fx)) * sixth
        dx = fx * fx * fx * sixth
        cx = one - ax - bx - dx
        ay, by = ry * ry * ry * sixth, (four - three * fy * fy * (two - fy)) * sixth
        dy = fy * fy * fy * sixth
        cy = one - ay - by - dy
        dax, ddx = -half * rx * rx, half * fx * fx
        dbx = half * fx * (three * fx - four)
        dcx = -dax - dbx - ddx
        day, ddy = -half * ry * ry, half * fy * fy
        dby = half * fy * (three * fy - four)
        dcy = -day - dby - ddy
        i = (iy - 1) * stride + ix - 1
        value, slope_x, slope_y = np.float32(0), np.float32(0), np.float32(0)
        for r in range(4):
            wy = ay if r == 0 else (by if r == 1 else (cy if r == 2 else dy))
            wdy = day if r == 0 else (dby if r == 1 else (dcy if r == 2 else ddy))
            t0, t1, t2, t3 = image[i], image[i + 1], image[i + 2], image[i + 3]
            row = ax * t0 + bx * t1 + cx * t2 + dx * t3
            value += wy * row
            slope_y += wdy * row
            slope_x += wy * (dax * t0 + dbx * t1 + dcx * t2 + ddx * t3)
            i += stride
        cell[s], gx[s], gy[s] = value, slope_x, slope_y


@njit(cache=True, nogil=True, fastmath=_FAST)
def _dot(a, b):
    total = np.float32(0)
    for s in range(a.shape[0]):
        total += a[s] * b[s]
    return total


@njit(cache=True, nogil=True, fastmath=_FAST)
def _add_scaled(target, factor, source):
    f = np.float32(factor)
    for s in range(target.shape[0]):
        target[s] += f * source[s]


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
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
        width, height = data.view_size[view, 0], data.view_size[view, 1]
        ox = np.floor(min(q[0, 0] / q[0, 2], q[1, 0] / q[1, 2], q[2, 0] / q[2, 2])) - 2
        oy = np.floor(min(q[0, 1] / q[0, 2], q[1, 1] / q[1, 2], q[2, 1] / q[2, 2])) - 2
        ox = min(max(ox, 0.0), width - 5.0)
        oy = min(max(oy, 0.0), height - 5.0)
        scale = 1 / q[2, 2]
        for j in range(3):
            q[j, 0] = (q[j, 0] - ox * q[j, 2]) * scale
            q[j, 1] = (q[j, 1] - oy * q[j, 2]) * scale
            q[j, 2] *= scale
        limits = (
            np.float32(1), np.float32(width - 2.001 - ox), np.float32(1), np.float32(height - 2.001 - oy),
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
            plane = data.pair_base[pair] + channel * width * height + np.int64(oy) * width + np.int64(ox)
            image = data.pixels[plane:]
            for start in range(0, p, STRIP):
                count = min(STRIP, p - start)
                x, y, w = strip[0, :count], strip[1, :count], strip[2, :count]
                gx, gy = strip[3, :count], strip[4, :count]
                t = channel * p + start
                _coordinates(q, hats[0, start : start + count], hats[1, start : start + count], limits, x, y, w)
                cell = cells[i, t : t + count]
                if data.cubic:
                    _cubic(image, width, x, y, cell, gx, gy)
                else:
                    _bilinear(image, width, x, y, index, taps, cell, gx, gy)
                if not want_gradient:
                    continue
                if data.affine:
                    low = 0 if corner < 0 else 3 * corner
                    for c in range(9 if corner < 0 else 3):
                        out = G[c, i, t : t + count]
                        jx, jy = J[low + c, 0], J[low + c, 1]
                        for s in range(count):
                            out[s] = gx[s] * jx + gy[s] * jy
                else:
                    out0, out1, out2 = G[0, i, t : t + count], G[1, i, t : t + count], G[2, i, t : t + count]
                    for s in range(count):
                        u, v_, r = gx[s] * w[s], gy[s] * w[s], w[s] * (gx[s] * x[s] + gy[s] * y[s])
                        out0[s] = u * J[0, 0] + v_ * J[0, 1] - r * J[3, 0]
                        out1[s] = u * J[1, 0] + v_ * J[1, 1] - r * J[4, 0]
                        out2[s] = u * J[2, 0] + v_ * J[2, 1] - r * J[5, 0]
    return True


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
def _remove_means(cells, mask_weight, masked):
    """Subtract from each cell its mean over the samples that count (the bias between photos)."""
    for i in range(cells.shape[0]):
        total, count = 0.0, 0.0
        for t in range(cells.shape[1]):
            weight = mask_weight[i, t] if masked else np.float32(1)
            total += weight * cells[i, t]
            count += weight
        mean = np.float32(total / max(count, 1.0))
        for t in range(cells.shape[1]):
            cells[i, t] -= mean


@njit(cache=True, nogil=True)
def _decompose(cells, k, centered, basis, V, singular_values):
    """First k left singular vectors of the cells through the n x n Gram matrix; signs fixed so that runs compare.

    Centred: the mean cell is taken off `cells` in place first.
    """
    n = cells.shape[0]
    if centered:
        for t in range(cells.shape[1]):
            mean = np.float32(0)
            for i in range(n):
                mean += cells[i, t]
            mean /= np.float32(n)
            for i in range(n):
                cells[i, t] -= mean
    gram = np.empty((n, n))
    for i in range(n):
        for j in range(i + 1):
            gram[i, j] = gram[j, i] = _dot(cells[i], cells[j])
    values, vectors = np.linalg.eigh(gram)
    for m in range(n):
        singular_values[m] = np.sqrt(max(values[n - 1 - m], 0.0))
    for m in range(k):
        column = vectors[:, n - 1 - m]
        largest = 0
        for i in range(n):
            if abs(column[i]) > abs(column[largest]) * (1 + 1e-9):
                largest = i
        sign = 1.0 if column[largest] >= 0 else -1.0
        for i in range(n):
            V[i, m] = sign * column[i]
        basis[m, :] = 0
        if singular_values[m] > 1e-6 * singular_values[0] and singular_values[m] > 0:
            for i in range(n):
                _add_scaled(basis[m], V[i, m] / singular_values[m], cells[i])
        else:
            V[:, m] = 0


@njit(cache=True, nogil=True)
def fit_face(cells, k, centered, mask_weight, masked, basis, V, singular_values, residual):
    """Eigenspace and residual of one face's cells (n, p).

    residual = I - U c (Eq. 1). Masked samples are filled from the reconstruction itself, starting from the mean of the other
    cells: a fixed number of rounds, so that the energy is a function of the vertices alone. Their residual is zero.
    """
    n, p = cells.shape
    if masked:
        _fill_with_mean(cells, mask_weight, residual)
    for _ in range(FILL_ITERATIONS + 1 if masked else 1):
        _decompose(cells, k, centered, basis, V, singular_values)
        for i in range(n):
            residual[i, :] = cells[i]
            for m in range(k):
                _add_scaled(residual[i], -singular_values[m] * V[i, m], basis[m])
        if masked:
            _fill_with_reconstruction(cells, mask_weight, residual)


@njit(cache=True, nogil=True, fastmath=_FAST)
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


@njit(cache=True, nogil=True, fastmath=_FAST)
def _fill_with_reconstruction(cells, mask_weight, residual):
    """Give masked samples their reconstruction; their residual becomes zero."""
    for i in range(cells.shape[0]):
        cell, weight, rest = cells[i], mask_weight[i], residual[i]
        for t in range(cell.shape[0]):
            cell[t] -= (np.float32(1) - weight[t]) * rest[t]
            rest[t] *= weight[t]


@njit(cache=True, nogil=True, fastmath=_FAST)
def _weigh(residual, norm, scale, weights):
    """Robust weight rho'(e) / e of every residual; returns the sum of rho(e).

    `scale` is sigma squared (sigma itself for the printed Geman-McClure form); all norms behave as e^2 / sigma^2 near zero.
    """
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


@njit(cache=True, nogil=True, fastmath=_FAST)
def _normal_equations(
    G, hats, corner, remove_bias, project, basis, V, residual, weights, pair_weight, columns, projected, H, g
):
    """Add one face's H (9, 9) and g (9,): sum of w D_a D_b and w e D_a over views and samples.

    D is the derivative of the residual: hat * G for the alternating solver; with `project`, variable projection,
    (I - U U^T) J (I - V V^T), because the refitted U and c answer to the vertex (Golub and Pereyra 1973, Kaufman 1975).
    """
    components, n, p = G.shape
    k = basis.shape[0]
    first, count = (0, 3) if corner < 0 else (corner, 1)
    if project:
        for c in range(components):
            for m in range(k):
                projected[m, :] = 0
                for i in range(n):
                    _add_scaled(projected[m], V[i, m], G[c, i])
            for i in range(n):
                for m in range(k):
                    _add_scaled(G[c, i], -V[i, m], projected[m])
    for i in range(n):
        for j in range(count):
            hat = hats[first + j]
            for b in range(3):
                source = G[3 * j + b if components == 9 else b, i]
                column = columns[3 * j + b]
                for t in range(p):
                    column[t] = hat[t] * source[t]
                if remove_bias:
                    mean = np.float32(column.sum() / np.float32(p))
                    for t in range(p):
                        column[t] -= mean
                if project:
                    for m in range(k):
                        _add_scaled(column, -_dot(basis[m], column), basis[m])
        for a in range(3 * count):
            scaled = columns[9]
            left = columns[a]
            for t in range(p):
                scaled[t] = weights[i, t] * left[t]
            row = 3 * first + a
            g[row] += pair_weight[i] * _dot(scaled, residual[i])
            for b in range(a + 1):
                value = pair_weight[i] * _dot(scaled, columns[b])
                H[row, 3 * first + b] += value
                if a != b:
                    H[3 * first + b, row] += value


@njit(cache=True, nogil=True)
def _median_from_histogram(histogram, total):
    half, below = total / 2, 0.0
    for b in range(histogram.shape[0]):
        if below + histogram[b] >= half and histogram[b] > 0:
            return HISTOGRAM_STEP * (b + (half - below) / histogram[b])
        below += histogram[b]
    return HISTOGRAM_STEP * histogram.shape[0]


@njit(cache=True, nogil=True)
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
        statistics: (F, 2) float64, out: largest and median absolute residual, grey levels.
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
    projected_buffer = np.empty(k_most * p_most, dtype=np.float32)
    columns_buffer = np.empty(10 * p_most, dtype=np.float32)
    strip = np.empty((5, STRIP), dtype=np.float32)
    taps = np.empty((4, STRIP), dtype=np.float32)
    index = np.empty(STRIP, dtype=np.int32)
    singular_values = np.empty(n_most)
    histogram = np.empty(HISTOGRAM_BINS)
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
            projected = projected_buffer[: used * pc].reshape(used, pc)
            columns = columns_buffer[: 10 * pc].reshape(10, pc)
            _normal_equations(
                G, hats, corner, data.remove_bias, solver == SOLVER_VARIABLE_PROJECTION, basis[:used], V[:, :used], residual,
                weights, data.pair_weight[first : first + n], columns, projected, H[at], g[at],
            )  # fmt: skip
        else:
            histogram[:] = 0
            for i in range(n):
                for t in range(pc):
                    if masked and mask_weight[i, t] == 0:
                        continue
                    size = abs(residual[i, t])
                    statistics[at, 0] = max(statistics[at, 0], size)
                    histogram[min(HISTOGRAM_BINS - 1, int(size / HISTOGRAM_STEP))] += 1
            statistics[at, 1] = _median_from_histogram(histogram, histogram.sum())


@njit(cache=True, nogil=True)
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
    taps = np.empty((4, STRIP), dtype=np.float32)
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

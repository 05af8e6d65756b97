"""Cells of a face sampled from the photos, and their derivatives by the corners of the face."""

import numpy as np

from fairing.kernels.compiled import by_sample, fast, never_inline, plain
from fairing.kernels.interpolation import addresses, bilinear, cubic, load_bilinear, load_cubic
from fairing.kernels.rows import STRIP, times


@plain
def sample_face(data, vertices, face, corner, with_gradient, cells, G, hats, strip, taps, index):
    """Cells of a face, and the derivative of every sample with respect to the face's corners.

    de/d eta = grad I . (hat * J_image_wrt_point), Eq. 5-11 with the image's gradient; G excludes the factor hat, which is returned
    in `hats`.

    Args:
        data: KernelData.
        vertices: (n, 3) float64, world units.
        face: face id.
        corner: 0, 1 or 2 for the derivative by one corner, -1 for all three.
        with_gradient: fill G.
        cells: (n, p * channels) float32, out, grey levels.
        G: (c, n, p * channels) float32, out, grey levels / world unit: c = 3 world axes, or 9 with the affine warp and corner -1.
        hats: (3, p * channels) float32, out: barycentric weights of the three corners.
        strip, taps, index: scratch.

    Returns:
        False if a corner lies behind a camera; the outputs are then undefined.
    """
    never_inline()  # pyright: ignore[reportCallIssue]
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
        camera = data.pair_camera[pair]
        _corner_pixels(data.faces[face], vertices, data.image_from_world[camera], data.affine, q)
        if q[0, 2] <= 0 or q[1, 2] <= 0 or q[2, 2] <= 0:
            return False
        # The origin moves two pixels up and left of the corners: float32 then resolves 1e-5 pixels.
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
        P = data.image_from_world[camera]
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
                addresses(x, y, width, index[:count])
                if data.cubic:
                    load_cubic(image, width, index[:count], taps)
                    cubic(x, y, taps, cell, gx, gy)
                else:
                    load_bilinear(image, width, index[:count], taps)
                    bilinear(x, y, taps, cell, gx, gy)
                if not with_gradient:
                    continue
                if data.affine:
                    low = 0 if corner < 0 else 3 * corner
                    for c in range(9 if corner < 0 else 3):
                        _to_affine(gx, gy, J[low + c, 0], J[low + c, 1], G[c, i, t : t + count])
                else:
                    out0, out1, out2 = G[0, i, t : t + count], G[1, i, t : t + count], G[2, i, t : t + count]
                    _to_homography(gx, gy, x, y, w, J, out0, out1, out2)
    return True


@plain
def _corner_pixels(corners, vertices, P, affine, q):
    """Homogeneous pixels of a face's corners, into q (3, 3); normalised to weight 1 for the affine warp."""
    for j in range(3):
        v = corners[j]
        for r in range(3):
            q[j, r] = P[r, 0] * vertices[v, 0] + P[r, 1] * vertices[v, 1] + P[r, 2] * vertices[v, 2] + P[r, 3]
        if affine:
            q[j, 0] /= q[j, 2]
            q[j, 1] /= q[j, 2]
            q[j, 2] = 1.0


@by_sample
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


@fast
def _to_affine(gx, gy, jx, jy, out):
    """Derivative by a coordinate that moves the samples by (jx, jy) px per world unit, up to the hat."""
    for s in range(gx.shape[0]):
        out[s] = gx[s] * jx + gy[s] * jy


@fast
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


@plain
def apply_masks(starts, masks, channels, mask_weight, G, components):
    """Zero the derivative of masked samples and fill mask_weight (n, p * channels); returns whether any sample is masked.

    Args:
        starts: (n,) int64: where the mask of each pair starts in `masks`, -1 for none.
        masks: flat uint8.
        mask_weight: (n, p * channels) float32, out.
        G: (components, n, p * channels) float32.
    """
    any_masked = False
    for i in range(starts.shape[0]):
        any_masked = any_masked or starts[i] >= 0
    if not any_masked:
        return False
    p = mask_weight.shape[1] // channels
    for i in range(starts.shape[0]):
        if starts[i] < 0:
            mask_weight[i, :] = 1
            continue
        for channel in range(channels):
            _weigh_mask(masks[starts[i] : starts[i] + p], mask_weight[i, channel * p : (channel + 1) * p])
        for c in range(components):
            times(G[c, i], mask_weight[i], G[c, i])
    return True


@by_sample
def _weigh_mask(mask, weight):
    for s in range(weight.shape[0]):
        weight[s] = np.float32(mask[s])

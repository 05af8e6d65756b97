"""Compiled loops of bundle adjustment, over observations (o,) in the order of their points.

Sums are made in that order, so results do not depend on the number of threads. A `weight` of 0 excludes an observation,
whose other values may be anything.
"""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def project(K, distortion, rotations, centers, points, point, photo):
    """Pixels (o, 2) and depths (o,), world units, of points (p, 3) in photos with intrinsics K, k_1 and k_2 (v, 2), and poses
    (v, 3, 3), (v, 3)."""
    pixels, depth = np.zeros((len(point), 2)), np.zeros(len(point))
    for o in range(len(point)):
        v, i = photo[o], point[o]
        R, k = rotations[v], K[v]
        dx, dy, dz = points[i, 0] - centers[v, 0], points[i, 1] - centers[v, 1], points[i, 2] - centers[v, 2]
        z = R[2, 0] * dx + R[2, 1] * dy + R[2, 2] * dz
        x = (R[0, 0] * dx + R[0, 1] * dy + R[0, 2] * dz) / z
        y = (R[1, 0] * dx + R[1, 1] * dy + R[1, 2] * dz) / z
        squared = x * x + y * y
        scale = 1 + squared * (distortion[v, 0] + squared * distortion[v, 1])
        pixels[o, 0] = scale * (k[0, 0] * x + k[0, 1] * y) + k[0, 2]
        pixels[o, 1] = scale * (k[1, 0] * x + k[1, 1] * y) + k[1, 2]
        depth[o] = z
    return pixels, depth


@njit(cache=True, nogil=True, error_model="numpy")
def linearise(
    K, distortion, rotations, centers, turns, length_unit, radius, bending, n_parameters, points, point, photo
):
    """Pixels (o, 2), depths (o,) and derivatives (o, 2, n) by the photo and (o, 2, 3) by the point, see `PoseModel.linearise`.

    Args:
        turns: (v, 3, 3) float: J_l / f.
        radius: (v,) float, px: r + e_1.
        bending: (v, 2) float, 1 / px: k_1 / e_4 and k_2 / e_5.
        n_parameters: 6, or 11 with intrinsics.
    """
    pixels, depth = project(K, distortion, rotations, centers, points, point, photo)
    by_pose, by_point = np.zeros((len(point), 2, n_parameters)), np.zeros((len(point), 2, 3))
    a = np.zeros(3)
    for o in range(len(point)):
        v, i = photo[o], point[o]
        R, k, k1, k2 = rotations[v], K[v], distortion[v, 0], distortion[v, 1]
        dx, dy, dz = points[i, 0] - centers[v, 0], points[i, 1] - centers[v, 1], points[i, 2] - centers[v, 2]
        z = depth[o]
        x = (R[0, 0] * dx + R[0, 1] * dy + R[0, 2] * dz) / z
        y = (R[1, 0] * dx + R[1, 1] * dy + R[1, 2] * dz) / z
        squared = x * x + y * y
        scale, growth = 1 + squared * (k1 + squared * k2), 2 * (k1 + 2 * squared * k2)
        for row in range(2):
            straight = k[row, 0] * x + k[row, 1] * y
            a[0] = (k[row, 0] * scale + straight * growth * x) / z
            a[1] = (k[row, 1] * scale + straight * growth * y) / z
            a[2] = -(a[0] * x + a[1] * y)
            # -a [x]x
            tx, ty, tz = z * (a[2] * y - a[1]), z * (a[0] - a[2] * x), z * (a[1] * x - a[0] * y)
            for j in range(3):
                by_point[o, row, j] = a[0] * R[0, j] + a[1] * R[1, j] + a[2] * R[2, j]
                by_pose[o, row, j] = tx * turns[v, 0, j] + ty * turns[v, 1, j] + tz * turns[v, 2, j]
                by_pose[o, row, 3 + j] = -length_unit[v] * by_point[o, row, j]
            if n_parameters > 6:
                by_pose[o, row, 6] = (pixels[o, row] - k[row, 2]) / radius[v]
                by_pose[o, row, 7 + row] = 1.0
                by_pose[o, row, 9] = straight * squared * bending[v, 0]
                by_pose[o, row, 10] = straight * squared * squared * bending[v, 1]
    return pixels, depth, by_pose, by_point


@njit(cache=True, nogil=True)
def point_blocks(B, r, weight, point, n_points):
    """Weighted sums of B^T B, (p, 3, 3), and B^T r, (p, 3), over the observations of each point, see `normal_blocks`."""
    V, g_points = np.zeros((n_points, 3, 3)), np.zeros((n_points, 3))
    for o in range(len(point)):
        w, p = weight[o], point[o]
        if w == 0:
            continue
        for i in range(3):
            first, second = w * B[o, 0, i], w * B[o, 1, i]
            g_points[p, i] += first * r[o, 0] + second * r[o, 1]
            for j in range(3):
                V[p, i, j] += first * B[o, 0, j] + second * B[o, 1, j]
    return V, g_points


@njit(cache=True, nogil=True)
def normal_blocks(A, B, r, weight, point, photo, n_photos, n_points):
    """Weighted sums of J^T J and J^T r: U (v, i, i), g (v, i), V (p, 3, 3), g_points (p, 3), and W (o, i, 3), A^T B.

    Args:
        A: (o, 2, i) float: derivatives by the parameters of a photo. B: (o, 2, 3) float: by the point.
        r: (o, 2) float: residuals. weight: (o,) float.
    """
    size = A.shape[2]
    U, g = np.zeros((n_photos, size, size)), np.zeros((n_photos, size))
    V, g_points = point_blocks(B, r, weight, point, n_points)
    W = np.zeros((len(point), size, 3))
    for o in range(len(point)):
        w, v = weight[o], photo[o]
        if w == 0:
            continue
        for i in range(size):
            first, second = w * A[o, 0, i], w * A[o, 1, i]
            g[v, i] += first * r[o, 0] + second * r[o, 1]
            for j in range(size):
                U[v, i, j] += first * A[o, 0, j] + second * A[o, 1, j]
            for j in range(3):
                W[o, i, j] = first * B[o, 0, j] + second * B[o, 1, j]
    return U, g, V, g_points, W


@njit(cache=True, nogil=True)
def eliminated(W, L_inverse, whitened, starts, point, photo, n_photos):
    """What elimination of the points subtracts from the system of the poses: Z Z^T and Z `whitened`, and Z (o, i, 3).

    Args:
        W: (o, i, 3) float. L_inverse: (p, 3, 3) float, lower triangular. whitened: (p, 3) float: L^-1 g.
        starts: (p,) int: first observation of each point.

    Returns:
        (i v, i v) float, which gives Z Z^T with its transpose added; (v, i) float; (o, i, 3) float: W L^-T.
    """
    size = W.shape[1]
    S, g = np.zeros((size * n_photos, size * n_photos)), np.zeros((n_photos, size))
    Z = np.zeros(W.shape)
    for o in range(len(point)):
        p, first = point[o], size * photo[o]
        for i in range(size):
            for j in range(3):
                total = 0.0
                for k in range(j + 1):
                    total += W[o, i, k] * L_inverse[p, j, k]
                Z[o, i, j] = total
            g[photo[o], i] += Z[o, i, 0] * whitened[p, 0] + Z[o, i, 1] * whitened[p, 1] + Z[o, i, 2] * whitened[p, 2]
        for other in range(starts[p], o + 1):
            second, part = size * photo[other], 0.5 if other == o else 1.0
            for i in range(size):
                for j in range(size):
                    S[first + i, second + j] += part * (
                        Z[o, i, 0] * Z[other, j, 0] + Z[o, i, 1] * Z[other, j, 1] + Z[o, i, 2] * Z[other, j, 2]
                    )
    return S, g, Z


@njit(cache=True, nogil=True)
def point_change(Z, turned, point, photo, n_points):
    """(p, 3) float: Z^T times changes (v, i) of the photos' parameters."""
    result = np.zeros((n_points, 3))
    for o in range(len(point)):
        for j in range(3):
            for i in range(Z.shape[1]):
                result[point[o], j] += Z[o, i, j] * turned[photo[o], i]
    return result


@njit(cache=True, nogil=True)
def sums(values, index, n):
    """(n,) float: sums of values (o,) with the same index (o,)."""
    result = np.zeros(n)
    for o in range(len(values)):
        result[index[o]] += values[o]
    return result

"""Entry points of the kernels: energies and normal equations of a list of faces, or all intermediate results of one face.

Every face is computed independently, in a fixed order of operations, and written to its own slot, so that the result does not
depend on how the list is divided among threads.
"""

import numpy as np

from fairing.kernels.compiled import SOURCE, cached
from fairing.kernels.data import Task
from fairing.kernels.eigenspace import fit_face, remove_means
from fairing.kernels.normal_equations import normal_equations
from fairing.kernels.robust import residual_statistics, weigh
from fairing.kernels.rows import STRIP, aligned
from fairing.kernels.sampling import apply_masks, sample_face


def _cached_for(source):
    @cached
    def evaluate_faces(data, vertices, todo, corners, squared_scale, task, energy, pair_energy, H, g, statistics):
        """Energy and normal equations of the faces `todo`.

        Args:
            data: KernelData.
            vertices: (n, 3) float64, world units.
            todo: (F,) int64: face ids.
            corners: (F,) int64: which corner moves, -1 for all.
            squared_scale: (m,) float64: the robust norm's squared scale by face, see `fairing.kernels.robust.weigh`.
            task: a `Task`, as an integer.
            energy: (F,) float64, out: sum of weight * rho(e); infinite if a corner lies behind a camera.
            pair_energy: (P,) float64, out: the same by pair, for the pairs of `todo`.
            H, g: (F, 9, 9), (F, 9) float64, out: by the nine coordinates of the corners, energy / world unit^2 and
                energy / world unit.
            statistics: (F, 2) float64, out, only with `Task.STATISTICS`: largest and median absolute residual, grey levels.
        """
        assert source >= 0
        n_most, p_most, k_most, all_components = 1, 1, 1, 3
        for at in range(todo.shape[0]):
            f = todo[at]
            n_most = max(n_most, data.pair_start[f + 1] - data.pair_start[f])
            p_most = max(p_most, data.grid_start[data.face_grid[f] + 1] - data.grid_start[data.face_grid[f]])
            k_most = max(k_most, data.face_dimensions[f] + 1)
            if data.affine and corners[at] < 0:
                all_components = 9
        p_most *= data.channels
        with_system = task == Task.ALTERNATING or task == Task.VARIABLE_PROJECTION
        cells_buffer = aligned(n_most * p_most)
        residual_buffer = aligned(n_most * p_most)
        weights_buffer = aligned(n_most * p_most)
        mask_buffer = aligned(n_most * p_most if data.masks.shape[0] > 0 else 1)
        G_buffer = aligned(all_components * n_most * p_most if with_system else 1)
        hats_buffer = aligned(3 * p_most)
        basis_buffer = aligned(k_most * p_most)
        strip = aligned(5 * STRIP).reshape(5, STRIP)
        taps = aligned(16 * STRIP).reshape(4, 4 * STRIP)
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
            G = G_buffer[: components * n * pc if with_system else 0].reshape(components if with_system else 0, n, pc)
            hats = hats_buffer[: 3 * pc].reshape(3, pc)
            if not sample_face(data, vertices, face, corner, with_system, cells, G, hats, strip, taps, index):
                energy[at] = np.inf
                continue
            masked = apply_masks(
                data.pair_mask[first : first + n], data.masks, data.channels, mask_weight, G, components if with_system else 0
            )  # fmt: skip
            if data.remove_bias:
                remove_means(cells, mask_weight, masked)
            V = np.zeros((n, k + 1))
            basis = basis_buffer[: (k + 1) * pc].reshape(k + 1, pc)
            fit_face(cells, k, data.centered, mask_weight, masked, basis, V, singular_values, residual)
            for i in range(n):
                rho = weigh(residual[i], data.norm, data.norm_table, squared_scale[face], weights[i])
                pair_energy[first + i] = data.pair_weight[first + i] * rho
                energy[at] += pair_energy[first + i]
            if with_system:
                # Column k of V projects out the mean cell and row k of the basis each cell's mean. The alternating solver
                # keeps the eigenspace and its coefficients: only the means remain.
                V[:, k] = 1 / np.sqrt(n) if data.centered and task == Task.VARIABLE_PROJECTION else 0.0
                basis[k, :] = 1 / np.sqrt(pc) if data.remove_bias else 0.0
                low = 0 if task == Task.VARIABLE_PROJECTION else k
                high = k + 1 if low == k or data.centered or data.remove_bias else k
                normal_equations(
                    G, hats, corner, basis[low:high], V[:, low:high], residual, weights,
                    data.pair_weight[first : first + n], H[at], g[at],
                )  # fmt: skip
            elif task == Task.STATISTICS:
                residual_statistics(residual, mask_weight, masked, index, statistics[at])

    @cached
    def show_face(
        data,
        vertices,
        face,
        corner,
        squared_scale,
        raw,
        bias,
        residual,
        weights,
        mask_weight,
        basis,
        V,
        singular_values,
        pair_energy,
        G,
        hats,
    ):
        """The computation of `evaluate_faces` for one face, with all intermediate results for display.

        Args:
            corner: the corner that G is the derivative by.
            squared_scale: the robust norm's squared scale of the face.
            raw, residual, weights, mask_weight: (n, p * channels) float32, out: cells as sampled, I - U c, rho'(e) / e, and
                1 where a sample counts.
            bias: (n,) float32, out: mean subtracted from each cell.
            basis: (k + 1, p * channels) float32, out; the last row is scratch.
            V: (n, k + 1) float64, out: right singular vectors.
            singular_values: (n,) float64, out.
            pair_energy: (n,) float64, out.
            G: (3, n, p * channels) float32, out: derivatives by the world axes, see `sample_face`; (0, n, p * channels) if they
                are not wanted.
            hats: (3, p * channels) float32, out: barycentric weights of the corners.

        Returns:
            The cells (n, p * channels) as the eigenspace was fitted to them: masked samples filled in, means subtracted if
            the options say so; None if a corner lies behind a camera.
        """
        assert source >= 0
        n = raw.shape[0]
        k = data.face_dimensions[face]
        strip = np.empty((5, STRIP), dtype=np.float32)
        taps = np.empty((4, 4 * STRIP), dtype=np.float32)
        index = np.empty(STRIP, dtype=np.int32)
        # A constant would be a type of its own, for which `sample_face` would be compiled once more.
        components = np.int64(G.shape[0])
        with_gradient = components > 0
        if not sample_face(data, vertices, face, corner, with_gradient, raw, G, hats, strip, taps, index):
            return None
        cells = raw.copy()
        mask_weight[:] = 1
        starts = data.pair_mask[data.pair_start[face] : data.pair_start[face + 1]]
        masked = apply_masks(starts, data.masks, data.channels, mask_weight, G, components)
        if data.remove_bias:
            remove_means(cells, mask_weight, masked)
            bias[:] = raw[:, 0] - cells[:, 0]
        if k > 0:
            fit_face(cells, k, data.centered, mask_weight, masked, basis, V, singular_values, residual)
            first = data.pair_start[face]
            for i in range(n):
                rho = weigh(residual[i], data.norm, data.norm_table, squared_scale, weights[i])
                pair_energy[i] = data.pair_weight[first + i] * rho
        return cells

    return evaluate_faces, show_face


evaluate_faces, show_face = _cached_for(SOURCE)

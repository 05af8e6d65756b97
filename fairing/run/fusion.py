"""Fusion of two results: each vertex is taken from the one where it fits better.

After Lempitsky, Rother, Roth, Blake: Fusion Moves for Markov Random Field Optimization, PAMI 2010. Connected groups of
vertices are exchanged first, then single vertices (ledger: fusion).
"""

import numpy as np

from fairing.geometry.normals import folded_faces
from fairing.mesh import Mesh
from fairing.run.records import Evaluation
from fairing.run.sweep import SweepState
from fairing.solve.blocks import Block, connected_groups, group_block, independent_block, independent_sets
from fairing.solve.face_loss import mean_loss
from fairing.solve.problem import Problem

SAME_POSITION = 1.0  # px: positions nearer to each other than this are equal
EXCHANGES = 2  # rounds in which single vertices are exchanged


def fused(problem: Problem, sweep: SweepState, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(n, 3) float: positions of the first result, or of the second where these fit better.

    Args:
        problem: its options give the cells of the comparison.
        sweep: gives the robust scale and the level.
        first, second: (n, 3) float, world units.

    Raises:
        Cancelled: cancellation was requested.
    """
    mesh, gain = problem.scene.mesh, problem.options.schedule.search_gain
    differs = np.linalg.norm(second - first, axis=1) * sweep.pixels_per_unit > SAME_POSITION
    result = first.copy()

    def exchange(block: Block, groups: list[np.ndarray]) -> bool:
        """Exchange each group whose other positions have a lower loss; returns whether any was exchanged."""
        ids = np.concatenate(groups)
        tried = result.copy()
        is_first = (result[ids] == first[ids]).all(axis=1)
        tried[ids] = np.where(is_first[:, None], second[ids], first[ids])
        folded = np.zeros(len(result), dtype=bool)
        folded[mesh.faces[folded_faces(result, tried, problem.start, mesh.faces, problem.options.step)]] = True
        around = np.zeros(len(mesh.faces), dtype=bool)
        around[block.faces] = True
        here, there = problem.evaluator.map_concurrently(
            lambda places: group_losses(sweep, mesh, evaluate_faces(problem, sweep, places, around), block),
            (result, tried),
        )
        taken = [g for g, a, b in zip(groups, here, there, strict=True) if b < a * (1 - gain) and not folded[g].any()]
        for group in taken:
            result[group] = tried[group]
        return bool(taken)

    groups = connected_groups(mesh, differs)
    if groups:
        exchange(group_block(mesh, groups), groups)
    sets = [ids for ids in independent_sets(mesh, np.flatnonzero(differs)) if len(ids)] if groups else []
    for _ in range(EXCHANGES):
        if not any([exchange(independent_block(mesh, ids), list(ids[:, None])) for ids in sets]):
            break
    return result


def evaluate_faces(problem: Problem, sweep: SweepState, vertices: np.ndarray, faces: np.ndarray) -> Evaluation:
    """Energies of the faces of a mask (m,) with the vertices at positions (n, 3), on the cells of the problem's options."""
    context = problem.context_of(faces, sweep.context.level, vertices, problem.options)
    system = problem.evaluator.energies(context, vertices, np.flatnonzero(faces), sweep.scale)
    return Evaluation(vertices, context, system)


def group_losses(sweep: SweepState, mesh: Mesh, evaluation: Evaluation, block: Block) -> np.ndarray:
    """(u,) float: mean loss per photo pixel around each vertex or group of a block whose faces were evaluated."""
    energy = evaluation.system.energy[np.searchsorted(evaluation.system.faces, block.faces)]
    return mean_loss(evaluation.context, energy, block, evaluation.vertices, mesh, sweep.mean_loss)

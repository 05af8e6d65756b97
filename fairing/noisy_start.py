"""A start full of noise: whether the photos agree better with it smoothed, and the step that smooths it."""

from dataclasses import replace

import numpy as np

from fairing.energy import robust_scale, robust_sigma
from fairing.first_level import first_fine_level
from fairing.moves import Judged, moved_record
from fairing.problem import Problem
from fairing.search import loss_of_faces
from fairing.smoothing import smoothed
from fairing.trace import Position, StepReason, StepRecord

SMOOTHING_GAIN = 0.05
VERTEX_PASSES = 5


def start_is_noisy(problem: Problem, smooth: np.ndarray) -> bool:
    """Whether the photos agree clearly better with the start mesh smoothed: then its vertices lie off at random.

    (Captures and demos with noise gained 8 to 31 %; starts from structure from motion, decimated meshes and the
    facade lost 2 to 15.) Such a run begins smoothed and is pulled to where its faces would be smooth, which also
    settles the vertices no photo determines. Mean surface distance on a fountain and a castle from 0.306 and
    0.323 % of the diagonal: neither 0.182 and 0.246, start smoothed 0.170 and 0.208, both 0.139 and 0.202.
    Tried besides: smoothing unseen vertices alone between levels (0.002 better), all vertices (worse).

    Args:
        smooth: (n, 3) float: see `smoothed_start`.
    """
    here, there = (_mean_loss(_judged_finely(problem, vertices)) for vertices in (problem.start, smooth))
    return there < (1 - SMOOTHING_GAIN) * here


def smoothed_start(problem: Problem) -> np.ndarray:
    """(n, 3) float: the start with its noise filtered out, wherever that folds no face."""
    start, ids = problem.start, np.flatnonzero(~problem.locked)
    moves, _ = problem.unfolded(start, ids, (smoothed(problem.scene.mesh, start, VERTEX_PASSES) - start)[ids])
    after = start.copy()
    after[ids] += moves
    return after


def smoothing_step(problem: Problem, smooth: np.ndarray, position: Position) -> StepRecord:
    """Begin where the smoothed start (n, 3) is; the objective is the mean loss."""
    ids = np.flatnonzero((smooth != problem.start).any(axis=1))
    before, after = (_judged_finely(problem, vertices) for vertices in (problem.start, smooth))
    record = moved_record(problem, position, 0, ids, before, after, StepReason.SMOOTHED)
    return replace(record, objective_before=_mean_loss(before), objective_after=_mean_loss(after))


def _judged_finely(problem: Problem, vertices: np.ndarray) -> Judged:
    """Energies at the first fine level, by the photos that see the faces there.

    Coarser levels tell less (facade smoothed: 2 % lower at blur 2.0, 3 % higher at 1.2).
    """
    level, robust = first_fine_level(problem.options), problem.options.robust
    context = problem.context(level, vertices)
    measured = problem.measure(context, vertices, np.ones(len(problem.scene.mesh.faces)))
    scale = robust_scale(robust, robust_sigma(robust, level, measured))
    return Judged(vertices, context, problem.measure(context, vertices, scale))


def _mean_loss(judged: Judged) -> float:
    """Per photo px."""
    loss, pixels = loss_of_faces(judged.context, judged.system.energy, judged.system.faces)
    return float((loss * pixels).sum() / max(pixels.sum(), 1e-300))

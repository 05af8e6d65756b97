"""Before the first level: a noisy start is smoothed, and the mesh drawn to its sparse points, each if the photos agree."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fairing.cells.level_choice import first_fine_level
from fairing.geometry.normal_filter import smoothed
from fairing.run.local_search import loss_of_faces
from fairing.run.records import Judged, moved_record
from fairing.solve.energy import robust_scale, robust_sigma
from fairing.solve.point_fit import fitted_to_points, fitting_points
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepReason, StepRecord

GAIN = 0.05
VERTEX_PASSES = 5
FIT_ROUNDS = 12


class Preparation(NamedTuple):
    """Attributes:
    reason: SMOOTHED or FITTED_TO_POINTS.
    before, after: (n, 3) float: vertices, world units.
    """

    reason: StepReason
    before: np.ndarray
    after: np.ndarray


def preparations(problem: Problem) -> tuple[Preparation, ...]:
    """What is done to the start, in this order, as far as the options want it and the photos agree.

    Each must lower the mean loss clearly. Smoothing does where the vertices lie off at random. (Captures and demos with
    noise gained 8 to 31 %; starts from structure from motion, decimated meshes and the facade lost 2 to 15.) Such a run is
    pulled to where its faces would be smooth later on, too, which also settles the vertices no photo determines. Mean
    surface distance on a fountain and a castle, by the photos alone, from 0.306 and 0.323 % of the diagonal: neither 0.182
    and 0.246, start smoothed 0.170 and 0.208, both 0.139 and 0.202. Tried besides: smoothing unseen vertices alone between
    levels (0.002 better), all vertices (worse).

    Fitting to sparse points gained 11 to 33 % on captures, and 2 where the mesh was 0.02 % off: then the points' own noise
    does harm (fountain with 2,500 vertices, photos left out: 29.96 dB with them, 30.16 without). Fewer points than the
    vertices have coordinates would be met with all their noise (archway, 230 points for 153 vertices: median surface
    distance at the end 0.0004 -> 0.0147 %).
    """
    step, vertices = problem.options.step, problem.start
    done: list[Preparation] = []
    loss = None  # at `vertices`, once it is asked for: judging takes a look at all photos
    for reason, is_wanted, changed in (
        (StepReason.SMOOTHED, any(step.smoothing), _smoothed),
        (StepReason.FITTED_TO_POINTS, any(step.points) and _points_suffice(problem), _fitted),
    ):
        if not is_wanted:
            continue
        after = changed(problem, vertices)
        loss = _mean_loss(_judged_finely(problem, vertices)) if loss is None else loss
        loss_after = _mean_loss(_judged_finely(problem, after))
        if loss_after < (1 - GAIN) * loss:
            done.append(Preparation(reason, vertices, after))
            vertices, loss = after, loss_after
    return tuple(done)


def preparing_step(problem: Problem, preparation: Preparation, position: SchedulePosition) -> StepRecord:
    """The step that puts the mesh where a preparation has it; the objective is the mean loss."""
    ids = np.flatnonzero((preparation.after != preparation.before).any(axis=1))
    before, after = (_judged_finely(problem, vertices) for vertices in (preparation.before, preparation.after))
    record = moved_record(problem, position, 0, ids, before, after, preparation.reason)
    return replace(record, objective_before=_mean_loss(before), objective_after=_mean_loss(after))


def _smoothed(problem: Problem, vertices: np.ndarray) -> np.ndarray:
    """(n, 3) float: vertices (n, 3) with their noise filtered out, wherever that folds no face."""
    ids = np.flatnonzero(~problem.locked)
    moves, _ = problem.unfolded(vertices, ids, (smoothed(problem.scene.mesh, vertices, VERTEX_PASSES) - vertices)[ids])
    after = vertices.copy()
    after[ids] += moves
    return after


def _fitted(problem: Problem, vertices: np.ndarray) -> np.ndarray:
    """(n, 3) float: vertices (n, 3) drawn to the sparse points."""
    return fitted_to_points(problem, vertices, FIT_ROUNDS).places


def _points_suffice(problem: Problem) -> bool:
    """Whether there are as many points as coordinates to be found."""
    return len(fitting_points(problem.scene)) >= 3 * (~problem.locked).sum()


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

"""One search: all vertices of an independent unit look around for better places."""

from dataclasses import replace

import numpy as np

from fairing.options import FairingOptions
from fairing.problem import Problem
from fairing.search import Found, search_unit
from fairing.sweep import SweepState
from fairing.trace import Position, StepReason, StepRecord
from fairing.units import Unit

SEARCH_COARSENESS = 1.5
SEARCH_CELL = 48


def search_step(
    problem: Problem, sweep: SweepState, unit: Unit, position: Position, vertices: np.ndarray, reach: float
) -> StepRecord:
    """Look around each vertex as far as the sweep says.

    Args:
        position: where the step belongs; the record's next position is the same.
        vertices: (n, 3) float: where they are, world units.
        reach: how far from where it began a vertex may end, px.
    """
    ids = unit.vertices
    found = search_around(problem, sweep, unit, vertices, sweep.prior.run_start, sweep.search_radius, reach)
    moved = (found.after != vertices[ids]).any(axis=1)
    reasons = np.where(moved, StepReason.FOUND_PLACE, StepReason.NO_BETTER_PLACE).astype(np.int8)
    reasons[found.folds] = StepReason.REJECTED_FOLD
    moved_faces = np.zeros(len(problem.scene.mesh.faces), dtype=bool)
    moved_faces[unit.faces[moved[unit.owner]]] = True
    energy_before, energy_after = found.system_before.pair_energy, found.system_after.pair_energy
    # Faces of a vertex that stays keep their energy, even where a moved neighbour uncovers or hides a part of them.
    view_energy_after = found.context_before.by_view(energy_before, ~moved_faces) + found.context_after.by_view(
        energy_after, moved_faces
    )
    blank = np.zeros(len(ids))
    return StepRecord(
        position=position,
        next_position=position,
        sweep_moment=sweep.moment,
        vertices=ids,
        before=vertices[ids],
        proposed=found.proposed,
        after=found.after,
        step_px=problem.pixels_moved(sweep.context, vertices, ids, found.proposed),
        damping=blank,
        eigenvalues=np.zeros((len(ids), 3)),
        reasons=reasons,
        objective_before=float(found.score_before.sum()),
        objective_after=float(found.score_after.sum()),
        faces=unit.faces,
        face_energy_before=found.system_before.energy,
        face_energy_after=found.system_after.energy,
        view_energy_before=found.context_before.by_view(energy_before),
        view_energy_after=view_energy_after,
        damping_next=blank,
        rejections=np.zeros(len(ids), dtype=np.int64),
    )


def search_around(
    problem: Problem,
    sweep: SweepState,
    unit: Unit,
    vertices: np.ndarray,
    origin: np.ndarray,
    radius: float,
    reach: float,
) -> Found:
    """`search_unit` with distances in pixels, and cells made for searching.

    Args:
        vertices, origin: (n, 3) float: where they are and where they began, world units.
        radius: how far away to look, px.
        reach: how far from where it began a vertex may end, px.
    """
    pixels, coarser = sweep.pixels_per_unit[unit.vertices], _coarser(problem.options)
    return search_unit(
        unit, vertices, origin, radius / pixels, reach / pixels, sweep.mean_loss, sweep.scale,
        problem.scene.mesh, problem.options, problem.evaluator,
        lambda places, faces: problem.context_of(faces, sweep.context.level, places, coarser), problem.shortened,
    )  # fmt: skip


def _coarser(options: FairingOptions) -> FairingOptions:
    """A search compares places pixels apart: coarser cells and depth maps do, at a third of the time."""
    cells, visibility = options.cells, options.visibility
    return replace(
        options,
        cells=replace(
            cells,
            spacing=tuple(x * SEARCH_COARSENESS for x in cells.spacing),
            size=tuple(min(size, SEARCH_CELL) for size in cells.size),
            interpolation=("bilinear",),
            point_spread=("as_seen",),
        ),
        visibility=replace(visibility, reduction=visibility.reduction * 2),
    )

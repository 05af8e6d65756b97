"""One search: all vertices of an independent unit look around for better places."""

from dataclasses import replace

import numpy as np

from fairing.cells.level_choice import last_fine_level
from fairing.options import CellOptions, FairingOptions, by_level
from fairing.run.local_search import ContextAt, Found, Stage, search_block
from fairing.run.sweep import SweepState
from fairing.solve.blocks import Block
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepReason, StepRecord

ROUGH_COARSENESS = 1.5
ROUGH_CELL = 48
POLISH_STEPS = 2
SHARP_COARSENESS = 2.0
SHARP_CELL = 64
SHARP_POLISH_STEPS = 1


def search_step(
    problem: Problem, sweep: SweepState, unit: Block, position: SchedulePosition, vertices: np.ndarray, reach: float
) -> StepRecord:
    """Look around each vertex as far as the sweep says.

    Args:
        position: where the step belongs; the record's next position is the same.
        vertices: (n, 3) float: where they are, world units.
        reach: how far from where it began a vertex may end, px.
    """
    ids = unit.vertices
    found = search_around(problem, sweep, unit, vertices, sweep.origin, sweep.search_radius, reach)
    moved = (found.after != vertices[ids]).any(axis=1)
    reasons = np.where(moved, StepReason.FOUND_PLACE, StepReason.NO_BETTER_PLACE).astype(np.int8)
    reasons[found.folds] = StepReason.REJECTED_FOLD
    moved_faces = np.zeros(len(problem.scene.mesh.faces), dtype=bool)
    moved_faces[unit.faces[moved[unit.owner]]] = True
    energy_before, energy_after = found.system_before.pair_energy, found.system_after.pair_energy
    # Faces of a vertex that stays keep their energy, even where a moved neighbour uncovers or hides a part of them.
    view_energy_after = found.context_before.sum_by_view(energy_before, ~moved_faces) + found.context_after.sum_by_view(
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
        view_energy_before=found.context_before.sum_by_view(energy_before),
        view_energy_after=view_energy_after,
        damping_next=blank,
        rejections=np.zeros(len(ids), dtype=np.int64),
    )


def search_around(
    problem: Problem,
    sweep: SweepState,
    unit: Block,
    vertices: np.ndarray,
    origin: np.ndarray,
    radius: float,
    reach: float,
) -> Found:
    """`search_block` with distances in pixels, and cells made for searching.

    Args:
        vertices, origin: (n, 3) float: where they are and where they began, world units.
        radius: how far away to look, px.
        reach: how far from where it began a vertex may end, px.
    """
    pixels, level = sweep.pixels_per_unit[unit.vertices], sweep.context.level
    rough, sharp = _rough(problem.options), sharp_options(problem.options)

    def context_at(level: int, options: FairingOptions) -> ContextAt:
        return lambda places, faces: problem.context_of(faces, level, places, options)

    stages = [Stage(context_at(level, rough), POLISH_STEPS)]
    # Sharp cells reach less than a pixel far, so blurred ones bring a place near first.
    if by_level(problem.options.cells.point_spread, level) == "common":
        stages = [
            Stage(context_at(last_fine_level(problem.options), rough), POLISH_STEPS),
            Stage(context_at(level, sharp), SHARP_POLISH_STEPS),
        ]
    return search_block(
        unit, vertices, origin, radius / pixels, reach / pixels, sweep.mean_loss, sweep.scale,
        problem.scene.mesh, problem.options, problem.evaluator, stages, problem.shortened,
    )  # fmt: skip


def sharp_options(options: FairingOptions) -> FairingOptions:
    """Cells that tell places apart which coarser ones mistake for each other, with a quarter of the samples."""
    return replace(options, cells=_coarser(options.cells, SHARP_COARSENESS, SHARP_CELL))


def _rough(options: FairingOptions) -> FairingOptions:
    """A search compares places pixels apart: coarser cells and depth maps do, at a third of the time."""
    cells = _coarser(options.cells, ROUGH_COARSENESS, ROUGH_CELL)
    return replace(
        options,
        cells=replace(cells, interpolation=("bilinear",), point_spread=("as_seen",)),
        visibility=replace(options.visibility, reduction=options.visibility.reduction * 2),
    )


def _coarser(cells: CellOptions, coarseness: float, largest: int) -> CellOptions:
    spacing = tuple(x * coarseness for x in cells.spacing)
    return replace(cells, spacing=spacing, size=tuple(min(size, largest) for size in cells.size))

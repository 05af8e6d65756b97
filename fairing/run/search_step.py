"""Search step: the local search of one independent block, with distances in pixels and cells made for searching."""

from dataclasses import replace

import numpy as np

from fairing.cells.level_choice import last_fine_level
from fairing.options import CellOptions, FairingOptions
from fairing.run.local_search import ContextAt, SearchRegion, SearchResult, Stage, search_block
from fairing.run.phases import LocalSearch
from fairing.run.records import Energies, build_record
from fairing.run.sweep import SweepState
from fairing.solve.blocks import Block
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepReason, StepRecord

ROUGH_SPACING = 1.5  # factor of the spacing of cell samples
ROUGH_CELL = 48  # samples along an edge, at most
ROUGH_STEPS = 2
SHARP_SPACING = 1.4
SHARP_CELL = 64
SHARP_STEPS = 1


def search_step(
    problem: Problem, sweep: SweepState, block: Block, position: SchedulePosition, vertices: np.ndarray
) -> StepRecord:
    """The step of a block in a `LocalSearch` sweep.

    Args:
        position: of the step; the record's next position is the same.
        vertices: (n, 3) float: positions before it, world units.

    Raises:
        Cancelled: cancellation was requested.
    """
    assert isinstance(sweep.phase, LocalSearch)
    ids = block.vertices
    found = search_around(problem, sweep, block, vertices, sweep.phase)
    moved = (found.after != vertices[ids]).any(axis=1)
    reasons = np.where(moved, StepReason.FOUND_PLACE, StepReason.NO_BETTER_PLACE)
    reasons[found.folds] = StepReason.REJECTED_FOLD
    moved_faces = np.zeros(len(problem.scene.mesh.faces), dtype=bool)
    moved_faces[block.faces[moved[block.owner]]] = True
    before, after = found.system_before.pair_energy, found.system_after.pair_energy
    # Faces of a vertex that stays keep their energy, even if a neighbour that moved changes their visibility.
    by_view = found.context_before.sum_by_view(before, ~moved_faces) + found.context_after.sum_by_view(
        after, moved_faces
    )
    return build_record(
        position,
        sweep.moment,
        ids,
        (vertices[ids], found.after),
        proposed=found.proposed,
        step_px=problem.pixels_moved(sweep.context, vertices, ids, found.proposed),
        reasons=reasons,
        objectives=(float(found.score_before.sum()), float(found.score_after.sum())),
        faces=block.faces,
        energies=(
            Energies(found.system_before.energy, found.context_before.sum_by_view(before)),
            Energies(found.system_after.energy, by_view),
        ),
    )


def search_around(
    problem: Problem, sweep: SweepState, block: Block, vertices: np.ndarray, search: LocalSearch
) -> SearchResult:
    """`search_block` with distances in pixels.

    Args:
        sweep: gives visibility, robust scale and the origin of the vertices.
        vertices: (n, 3) float: positions now, world units.

    Raises:
        Cancelled: cancellation was requested.
    """
    pixels, level, options = sweep.pixels_per_unit[block.vertices], sweep.context.level, problem.options
    rough = rough_options(options)

    def context_at(level: int, options: FairingOptions) -> ContextAt:
        return lambda places, faces: problem.context_of(faces, level, places, options)

    stages = [Stage(context_at(level, rough), ROUGH_STEPS)]
    if search.is_sharp:  # sharp cells have a basin of attraction below a pixel, so blurred ones come first
        stages = [
            Stage(context_at(last_fine_level(options), rough), ROUGH_STEPS),
            Stage(context_at(level, sharp_options(options)), SHARP_STEPS),
        ]
    region = SearchRegion(sweep.origin, search.radius / pixels, search.max_displacement / pixels)
    return search_block(problem, block, vertices, region, stages, sweep.scale, sweep.mean_loss)


def rough_options(options: FairingOptions) -> FairingOptions:
    """Options of coarser cells and depth maps, which suffice to compare positions some pixels apart."""
    cells = _coarser(options.cells, ROUGH_SPACING, ROUGH_CELL)
    return replace(
        options,
        cells=replace(cells, interpolation=("bilinear",), point_spread=("as_seen",)),
        visibility=replace(options.visibility, reduction=options.visibility.reduction * 2),
    )


def sharp_options(options: FairingOptions) -> FairingOptions:
    """Options of sharp cells with half of the samples, which discriminate positions that rough cells confuse."""
    return replace(options, cells=_coarser(options.cells, SHARP_SPACING, SHARP_CELL))


def _coarser(cells: CellOptions, factor: float, largest: int) -> CellOptions:
    spacing = tuple(x * factor for x in cells.spacing)
    return replace(cells, spacing=spacing, size=tuple(min(size, largest) for size in cells.size))

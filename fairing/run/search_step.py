"""Search step: the local search of one independent block, with distances in pixels and cells made for searching."""

from dataclasses import replace

import numpy as np

from fairing.cells.context import CellContext
from fairing.options import CellOptions, FairingOptions
from fairing.run.local_search import SearchRegion, SearchResult, search_block, search_directions
from fairing.run.phases import LocalSearch
from fairing.run.records import Energies, build_record
from fairing.run.sweep import SweepState
from fairing.solve.blocks import Block
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepReason, StepRecord
from fairing.work import number_of

ROUGH_SPACING = 1.5  # factor of the spacing of cell samples
ROUGH_CELL = 48  # samples along an edge, at most
ROUGH_STEPS = 2


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
    pixels, level, rough = sweep.pixels_per_unit[block.vertices], sweep.context.level, rough_options(problem.options)

    def context_at(places: np.ndarray, faces: np.ndarray) -> CellContext:
        return problem.context_of(faces, level, places, rough)

    region = SearchRegion(sweep.origin, search.radius / pixels, search.max_displacement / pixels)
    doing = f"searching {number_of(len(block.vertices), 'vertex', 'vertices')}"
    with problem.work.doing(doing, len(search_directions()) + 1, "direction") as work:
        return search_block(
            problem, block, vertices, region, context_at, ROUGH_STEPS, sweep.scale, sweep.mean_loss, work
        )


def rough_options(options: FairingOptions) -> FairingOptions:
    """Options of coarser cells and depth maps, which suffice to compare positions some pixels apart."""
    cells = coarser_cells(options.cells, ROUGH_SPACING, ROUGH_CELL)
    return replace(
        options,
        cells=replace(cells, interpolation=("bilinear",), point_spread=("as_seen",)),
        visibility=replace(options.visibility, reduction=options.visibility.reduction * 2),
    )


def coarser_cells(cells: CellOptions, factor: float, largest: int) -> CellOptions:
    """Cells whose samples lie farther apart by a factor, with at most `largest` of them along an edge."""
    spacing = tuple(x * factor for x in cells.spacing)
    return replace(cells, spacing=spacing, size=tuple(min(size, largest) for size in cells.size))

"""Cell queries: the cells of a face at a moment, and the flows of the last step of a vertex."""

from dataclasses import dataclass

import numpy as np

from app.debugger.history import last_step_about
from fairing.judge.flow import ModelFlow, OpticalFlow, optical_flow, step_flow
from fairing.judge.inspect import FaceCells, energies_by_dimension, face_cells
from fairing.run.session import Session

ARROWS = 16  # along an edge of the cell
WINDOW = 16  # of the cell's edge is one sigma of the optical flow's window
FLOW_SIZE = 48  # cells are reduced to about this size for the optical flow


@dataclass(frozen=True)
class CellQuery:
    """The cells of one face at one moment of one run.

    Attributes:
        vertex: the flows are those of its last step.
        dimensions: number of eigenspace dimensions k; None: that of the run.
        with_flows: whether the flows are computed.
    """

    run_id: int
    moment: int
    face: int
    vertex: int
    dimensions: int | None
    with_flows: bool


@dataclass(frozen=True, eq=False)
class StepFlows:
    """The two flows of the paper's figure 4, over the cells before a step.

    Attributes:
        moment: the moment after the step; None without a step, the cells are then the present ones.
        cells: before the step.
        model: the flow that the step causes; None if it moved no corner of the face.
        optical: the optical flow from the cells to their reconstruction.
    """

    moment: int | None
    cells: FaceCells
    model: ModelFlow | None
    optical: OpticalFlow


@dataclass(frozen=True, eq=False)
class CellFacts:
    """The result of a cell query.

    Attributes:
        cells: at the moment, with the k of the query.
        own_dimensions: k of the run.
        energies: (n - 2,) float: energy of the face with k = 1, 2 ... dimensions.
        flows: None if not requested, or if the face takes no part.
    """

    cells: FaceCells
    own_dimensions: int
    energies: np.ndarray
    flows: StepFlows | None


def cell_facts(session: Session, question: CellQuery) -> CellFacts:
    """Compute the result; k is limited to the largest that the face allows."""
    own = face_cells(session, question.face, question.moment)
    energies = energies_by_dimension(session, question.face, question.moment) if own.takes_part else np.zeros(0)
    k = question.dimensions
    if k is None or not own.takes_part:
        cells, k = own, None
    else:
        k = min(k, len(energies))
        cells = face_cells(session, question.face, question.moment, k)
    flows = _flows(session, question, cells, k) if question.with_flows and own.takes_part else None
    return CellFacts(cells, len(own.basis), energies, flows)


def _flows(session: Session, question: CellQuery, cells: FaceCells, k: int | None) -> StepFlows | None:
    found = last_step_about(session.trace.steps, question.moment, question.vertex)
    if found is None:
        return StepFlows(None, cells, None, _optical(cells))
    moment = found[0]
    before = face_cells(session, question.face, moment - 1, k)
    if not before.takes_part:
        return None
    model = step_flow(
        session.scene,
        session.trace.vertices_at(moment - 1),
        session.trace.vertices_at(moment),
        before,
        session.options.cells.warp == "affine",
        _spacing(before),
    )
    return StepFlows(moment, before, model, _optical(before))


def _optical(cells: FaceCells) -> OpticalFlow:
    return optical_flow(
        cells, window=cells.size / WINDOW, spacing=_spacing(cells), reduction=max(1, cells.size // FLOW_SIZE)
    )


def _spacing(cells: FaceCells) -> int:
    return max(1, cells.size // ARROWS)

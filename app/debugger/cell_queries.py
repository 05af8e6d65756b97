"""What the cells panel asks the engine: the cells of a face now, and the flows of the last step about a vertex."""

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
class CellQuestion:
    """The cells of one face at one moment of one run.

    Attributes:
        vertex: whose last step the flows are of.
        dimensions: k to look at; None: the run's.
        with_flows: whether anybody looks at the flows.
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
        moment: the moment the step led to; None where there was no step, then the cells are the present ones.
        cells: before the step.
        model: what the step does to the cells; None where it moved no corner of the face.
        optical: what the cells ask for.
    """

    moment: int | None
    cells: FaceCells
    model: ModelFlow | None
    optical: OpticalFlow


@dataclass(frozen=True, eq=False)
class CellFacts:
    """Attributes:
    cells: now, with the k looked at.
    own_dimensions: k of the run.
    energies: (n - 2,) float: the face's energy with k = 1, 2 ...
    flows: None unless asked for, or where the face took no part.
    """

    cells: FaceCells
    own_dimensions: int
    energies: np.ndarray
    flows: StepFlows | None


def cell_facts(session: Session, question: CellQuestion) -> CellFacts:
    """Look it up. A k that this face cannot have is lowered to the largest it can."""
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


def _flows(session: Session, question: CellQuestion, cells: FaceCells, k: int | None) -> StepFlows | None:
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

"""Iteration query: everything that one Gauss-Newton step of a vertex is computed from, and its outcome."""

from dataclasses import dataclass

import numpy as np

from app.debugger.step_text import slot_of
from fairing.judge.inspect import FaceCells, face_cells
from fairing.run.recorded_terms import term_meanings
from fairing.run.session import Session
from fairing.run.stepper import Trial
from fairing.solve.normal_equations import solve_vertices
from fairing.terms.names import PHOTOS


@dataclass(frozen=True)
class IterationQuery:
    """The step of a vertex after one moment of one run, and one of the vertex's faces."""

    run_id: int
    moment: int
    face: int
    vertex: int


@dataclass(frozen=True, eq=False)
class VertexStep:
    """The step of one vertex. The hessians add up to the matrix of the vertex's own system.

    Attributes:
        trial: the step of all vertices that take it.
        slot: index of the vertex in the arrays of the trial.
        hessians: by term, (3, 3) float each, energy / world unit^2, the photos first.
        of_face: (3, 3) float: part of the face in that of the photos.
        alone: (3,) float: the step with all other vertices fixed, world units.
        steps: (3, 3) float: proposed, then after each limit, the last one tried, world units.
        steps_px: (3,) float: their lengths in the photo where they are longest, px.
        alone_px: the same for `alone`.
        ring_energy: of the faces around the vertex, before and after the step; equal if it is rejected.
    """

    trial: Trial
    slot: int
    hessians: dict[str, np.ndarray]
    of_face: np.ndarray
    alone: np.ndarray
    steps: np.ndarray
    steps_px: np.ndarray
    alone_px: float
    ring_energy: tuple[float, float]

    @property
    def normal_matrix(self) -> np.ndarray:
        """(3, 3) float: of all terms, energy / world unit^2."""
        return np.sum(list(self.hessians.values()), axis=0)


@dataclass(frozen=True, eq=False)
class IterationFacts:
    """The result of a query.

    Attributes:
        moment: before the step: that of the query, or the one before it if the run has finished.
        level: of the sweep.
        is_recorded: whether the step after the moment is recorded.
        terms: names of the run's terms.
        cells: of the face, with their derivatives by the vertex.
        step: None if the sweep makes no Gauss-Newton step of the vertex.
    """

    moment: int
    level: int
    is_recorded: bool
    terms: tuple[str, ...]
    cells: FaceCells
    step: VertexStep | None


def iteration_facts(session: Session, question: IterationQuery) -> IterationFacts:
    """Compute the result.

    Raises: as `Session.trial` and `face_cells`.
    """
    trace, moment = session.trace, question.moment
    if moment > 0 and trace.steps[moment - 1].next_position.level >= session.options.n_levels:
        moment -= 1
    cells = face_cells(session, question.face, moment, vertex=question.vertex)
    trial = session.trial(question.vertex, moment)
    step = None if trial is None else _vertex_step(session, trial, question, moment, cells)
    level = session.sweep_state(moment).context.level
    return IterationFacts(moment, level, moment < len(trace), tuple(term_meanings(trace)), cells, step)


def _vertex_step(session: Session, trial: Trial, question: IterationQuery, moment: int, cells: FaceCells) -> VertexStep:
    vertex, proposal, record = question.vertex, trial.proposal, trial.record
    slot = slot_of(record, vertex)
    assert slot is not None
    hessians = {PHOTOS: proposal.hessians[slot]}
    vertices = session.trace.vertices_at(moment)
    hessians |= {term.name: term.hessians(vertices)[vertex] for term in trial.sweep.terms}
    whole = np.sum(list(hessians.values()), axis=0)
    alone = solve_vertices(whole[None], proposal.gradients[[slot]], proposal.damping[[slot]])[0]
    steps = np.array([each[slot] for each in (proposal.proposed, proposal.shortened, proposal.tried)])

    def longest_px(step: np.ndarray) -> float:
        every = np.zeros((len(session.scene.mesh.vertices), 3))
        every[vertex] = step
        return float(session.pixels_moved(every, moment)[vertex])

    around = np.isin(record.faces, session.scene.mesh.one_rings[vertex])
    before, after = (float(e[around].sum()) for e in (record.face_energy_before, record.face_energy_after))
    return VertexStep(
        trial,
        slot,
        hessians,
        _part_of_face(trial, question, cells, session.scene.mesh.faces),
        alone,
        steps,
        np.array([longest_px(step) for step in steps]),
        longest_px(alone),
        (before, after),
    )


def _part_of_face(trial: Trial, question: IterationQuery, cells: FaceCells, faces: np.ndarray) -> np.ndarray:
    """(3, 3) float: the block of the vertex in the normal matrix of the face."""
    system = trial.proposal.system
    row = np.flatnonzero(system.faces == cells.face)
    corner = int(np.flatnonzero(faces[cells.face] == question.vertex)[0])
    block = slice(3 * corner, 3 * corner + 3)
    return system.H[row[0]][block, block] if len(row) else np.zeros((3, 3))

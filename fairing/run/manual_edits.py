"""Manual edits: moves of vertices by a user, and locks."""

from dataclasses import replace

import numpy as np

from fairing.errors import InputError
from fairing.geometry.normals import folded_faces
from fairing.options import FairingOptions
from fairing.run.records import Measured, build_record
from fairing.run.sweep import SweepState
from fairing.scene import Scene
from fairing.solve.normal_equations import vertex_systems
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepReason, StepRecord


def manual_step(
    problem: Problem,
    sweep: SweepState,
    position: SchedulePosition,
    before: np.ndarray,
    vertices: np.ndarray,
    positions: np.ndarray,
    reason: StepReason,
) -> StepRecord:
    """The step of a manual move.

    Args:
        sweep: the present one; its photos evaluate both states.
        position: of the step; the record's next position is the same.
        before: (n, 3) float: positions of all vertices, world units.
        vertices: (u,) int, ids of those that move.
        positions: (u, 3) float: their new positions, world units.
        reason: one of `MANUAL_REASONS`.

    Raises:
        InputError: a vertex is locked or would be behind a camera that sees it, or a face would be flipped or
            collapsed, which only positions read from a file may do.
        Cancelled: cancellation was requested.
    """
    mesh = problem.scene.mesh
    after = before.copy()
    after[vertices] = positions
    if reason is not StepReason.READ_FROM_FILE:
        _check_positions(problem, before, after, vertices)
    faces = np.flatnonzero(np.isin(mesh.faces, vertices).any(axis=1))
    here, there = (
        Measured(sweep.context, problem.linearise(sweep.context, v, sweep.scale, faces)) for v in (before, after)
    )
    if not np.isfinite(there.system.energy).all():
        raise InputError(f"vertex {int(vertices[0])}: would be behind a camera there; nothing was moved")
    H, _ = vertex_systems(mesh, there.system)
    record = build_record(problem, position, sweep.moment, vertices, before, after, reason, measured=(here, there))
    return replace(record, eigenvalues=np.linalg.eigvalsh(H[vertices]))


def _check_positions(problem: Problem, before: np.ndarray, after: np.ndarray, vertices: np.ndarray) -> None:
    """Refuse to move vertices (u,) int that are locked, or to flip or collapse a face.

    Args:
        before, after: (n, 3) float: positions of all vertices now and as requested, world units.
    """
    locked, start, faces = problem.locked, problem.start, problem.scene.mesh.faces
    if locked[vertices].any():
        raise InputError(f"vertex {int(vertices[locked[vertices]][0])}: is locked; unlock it to move it")
    if not np.isfinite(after).all():
        raise InputError(f"vertex {int(vertices[0])}: expected a finite position")
    # A manual edit may rotate a face farther than a step of the engine, but not flip it.
    bad = folded_faces(before, after, start, faces, replace(problem.options.step, max_turn=90.0))
    # A face with all corners at the start is as it was given, whatever its shape.
    bad &= (after[faces] != start[faces]).any(axis=(1, 2)) & np.isin(faces, vertices).any(axis=1)
    if bad.any():
        face = int(np.flatnonzero(bad)[0])
        others = f" and {bad.sum() - 1} more" if bad.sum() > 1 else ""
        raise InputError(f"face {face}{others}: would be turned over or collapsed; nothing was moved")


def with_locks(options: FairingOptions, scene: Scene, vertices: np.ndarray, locked: bool) -> FairingOptions:
    """The options with vertices (u,) int of the mesh locked or unlocked."""
    # The option has the vertex numbers of the input, in which a vertex may have several copies.
    copies = np.flatnonzero(np.isin(scene.original_from_welded, vertices)).tolist()
    chosen = set(options.locked_vertices)
    chosen = chosen | set(copies) if locked else chosen - set(copies)
    return replace(options, locked_vertices=tuple(sorted(chosen)))

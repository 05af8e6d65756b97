"""What a user may do to vertices by hand: where they may be put, and which are locked."""

from dataclasses import replace

import numpy as np

from fairing.errors import InputError
from fairing.geometry.normals import folded_faces
from fairing.options import FairingOptions, StepOptions
from fairing.run.records import Judged, moved_record
from fairing.run.sweep import SweepState
from fairing.scene import Scene
from fairing.solve.normal_equations import vertex_systems
from fairing.solve.problem import Problem
from fairing.trace import SchedulePosition, StepReason, StepRecord

MAX_TURN = 90.0  # degrees: a hand may turn a face farther than a step of the engine may, but not around


def check_places(
    scene: Scene,
    before: np.ndarray,
    after: np.ndarray,
    start: np.ndarray,
    locked: np.ndarray,
    vertices: np.ndarray,
    options: StepOptions,
) -> None:
    """Whether vertices may be put there.

    Args:
        before, after, start: (n, 3) float: positions now, as wished, and at the start of the run.
        locked: (n,) bool.
        vertices: (u,) int: those that the hand moves.

    Raises:
        InputError: a vertex is locked, or a face would be flipped or collapsed; nothing is moved then.
    """
    if locked[vertices].any():
        raise InputError(f"vertex {int(vertices[locked[vertices]][0])}: is locked; unlock it to move it")
    if not np.isfinite(after).all():
        raise InputError(f"vertex {int(vertices[0])}: expected a finite position")
    faces = scene.mesh.faces
    bad = folded_faces(before, after, start, faces, replace(options, max_turn=MAX_TURN))
    # Where all its corners are at the start, a face is as it was given, whatever it looks like.
    bad &= (after[faces] != start[faces]).any(axis=(1, 2)) & np.isin(faces, vertices).any(axis=1)
    if bad.any():
        face = int(np.flatnonzero(bad)[0])
        others = f" and {bad.sum() - 1} more" if bad.sum() > 1 else ""
        raise InputError(f"face {face}{others}: would be turned over or collapsed; nothing was moved")


def manual_step(
    problem: Problem,
    sweep: SweepState,
    position: SchedulePosition,
    before: np.ndarray,
    vertices: np.ndarray,
    places: np.ndarray,
    reason: StepReason,
) -> StepRecord:
    """Put vertices elsewhere; the record's next position is the same.

    Args:
        sweep: the present one, by whose photos both places are judged.
        before: (n, 3) float: where all are, world units.
        vertices: (u,) int, ids.
        places: (u, 3) float: where they are put.
        reason: one of `MANUAL_REASONS`.

    Raises:
        InputError: a vertex is locked or would come behind a camera that sees it, or a face would be flipped or
            collapsed.
    """
    mesh = problem.scene.mesh
    after = before.copy()
    after[vertices] = places
    check_places(problem.scene, before, after, problem.start, problem.locked, vertices, problem.options.step)
    faces = np.flatnonzero(np.isin(mesh.faces, vertices).any(axis=1))
    here, there = (
        Judged(v, sweep.context, problem.linearise(sweep.context, v, faces, np.full(len(faces), -1), sweep.scale))
        for v in (before, after)
    )
    if not np.isfinite(there.system.energy).all():
        raise InputError(f"vertex {int(vertices[0])}: there it would be behind a camera; nothing was moved")
    H, _ = vertex_systems(mesh, there.system)
    record = moved_record(problem, position, sweep.moment, vertices, here, there, reason)
    return replace(record, eigenvalues=np.linalg.eigvalsh(H[vertices]))


def with_locks(options: FairingOptions, scene: Scene, vertices: np.ndarray, locked: bool) -> FairingOptions:
    """The options with vertices (u,) of the mesh locked or unlocked by their numbers."""
    # The option counts vertices as the input does, where one vertex may have several copies.
    copies = np.flatnonzero(np.isin(scene.original_from_welded, vertices)).tolist()
    chosen = set(options.locked_vertices)
    chosen = chosen | set(copies) if locked else chosen - set(copies)
    return replace(options, locked_vertices=tuple(sorted(chosen)))

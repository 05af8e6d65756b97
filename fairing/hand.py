"""What a user may do to vertices by hand: where they may be put, and which are locked."""

from dataclasses import replace

import numpy as np

from fairing.errors import InputError
from fairing.gauss_newton import folded_faces
from fairing.options import FairingOptions, StepOptions
from fairing.scene import Scene

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


def with_locks(options: FairingOptions, scene: Scene, vertices: np.ndarray, locked: bool) -> FairingOptions:
    """The options with vertices (u,) of the mesh locked or unlocked by their numbers."""
    # The option counts vertices as the input does, where one vertex may have several copies.
    copies = np.flatnonzero(np.isin(scene.original_from_welded, vertices)).tolist()
    chosen = set(options.locked_vertices)
    chosen = chosen | set(copies) if locked else chosen - set(copies)
    return replace(options, locked_vertices=tuple(sorted(chosen)))

"""Snapshots: meshes that another program made, as the moments of a run, so that everything that shows runs shows them, too."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fairing.errors import InputError
from fairing.geometry.closest_point import SurfaceTree
from fairing.geometry.triangles import closest_on_triangles
from fairing.mesh import Mesh
from fairing.options import FairingOptions
from fairing.run.session import Session
from fairing.run.trace_header import header_of
from fairing.run_plan import RunPlan
from fairing.scene import Scene
from fairing.trace import StepReason, Trace


def session_of_meshes(
    scene: Scene, meshes: Sequence[Mesh], on_progress: Callable[[float, str], None] = lambda fraction, line: None
) -> Session:
    """A session whose moments are meshes, in their order, seen by the photos at the finest level.

    Meshes with the vertices and faces of the scene's mesh give their positions. Of any other mesh the moment has the scene's
    vertices at the closest points of its surface. The session can go on from its last moment, and a new run begins at its first.

    Args:
        scene: its mesh has the faces that are shown; the last of the meshes is a good choice.
        meshes: at least two, in the frame of the scene, world units.
        on_progress: called with the finished part, 0 to 1, and a line.

    Raises:
        InputError: fewer than two meshes, a vertex behind a camera that sees it, or no photo sees any face well enough.
    """
    if len(meshes) < 2:
        raise InputError(f"meshes: expected at least two, found {len(meshes)}")
    states, farthest = [], 0.0
    for mesh in meshes:
        positions, distance = positions_on(scene, mesh)
        states.append(positions)
        farthest = max(farthest, distance)
    if farthest > 0:
        percent = 100 * farthest / scene.mesh.diagonal
        line = (
            f"some of the {len(meshes)} meshes have other vertices or faces: shown are those of the scene's mesh, moved by up to "
            f"{percent:.2g} % of its diagonal to the closest points of each mesh"
        )
        scene = replace(scene, warnings=(*scene.warnings, line))
    options = FairingOptions()
    trace = Trace(header_of(scene, options), states[0], scene.mesh.faces)
    session = Session(scene, trace=trace)
    # The meshes are what they are: no level, smoothing or fit that this program would begin with.
    trace.record_plan(RunPlan(options.n_levels - 1, is_smoothed=False, is_fitted_to_points=False, records_fit=True))
    everything = np.arange(len(states[0]))
    for number, state in enumerate(states[1:], start=2):
        on_progress((number - 1) / len(states), f"mesh {number} of {len(states)}")
        try:
            session.place(everything, state, StepReason.READ_FROM_FILE)
        except InputError as error:
            raise InputError(f"mesh {number}: {error}") from None
    return session


def positions_on(scene: Scene, mesh: Mesh) -> tuple[np.ndarray, float]:
    """Positions (n, 3) of the scene's vertices on another mesh, world units, and their largest distance from the scene's own.

    The distance is 0 where the meshes have the same vertices and faces, whose positions are then those of the mesh.
    """
    if len(mesh.vertices) == len(scene.original_from_welded) and np.array_equal(mesh.faces, scene.original_faces):
        _, first = np.unique(scene.original_from_welded, return_index=True)
        return mesh.vertices[first], 0.0
    distance, faces = SurfaceTree(mesh).closest(scene.mesh.vertices)
    positions = closest_on_triangles(mesh.vertices[mesh.faces[faces]], scene.mesh.vertices)
    return positions, float(distance.max())

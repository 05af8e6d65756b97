"""The mesh as points known of its surface would have it: the sparse points that came with a capture.

Structure from motion measured them, so they are evidence as the photos are. They tell where a start bridges a recess with
a large face or lies far off, which no texture within reach of a vertex does; the photos tell it finely where they agree.
Every second point is used. The others are kept to judge by: what a report says of the points was not fitted to them.

Measured on captures with start meshes from structure from motion: median distance of the kept points to the surface in %
of the diagonal, at the start and after fairing without and with the others; and PSNR of photos left out.

fountain: 0.0797 -> 0.0724 and 0.0540, 26.49 -> 26.78 and 28.21 dB; castle: 0.1716 -> 0.1670 and 0.1153, 24.62 -> 24.9
and 25.29 dB; Sceaux: 0.1008 -> 0.0970 and 0.0722, 20.80 -> 20.9 and 21.35 dB. From noisy meshes, mean distance to a
reference surface: fountain 0.309 -> 0.140 and 0.124, castle 0.322 -> 0.201 and 0.186 %.
"""

import numpy as np
import trimesh
from scipy.sparse import coo_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from fairing.geometry.closest_point import SurfaceTree
from fairing.geometry.normals import face_normals
from fairing.mesh import Mesh
from fairing.scene import Scene
from fairing.solve.normal_equations import QuadraticPrior
from fairing.solve.problem import Problem

REACH = 0.5  # of a face's mean edge: points farther off belong to something else
SIDEWAYS = 0.5  # cosine: points farther round an edge than this lie beyond the mesh's rim
ROUNDING = 1e-6  # of the reach: smaller residuals are equal
HOLD = 0.03  # pull to where a vertex was, as a fraction of what points know of a coordinate on average
# (Held-out medians on fountain, Sceaux, castle and faces flipped before any is prevented, with Huber's norm: 0.003: 0.0548,
# 0.0735, 0.1153, 65 flips; 0.03: 0.0585, 0.0779, 0.1257, none; 0.1: 0.0625, 0.0847, 0.1379. Sum of distances instead of
# Huber's norm at 0.03: 0.0603, 0.0834, 0.1337; Geman-McClure's 0.0630, 0.0825, 0.1541.)


def fitting_points(scene: Scene) -> np.ndarray:
    """(p, 3) float, world units: the sparse points that vertices are drawn to: every second one."""
    return scene.sparse_positions[::2]


def kept_points(scene: Scene) -> np.ndarray:
    """(p, 3) float, world units: the sparse points that are kept to judge by."""
    return scene.sparse_positions[1::2]


def fitted_to_points(problem: Problem, vertices: np.ndarray, rounds: int) -> QuadraticPrior:
    """Vertices moved until half of the points lie on the faces: Huber's norm of the distances along the normals.

    Args:
        vertices: (n, 3) float: where they are, world units; a vertex that no point tells of stays there.
        rounds: how often each point looks anew for the face it lies nearest to.

    Returns:
        A pull to the places found, in proportion to what the points know of each vertex there: 1 in a direction they
        know as well as they know a coordinate on average.
    """
    mesh, points = problem.scene.mesh, fitting_points(problem.scene)
    ids = np.flatnonzero(~problem.locked)
    columns = (3 * ids[:, None] + np.arange(3)).ravel()
    edges = vertices[np.roll(mesh.faces, -1, axis=1)] - vertices[mesh.faces]
    reach = REACH * np.linalg.norm(edges, axis=2).mean(axis=1)
    places, average, blocks = vertices, 0.0, np.zeros((len(vertices), 3, 3))
    for _ in range(rounds):
        corners, rows, residual = _residuals(mesh.moved(places), points, reach)
        scale = max(
            1.4826 * float(np.median(np.abs(residual))) if len(residual) else 0.0, ROUNDING * float(reach.max())
        )
        robust = 1 / np.maximum(1, np.abs(residual) / scale)
        index = (3 * corners[:, :, None] + np.arange(3)).ravel()
        J = coo_array(
            (rows.ravel(), (np.repeat(np.arange(len(rows)), 9), index)), shape=(len(rows), vertices.size)
        ).tocsc()[:, columns]
        H = (J.T @ diags_array(robust) @ J).tocsc()
        known = H.diagonal()[H.diagonal() > 0]
        if len(known) == 0:
            break
        average = average or float(known.mean())
        hold = HOLD * average
        gradient = J.T @ (robust * residual) + hold * (places - vertices).ravel()[columns]
        steps = splu(H + hold * eye_array(len(columns), format="csc")).solve(-gradient).reshape(-1, 3)
        steps, _ = problem.unfolded(places, ids, steps)
        places = places.copy()
        places[ids] += steps
        blocks = np.zeros((len(vertices), 3, 3))
        np.add.at(blocks, corners, robust[:, None, None, None] * rows[:, :, :, None] * rows[:, :, None, :])
    return QuadraticPrior(blocks / max(average, 1e-300), places)


def _residuals(mesh: Mesh, points: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (p, 3) near a face (within its reach, (m,), world units), and how far they lie off it.

    Returns:
        The face's vertices (q, 3) int, the residual's derivatives with respect to them (q, 3, 3), and the residual (q,).
    """
    distance, face = SurfaceTree(mesh).closest(points)
    near = distance < reach[face]
    distance, target, corners = distance[near, None], points[near], mesh.faces[face[near]]
    triangles = mesh.vertices[corners]
    foot = trimesh.triangles.closest_point(triangles, target)
    normals = face_normals(mesh.vertices, corners)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    # Off an edge the way to the point is neither face's normal, and the same whichever of the two is taken.
    way = (target - foot) / np.maximum(distance, 1e-300)
    direction = np.where(distance > ROUNDING * reach.max(initial=0), way, normals)
    in_front = np.abs((direction * normals).sum(axis=1)) > SIDEWAYS
    direction, triangles, foot = direction[in_front], triangles[in_front], foot[in_front]
    weights = trimesh.triangles.points_to_barycentric(triangles, foot)
    residual = ((foot - target[in_front]) * direction).sum(axis=1)
    return corners[in_front], weights[:, :, None] * direction[:, None, :], residual

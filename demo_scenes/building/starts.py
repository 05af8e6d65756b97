"""Start meshes of the family, and what is known of their truth.

Starts whose vertices stand for places of the building ("corners", "noise") know where each vertex belongs. Starts with a
connectivity of their own ("decimated", "points") know the true surface only.
"""

from dataclasses import dataclass

import numpy as np

from demo_scenes.building.decimate import decimate
from demo_scenes.building.plan import FACES, Plan
from demo_scenes.building.points import SfmPoints
from demo_scenes.building.walls import build_walls
from demo_scenes.noise import seeded
from demo_scenes.sheet import Sheet
from demo_scenes.start import displaced_at_random, slide_off_corners
from fairing.geometry.normals import unit_normals
from fairing.mesh import Mesh
from fairing.scene import SparsePoints, Truth, View

LEAST_ERROR = 0.6  # smallest displacement of a vertex, as a fraction of the largest
DENSE = 0.45  # edge length before decimation, as a fraction of the mesh's
SAME_SURFACE = np.sin(0.17)  # normals that differ by less belong to one surface: a plane or a curve
ON_FACE = 1e-6  # metres: a vertex this near to a face lies on it


@dataclass(frozen=True, eq=False)
class Start:
    """A start mesh: vertices (n, 3) float, metres, and faces (m, 3) int, with what is known of its truth."""

    vertices: np.ndarray
    faces: np.ndarray
    truth: Truth


def build_start(plan: Plan, shown: Sheet, views: tuple[View, ...], points: SfmPoints | None) -> Start:
    """The start mesh that the plan names.

    Args:
        shown: the building in the photos.
        points: all sparse points; needed for a start from points.
    """
    surface = Mesh(shown.vertices, shown.faces)
    rng = seeded(*plan.seed, 66)
    if plan.start in ("corners", "noise"):
        sheet = plan.sheet()
        move = slide_off_corners if plan.start == "corners" else displaced_at_random
        distances = LEAST_ERROR * plan.start_error, plan.start_error
        start = move(sheet.vertices, sheet.faces, distances, rng)
        return Start(start, sheet.faces, Truth(surface, sheet.vertices, true_normals(sheet.vertices, surface)))
    if plan.start == "decimated":
        return Start(*_decimated(plan, rng), Truth(surface))
    assert points is not None
    return Start(*_from_points(plan, views, points, rng), Truth(surface))


def true_normals(vertices: np.ndarray, surface: Mesh) -> list[np.ndarray]:
    """For each vertex (n, 3) the (d <= 3, 3) unit normals of the true surfaces that meet there.

    Facets that differ by less than 0.17 rad are one curved surface; its normal is their mean.
    """
    normals, _ = unit_normals(surface.vertices, surface.faces)
    corners = surface.vertices[surface.faces]
    result = []
    for vertex in vertices:
        near = np.flatnonzero(np.abs(((vertex - corners[:, 0]) * normals).sum(axis=1)) < ON_FACE)
        inward = np.cross(normals[near][:, None], np.roll(corners[near], -1, axis=1) - corners[near])
        inward /= np.linalg.norm(inward, axis=2, keepdims=True)
        inside = ((inward * (vertex - corners[near])).sum(axis=2) > -ON_FACE).all(axis=1)
        meeting = np.unique(np.round(normals[near[inside]], 9), axis=0)
        assert len(meeting) > 0, f"{vertex} lies off the surface"
        result.append(_spanning(meeting))
    return result


def _spanning(meeting: np.ndarray) -> np.ndarray:
    """At most three normals that span those of all surfaces that meet (k, 3), each leaving the span of those before."""
    chosen: list[np.ndarray] = []
    while len(chosen) < 3:
        rest = meeting
        if chosen:
            basis = np.linalg.qr(np.array(chosen).T)[0]
            rest = meeting - meeting @ basis @ basis.T
        farthest = int(np.argmax((rest**2).sum(axis=1)))
        if np.linalg.norm(rest[farthest]) < SAME_SURFACE:
            break
        curve = meeting[np.linalg.norm(np.cross(meeting, meeting[farthest]), axis=1) < SAME_SURFACE]
        mean = curve[curve @ meeting[farthest] > 0].mean(axis=0)
        chosen.append(mean / np.linalg.norm(mean))
    return np.array(chosen)


def _decimated(plan: Plan, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A dense mesh with errors along its normals, rough and wavy, decimated to the plan's number of faces."""
    # Curved parts keep the mesh's own facets: finer ones are slivers, on which decimation would spend its faces.
    dense = build_walls(plan.frame, plan.seed, DENSE * plan.spacing)
    of_faces, _ = unit_normals(dense.vertices, dense.faces)
    normals = np.zeros_like(dense.vertices)
    for corner in dense.faces.T:
        np.add.at(normals, corner, of_faces)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    waves = 2 * np.pi / rng.uniform(1.5, 5.0, (3, 1)) * _unit(rng.standard_normal((3, 3)))
    wavy = np.sin(dense.vertices @ waves.T + rng.uniform(0, 2 * np.pi, 3)).sum(axis=1) / np.sqrt(1.5)
    rough = rng.standard_normal(len(dense.vertices))
    error = 0.7 * plan.start_error * wavy + min(0.5 * plan.start_error, 0.08 * plan.spacing) * rough
    n_faces = len(plan.sheet().faces)
    return decimate(dense.vertices + error[:, None] * normals, dense.faces, n_faces)


def _from_points(
    plan: Plan, views: tuple[View, ...], points: SfmPoints, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """The triangulation of some of the building's sparse points, moved by as much again as the start's error."""
    from fairing.triangulation import TriangulationOptions, start_mesh

    chosen = np.flatnonzero(points.on_building)
    number = np.full(len(points.on_building), -1)
    number[chosen] = np.arange(len(chosen))
    of_building = number[points.sparse.observations[:, 0]] >= 0
    observations = points.sparse.observations[of_building]
    observations = np.column_stack([number[observations[:, 0]], observations[:, 1]])
    sparse = SparsePoints(
        points.sparse.positions[chosen], points.sparse.colors[chosen], observations, points.sparse.pixels[of_building]
    )
    most = int(np.clip(len(plan.sheet().vertices), 0.6 * FACES[0], 0.45 * FACES[1]))
    mesh = start_mesh(views, sparse, TriangulationOptions(max_vertices=most, spacing=16.0))
    distances = LEAST_ERROR * plan.start_error, plan.start_error
    return displaced_at_random(mesh.vertices, mesh.faces, distances, rng), mesh.faces


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)

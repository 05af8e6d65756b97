"""Initial mesh from sparse points: the surface of a minimum cut through their Delaunay tetrahedra, thinned.

A tetrahedron is inside or outside the object. The lines of sight from points to the cameras that see them should run outside and
end at the surface; the minimum cut is the division that violates them least (Labatut, Pons, Keriven, ICCV 2007 and CGF 2009).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fairing.errors import InputError
from fairing.geometry.decimate import decimate
from fairing.geometry.normals import face_normals
from fairing.scene import SparsePoints, View
from fairing.triangulation.carving import MOST_POINTS, Carving
from fairing.triangulation.cut_surface import cut_surface
from fairing.triangulation.minimum_cut import minimum_cut
from fairing.triangulation.options import TriangulationOptions
from fairing.triangulation.points import judge_points, merge_close
from fairing.triangulation.seen_surface import seen_surface
from fairing.triangulation.sight_lines import sight_costs
from fairing.triangulation.tetrahedra import Tetrahedra, tetrahedra

MERGED = 2.0
"""Points nearer to a stronger one than this are merged into it, px of a typical photo."""
SIGMA = 0.1
"""Uncertainty of the points, in units of the lower quartile of the tetrahedra's edges (ledger: start mesh, sigma)."""
QUALITY = 0.2
"""Cost of a facet of quality 1, in lines of sight (ledger: start mesh, quality of facets)."""
CELL, CLOSEST = 2.0, 0.5
"""In units of `TriangulationOptions.spacing`: the surface has a vertex for each square of this side, and neighbours are at least
this far apart; vertices gather at creases (ledger: start mesh, number of vertices)."""
DECIMATED = 6
"""Meshes that the record of a carving holds between the seen surface and the start mesh, and the seen surface."""
APART = 0.01
"""Vertices at the same place, where parts of the surface touch, move this fraction of the way to their neighbours."""


@dataclass(frozen=True, eq=False)
class StartMesh:
    """Vertices and faces, counter-clockwise seen from the photos, and their origin.

    Attributes:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int, an oriented two-manifold with border where no photo sees the surface.
        n_points: number of points whose tetrahedra were cut.
        left_out: number of other points, by reason.
        carving: how the surface came about; None of more points than can be recorded.
    """

    vertices: np.ndarray
    faces: np.ndarray
    n_points: int
    left_out: dict[str, int]
    carving: Carving | None


def start_mesh(views: Sequence[View], points: SparsePoints, options: TriangulationOptions) -> StartMesh:
    """The surface that sparse points and their lines of sight suggest.

    Raises:
        InputError: too few points, or they span no surface.
    """
    facts = judge_points(views, points, options)
    usable = np.flatnonzero(facts.usable)
    positions = points.positions[usable]
    # Of points in equally many photos the one with the smaller error is stronger.
    strength = (facts.n_photos - np.minimum(facts.error / 1e3, 0.5))[usable]
    keeper = merge_close(positions, strength, MERGED * facts.pixel[usable])
    facts.leave_out(usable[keeper != np.arange(len(keeper))], "merged into a stronger point nearby")
    corner = np.full(len(facts.n_photos), -1)
    kept, corner[usable] = np.unique(keeper, return_inverse=True)
    positions, pixel = positions[kept], facts.pixel[usable][kept]
    lines = np.column_stack([corner[points.observations[:, 0]], points.observations[:, 1]])
    lines = np.unique(lines[lines[:, 0] >= 0], axis=0)
    mesh = tetrahedra(positions, np.array([view.camera.center for view in views]))
    sigma = SIGMA * float(np.quantile(mesh.edge_lengths(), 0.25))
    is_outside = _outside(mesh, lines, sigma)
    faces, vertex = cut_surface(mesh, is_outside)
    vertices = positions[vertex]
    gap = float(np.median(CELL * options.spacing * pixel)) ** 2
    faces, former, fates = seen_surface(vertices, faces, views, gap)
    if len(faces) == 0:
        raise InputError(
            "triangulation: expected sparse points that span a surface in some photo, found none; "
            "give a mesh with --mesh"
        )
    vertices, pixel = vertices[former], pixel[vertex[former]]
    spacing = options.spacing * pixel
    area = np.linalg.norm(face_normals(vertices, faces), axis=1) / 2
    usual = int((area / (CELL * spacing[faces].mean(axis=1)) ** 2).sum())
    reasons, counts = np.unique(facts.left_out[~facts.usable].astype(str), return_counts=True)
    left_out = dict(zip(reasons.tolist(), counts.tolist(), strict=True))
    carving = None
    if len(positions) <= MOST_POINTS:
        colors = points.colors[usable][kept]
        names = tuple(view.name for view in views)
        stages = _decimation(vertices, faces, usual)
        carving = Carving(mesh, colors, names, lines, sigma, QUALITY, is_outside, fates, stages, left_out)
    vertices, faces = decimate(vertices, faces, CLOSEST * spacing, usual, options.max_vertices)
    return StartMesh(_apart(vertices, faces), faces, len(positions), left_out, carving)


def _outside(mesh: Tetrahedra, lines: np.ndarray, sigma: float) -> np.ndarray:
    """(T,) bool: the tetrahedra outside in the minimum cut, with lines of sight (r, 2) from points to cameras."""
    votes = sight_costs(mesh, lines[:, 0], lines[:, 1], np.full(mesh.n_points, sigma))
    costs = votes.crossing + QUALITY * mesh.facet_quality()
    has_camera = np.zeros(len(costs), dtype=bool)
    has_camera[mesh.of_cameras] = True
    tetrahedron, facet = np.nonzero(mesh.neighbours >= 0)
    ends = np.column_stack([tetrahedron, mesh.neighbours[tetrahedron, facet]])
    return minimum_cut(len(costs), ends, costs[tetrahedron, facet], has_camera, votes.inside)


def _decimation(vertices: np.ndarray, faces: np.ndarray, usual: int) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """A surface, and its decimations on the way to the usual number of vertices."""
    counts = np.geomspace(len(vertices), max(usual, 4), DECIMATED + 1)[1:-1].astype(int)
    anywhere = np.zeros(len(vertices))
    return ((vertices, faces), *(decimate(vertices, faces, anywhere, int(count)) for count in counts))


def _apart(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The vertices (n, 3), those at the same place moved towards their neighbours, each into its own part of the surface."""
    _, place, count = np.unique(vertices, axis=0, return_inverse=True, return_counts=True)
    shared = count[place.ravel()] > 1
    total, n_neighbours = np.zeros_like(vertices), np.zeros(len(vertices))
    for k in range(3):
        np.add.at(total, faces[:, k], vertices[faces[:, (k + 1) % 3]] + vertices[faces[:, (k + 2) % 3]])
        np.add.at(n_neighbours, faces[:, k], 2)
    middle = total / np.maximum(n_neighbours, 1)[:, None]
    return np.where(shared[:, None], vertices + APART * (middle - vertices), vertices)

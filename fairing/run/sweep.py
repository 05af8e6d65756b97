"""State of a sweep: visibility, robust scale, the terms of the objective, and the blocks of vertices in their order."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fairing.cells.context import CellContext
from fairing.features.points import FeaturePoints
from fairing.geometry.normal_filter import smoothed
from fairing.geometry.normals import unit_normals
from fairing.geometry.pixel_size import pixel_size
from fairing.mesh import Mesh
from fairing.optimize.rows import Anchor, Rows, Term
from fairing.run.fits import points_on_mesh
from fairing.run.phases import Level
from fairing.run.stages import PASSES, Photos
from fairing.solve.blocks import Block, plan_blocks
from fairing.solve.energy import FaceSystem, loss_of_faces
from fairing.solve.normal_equations import vertex_systems
from fairing.solve.problem import Problem
from fairing.terms.axes import related, relations
from fairing.terms.closest_points import average_information, closest_points
from fairing.terms.image_edges import SEARCHES, image_edges
from fairing.terms.names import SMOOTHNESS, START
from fairing.terms.own import OwnTerm, begun

# Of the residuals around a vertex, grey levels^2: the points fade below it (ledger: prior to points).
POINTS_VARIANCE = 8.0
# px^2 of the photos: the area over which residuals of what is not on the mesh agree (ledger: prior to the start).
RESIDUAL_AREA = 10_000.0


@dataclass(frozen=True, eq=False)
class SweepState:
    """What is constant during a sweep: a function of the vertices at its beginning.

    Attributes:
        moment: at which the sweep began.
        stage: the stage the sweep belongs to.
        context: cells and visibility.
        sigma: (m,) float: scale parameter of the robust loss by face, grey levels.
        scale: (m,) float: the value of the kernels for it, see `Norm.squared_scale`.
        terms: of the objective beside the photos.
        free: (n,) bool: vertices that are not locked and that enough photos see.
        blocks: in their order.
        pixels_per_unit: (n,) float: largest motion of a vertex in a photo, px per world unit; 0 where unseen.
        near_points: of the surface sweeps of the last fit; None without any.
        edge_search: for image edges: largest offset, and scale of the loss, px.
        system: normal equations of all faces at the beginning, by all corners, for a first step of all vertices at once; else None.
    """

    moment: int
    stage: Photos
    context: CellContext
    sigma: np.ndarray
    scale: np.ndarray
    terms: tuple[Term, ...]
    free: np.ndarray
    blocks: list[Block]
    pixels_per_unit: np.ndarray
    near_points: FeaturePoints | None
    edge_search: tuple[float, float]
    system: FaceSystem | None

    def longest_move(self, problem: Problem, vertices: np.ndarray) -> float:
        """Longest move of a free vertex in a photo since the beginning of the sweep, px; vertices (n, 3): positions now."""
        ids, begun = np.flatnonzero(self.free), self.context.vertices
        moved = problem.pixels_moved(self.context, begun, ids, vertices[ids] - begun[ids])
        return float(moved.max(initial=0))


def begin_sweep(
    problem: Problem,
    level: Level,
    stage: Photos,
    moment: int,
    vertices: np.ndarray,
    origin: np.ndarray,
    near_points: FeaturePoints | None = None,
    number: int = 0,
    own_terms: Sequence[OwnTerm] = (),
) -> SweepState:
    """Compute visibility, robust scale, terms and blocks.

    Args:
        level: gives the strengths of the terms.
        stage: the stage the sweep belongs to.
        moment: of the beginning.
        vertices: (n, 3) float: positions then, world units.
        origin: (n, 3) float: positions at the prepared start, or after the last manual edit of a vertex, world units.
        near_points: see `SweepState`.
        number: of the sweep in its stage.
        own_terms: beside the built-in ones.

    Raises:
        InputError: no photo sees any face well enough at the last level; or a term of one's own failed.
        Cancelled: cancellation was requested.
    """
    options, mesh = problem.options, problem.scene.mesh
    context = problem.context(level.number, vertices)
    sigma = problem.sigma(context, vertices)
    scale = problem.norm.squared_scale(sigma)
    system = problem.linearise(context, vertices, scale)
    H, _ = vertex_systems(mesh, system)
    information = np.linalg.eigvalsh(H)[:, 2]
    informed = information > 0
    typical = float(np.median(information[informed])) if informed.any() else 0.0
    pixels = problem.pixels_per_unit(context, vertices)
    loss = _vertex_losses(mesh, context, system)
    is_smoothed = level.smoothing > 0 and informed.any()
    if level.start_sigma > 0:
        terms: list[Term] = [_to_start(origin, loss, level.prior * (pixels / level.start_sigma) ** 2)]
    else:
        terms = [_within_surface(mesh, vertices, origin, context.takes_part, level.prior * np.maximum(information, 0))]
    if is_smoothed:
        terms.append(Anchor.uniform(SMOOTHNESS, level.smoothing * typical, smoothed(mesh, vertices, PASSES)))
    if level.attraction > 0:
        variance = _vertex_losses(mesh, context, system, sigma**2)
        terms += _points(problem, vertices, near_points, level.attraction * typical, variance)
    search = _search(level.edge_reach, number)
    if level.creases > 0:
        terms += _edges_and_axes(problem, vertices, search, level.creases * RESIDUAL_AREA * loss, H)
    own = [begun(term, problem.scene, vertices, ~problem.locked, typical) for term in own_terms]
    terms += [term for term in own if term is not None]
    free = ~problem.locked & (informed | is_smoothed)  # the smoothness prior determines vertices that no photo sees
    movable = free & ((pixels > 0) | is_smoothed)
    blocks = plan_blocks(mesh, movable, options.schedule.order, system.energy)
    return SweepState(
        moment,
        stage,
        context,
        sigma,
        scale,
        tuple(terms),
        free,
        blocks,
        pixels,
        near_points,
        search,
        system if options.schedule.order == "joint" else None,
    )


def _to_start(origin: np.ndarray, loss: np.ndarray, precision: np.ndarray) -> Anchor:
    """Prior to the origin (n, 3): strong where photos contradict each other, negligible where they agree.

    It holds what nothing else determines. (ledger: prior to the start)

    Args:
        loss: (n,) float: mean loss per photo px around each vertex.
        precision: (n,) float: 1 / variance of the start, 1 / world unit^2.
    """
    return Anchor.uniform(START, RESIDUAL_AREA * loss * precision, origin)


def _within_surface(
    mesh: Mesh, vertices: np.ndarray, origin: np.ndarray, takes_part: np.ndarray, strength: np.ndarray
) -> Anchor:
    """Prior to the origin (n, 3) in directions in which the surface moves within itself: within a plane, along an edge.

    The normals of the faces around a vertex have no spread along these. Photos that show little texture there would let the
    vertex slide; perpendicular to them the prior has no strength. (ledger: prior to the start)

    Args:
        vertices: (n, 3) float, world units.
        takes_part: (m,) bool: faces that enough photos see.
        strength: (n,) float: energy / world unit^2.
    """
    normals, area = unit_normals(vertices, mesh.faces)
    weight = np.repeat(area * takes_part, 3)
    spread, total = np.zeros((len(vertices), 3, 3)), np.zeros(len(vertices))
    np.add.at(
        spread, mesh.faces.ravel(), weight[:, None, None] * np.repeat(normals[:, :, None] * normals[:, None], 3, axis=0)
    )
    np.add.at(total, mesh.faces.ravel(), weight)
    values, vectors = np.linalg.eigh(spread / np.maximum(total, 1e-300)[:, None, None])
    flat = (values < 0.01) * strength[:, None]  # a standard deviation of the normals of 6 degrees
    return Anchor(START, np.einsum("vik,vk,vjk->vij", vectors, flat, vectors), origin)


def _points(
    problem: Problem, vertices: np.ndarray, near_points: FeaturePoints | None, strength: float, variance: np.ndarray
) -> list[Rows]:
    """The term of the points at their closest faces; it fades where the photos agree.

    Args:
        near_points: see `SweepState`.
        strength: energy / world unit^2 in a direction that the points determine as well as an average one.
        variance: (n,) float: of the residuals around each vertex, grey levels^2; 0 where no photo sees the mesh.
    """
    on_mesh = points_on_mesh(problem.scene, problem.observed_points, vertices, near_points)
    points = closest_points(problem.scene.mesh.moved(vertices), on_mesh, vertices)
    average = average_information(points, vertices, ~problem.locked)
    if average == 0:
        return []
    share = np.minimum(1.0, np.where(variance == 0, np.inf, variance) / POINTS_VARIANCE)
    return [points.scaled(strength / average * share)]


def _search(reach: float, number: int) -> tuple[float, float]:
    """The search for image edges of a sweep: largest offset, within the reach, and scale of the loss, px."""
    first = sum(farthest > reach for farthest, _ in SEARCHES[:-1])
    return SEARCHES[min(first + number, len(SEARCHES) - 1)]


def _edges_and_axes(
    problem: Problem, vertices: np.ndarray, search: tuple[float, float], strength: np.ndarray, H: np.ndarray
) -> list[Rows]:
    """The terms of image edges and, on buildings, of axes.

    They fade in directions that the cells determine better: offsets are less accurate then (ledger: fading of image edges).

    Args:
        vertices: (n, 3) float, world units.
        search: see `image_edges`.
        strength: (n,) float: energy of a deviation, times px^2.
        H: (n, 3, 3) float: normal matrices of the cells, energy / world unit^2.
    """
    views, faces = problem.scene.views, problem.scene.mesh.faces
    terms = [image_edges(views, vertices, faces, problem.orientation, search, problem.pool)]
    found = relations(vertices, faces, pixel_size(problem.cameras, vertices))
    if len(found.pairs):
        terms.append(related(found, vertices))
    terms = [term.scaled(strength) for term in terms]
    own = np.sum([term.hessians(vertices) for term in terms], axis=0)
    return [_faded(term, own, H) for term in terms]


def _faded(rows: Rows, own: np.ndarray, others: np.ndarray) -> Rows:
    """Residuals times their share of the information along their derivatives, the mean of their vertices.

    Args:
        own, others: (n, 3, 3) float: normal matrices of what fades, and of what it fades beside, energy / world unit^2.
    """
    d = rows.derivatives
    # A quadratic form may come out below zero by rounding.
    own_along, others_along = (np.maximum(np.einsum("rci,rcij,rcj->rc", d, H[rows.ids], d), 0) for H in (own, others))
    return rows.weighted(own_along / np.maximum(own_along + others_along, 1e-300))


def _vertex_losses(mesh: Mesh, context: CellContext, system: FaceSystem, unit: np.ndarray | None = None) -> np.ndarray:
    """(n,) float: mean loss per photo px of the faces around each vertex; 0 where no photo sees them.

    Args:
        unit: (m,) float: of the loss of each face; default: 1.
    """
    loss, pixels = loss_of_faces(context, system)
    if unit is not None:
        loss = loss * unit[system.faces]
    total, weight = (
        np.bincount(mesh.faces[system.faces].ravel(), weights=np.repeat(values, 3), minlength=len(mesh.vertices))
        for values in (loss * pixels, pixels)
    )
    return total / np.maximum(weight, 1e-300)

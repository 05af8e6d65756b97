"""Associations of the terms at a moment: what each term measures the mesh against, for display.

The engine finds them anew in every sweep and stage; these are the ones that it would find with the vertices where they are.
"""

from dataclasses import dataclass

import numpy as np

from fairing.creases.edges import find_creases
from fairing.geometry.pixel_size import pixel_size
from fairing.optimize.loss import GemanMcClure, Huber
from fairing.run.fits import points_on_mesh
from fairing.run.session import Session
from fairing.solve.point_split import observed_fitting_points
from fairing.terms.axes import relations
from fairing.terms.closest_points import feet_of
from fairing.terms.image_edges import offsets_in

REJECTED = 0.1  # part of the full weight: the loss rejects what it gives less
SAME_AXIS = 0.999  # cosine: directions within it of each other are one axis


@dataclass(frozen=True, eq=False)
class ImageEdges:
    """Segments of creases in one photo, and the edges of the photo that they are drawn to.

    Attributes:
        view: id of the photo.
        crease: (s, 2) int: vertices at the ends of the segment's crease.
        places: (s, 3) float: middle of each segment, world units.
        crease_px: (s, 2) float: the same in the photo, px.
        edge_px: (s, 2) float: the strongest edge nearby, across the crease, px.
        along_px: (s, 2) float: unit vector along the crease in the photo.
        weights: (s,) float, 0 to 1: certainty of the edge times the weight of the robust loss.
        rejected: (s,) bool: whether the loss rejects the offset.
    """

    view: int
    crease: np.ndarray
    places: np.ndarray
    crease_px: np.ndarray
    edge_px: np.ndarray
    along_px: np.ndarray
    weights: np.ndarray
    rejected: np.ndarray

    def of(self, segments: np.ndarray) -> "ImageEdges":
        """Those of a mask (s,) bool of segments."""
        arrays = (self.crease, self.places, self.crease_px, self.edge_px, self.along_px, self.weights, self.rejected)
        return ImageEdges(self.view, *(values[segments] for values in arrays))


@dataclass(frozen=True, eq=False)
class AxisEdges:
    """Edges of the mesh that follow an axis of its Manhattan frame.

    Attributes:
        edges: (e, 2) int: vertex ids.
        axis: (e,) int: index into `axes`.
        axes: (a, 3) float: unit vectors; a = 0 without a frame, else at most 3.
    """

    edges: np.ndarray
    axis: np.ndarray
    axes: np.ndarray


@dataclass(frozen=True, eq=False)
class PointFeet:
    """Sparse points of the fit, each with the closest point on the surface.

    Attributes:
        positions: (q, 3) float: of the points, world units.
        feet: (q, 3) float: on the surface, world units.
        faces: (q,) int: the faces of the feet.
        weights: (q,) float, 0 to 1: weight of the robust loss; 0 for points that are too far from their face.
    """

    positions: np.ndarray
    feet: np.ndarray
    faces: np.ndarray
    weights: np.ndarray

    @property
    def rejected(self) -> np.ndarray:
        """(q,) bool: whether the loss rejects the point, or it is too far."""
        return self.weights < REJECTED


def seen_faces(session: Session, moment: int) -> np.ndarray:
    """(m, V) bool: the photos that the cells of each face are taken from in the sweep of a moment.

    Raises: as `Session.sweep_state`.
    """
    kernel = session.sweep_state(moment).context.kernel
    count = len(session.scene.mesh.faces)
    result = np.zeros((count, len(session.scene.views)), dtype=bool)
    result[np.repeat(np.arange(count), np.diff(kernel.pair_start)), kernel.pair_view] = True
    return result


def image_edges(session: Session, moment: int, view: int) -> ImageEdges:
    """The image edges that the creases seen in a photo are drawn to, by the search of the sweep.

    Args:
        view: id of the photo.

    Raises: as `Session.sweep_state`.
    """
    scene, vertices = session.scene, session.trace.vertices_at(moment)
    camera, faces = scene.views[view].camera, scene.mesh.faces
    creases = find_creases(vertices, faces, session.orientation)
    reach, scale = session.sweep_state(moment).edge_search
    found = offsets_in(scene.views[view], vertices, faces, creases, reach)
    ends = creases.ends[found.crease]
    first, second = vertices[ends[:, 0]], vertices[ends[:, 1]]
    places = first + found.along[:, None] * (second - first)
    along = camera.project(second)[0] - camera.project(first)[0]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    across = np.column_stack([-along[:, 1], along[:, 0]])
    crease_px = camera.project(places)[0]
    edge_px = crease_px + found.offset[:, None] * across
    weights = GemanMcClure(scale).weight(found.offset)
    return ImageEdges(view, ends, places, crease_px, edge_px, along, found.weight * weights, weights < REJECTED)


def axis_edges(session: Session, moment: int) -> AxisEdges:
    """The edges that the relations of the Manhattan frame hold parallel to an axis."""
    vertices = session.trace.vertices_at(moment)
    pixel = pixel_size([view.camera for view in session.scene.views], vertices)
    found = relations(vertices, session.scene.mesh.faces, pixel)
    directions = found.directions / np.maximum(np.linalg.norm(found.directions, axis=1, keepdims=True), 1e-300)
    axes = np.zeros((0, 3))
    for direction in directions:
        if len(axes) < 3 and not (np.abs(axes @ direction) > SAME_AXIS).any():
            axes = np.vstack([axes, direction])
    if len(axes) == 2:
        axes = np.vstack([axes, np.cross(axes[0], axes[1])])
    if len(axes) < 3:
        return AxisEdges(np.zeros((0, 2), dtype=int), np.zeros(0, dtype=int), np.zeros((0, 3)))
    edges, edge = np.unique(np.sort(found.pairs, axis=1), axis=0, return_inverse=True)
    is_held = np.zeros((len(edges), 3), dtype=bool)  # whether the ends keep the same coordinate along each axis
    is_held[edge.ravel(), np.abs(directions @ axes.T).argmax(axis=1)] = True
    follows = np.flatnonzero(is_held.sum(axis=1) == 2)
    return AxisEdges(edges[follows], np.argmin(is_held[follows], axis=1), axes)


def point_feet(session: Session, moment: int) -> PointFeet:
    """The points that pull at the mesh by the point-to-plane fit of a sweep, with their weights in Huber's loss.

    Raises: as `Session.sweep_state`.
    """
    scene, vertices = session.scene, session.trace.vertices_at(moment)
    observed, near = observed_fitting_points(scene), None
    if len(observed):
        near = session.sweep_state(moment).near_points
    elif scene.sparse_points is None:
        return PointFeet(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=int), np.zeros(0))
    positions = points_on_mesh(scene, observed, vertices, near)
    feet = feet_of(scene.mesh.moved(vertices), positions, vertices)
    distance = np.linalg.norm(positions - feet.places, axis=1)
    weights = np.where(feet.belong, Huber(feet.scale).weight(distance), 0.0)
    return PointFeet(positions, feet.places, feet.faces, weights)

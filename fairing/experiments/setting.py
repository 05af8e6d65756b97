"""Setting of an experiment: one displaced vertex of a scene with known truth."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fairing.errors import InputError
from fairing.geometry.normals import face_normals
from fairing.io.scene_points import with_points
from fairing.judge.metrics import SPAN_TOLERANCE
from fairing.options import FairingOptions
from fairing.run.session import Session
from fairing.scene import Scene

GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


@dataclass(frozen=True, eq=False)
class Setting:
    """A vertex, its scene and the options of the runs.

    Attributes:
        scene: a scene with known true vertices.
        vertex: id of the vertex that is displaced; all others stay at their true positions.
        options: of every run, except for what an experiment varies.

    Raises:
        InputError: the truth is unknown, or there is no such vertex.
    """

    scene: Scene
    vertex: int
    options: FairingOptions

    def __post_init__(self) -> None:
        check_truth(self.scene)
        last = len(self.scene.mesh.vertices) - 1
        if not 0 <= self.vertex <= last:
            raise InputError(f"vertex {self.vertex}: this mesh has vertices 0 to {last}")

    @classmethod
    def of(cls, scene: Scene, options: FairingOptions | None = None, vertex: int | None = None) -> "Setting":
        """A setting with defaults: the preset `accurate`, and the vertex that the photos determine best.

        The sparse points of the scene are found here, see `Scene.points_choice`, and not in every run.
        """
        check_truth(scene)
        scene = with_points(scene)
        return cls(scene, best_seen_vertex(scene) if vertex is None else vertex, options or FairingOptions())

    @cached_property
    def truth(self) -> np.ndarray:
        """(n, 3) float, world units: true positions of the vertices."""
        assert self.scene.truth is not None
        assert self.scene.truth.vertices is not None
        return self.scene.truth.vertices

    @cached_property
    def edge(self) -> float:
        """Shortest edge at the vertex, world units: the length that percentages refer to."""
        faces = self.scene.mesh.faces[self.scene.mesh.one_rings[self.vertex]]
        neighbours = np.setdiff1d(faces, self.vertex)
        return float(np.linalg.norm(self.truth[neighbours] - self.truth[self.vertex], axis=1).min())

    @cached_property
    def determined(self) -> np.ndarray:
        """(d, 3) float: orthonormal directions in which the photos can determine the vertex."""
        return determined_directions(self.scene, self.vertex)

    def directions(self, count: int) -> np.ndarray:
        """(count, 3) float: unit vectors spread over the directions in which the photos can determine the vertex."""
        # A Fibonacci lattice on the sphere.
        k = np.arange(count) + 0.5
        height, turn = 1 - 2 * k / count, GOLDEN_ANGLE * k
        radius = np.sqrt(1 - height**2)
        spread = np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
        within = spread @ self.determined.T @ self.determined
        return within / np.linalg.norm(within, axis=1, keepdims=True)

    def displaced(self, percent: float, direction: np.ndarray) -> Scene:
        """The scene with all vertices at the truth, except this one, displaced along a unit vector (3,) by percent of the edge."""
        start = self.truth.copy()
        start[self.vertex] += percent / 100 * self.edge * direction
        return replace(self.scene, mesh=self.scene.mesh.moved(start))

    def session(self, scene: Scene, options: FairingOptions | None = None) -> Session:
        """A run on the scene in which only this vertex moves."""
        others = np.flatnonzero(scene.original_from_welded != self.vertex).tolist()
        options = replace(
            options or self.options, locked_vertices=tuple(others), lock_boundary=False, locked_boxes=(), region=()
        )
        return Session(scene, options)

    def error(self, vertices: np.ndarray) -> np.ndarray:
        """(d,) float, percent of the edge: the vertex's error along `determined`, for vertices (n, 3), world units."""
        return 100 / self.edge * self.determined @ (vertices[self.vertex] - self.truth[self.vertex])

    def distance(self, vertices: np.ndarray) -> float:
        """Length of `error` for vertices (n, 3), percent of the edge."""
        return float(np.linalg.norm(self.error(vertices)))


def check_truth(scene: Scene) -> None:
    """Raise InputError if the true positions of the scene's vertices are unknown."""
    if scene.truth is None or scene.truth.vertices is None:
        raise InputError(
            f"scene {scene.name}: experiments need the true positions of its vertices, and they are unknown; "
            "use a synthetic scene, such as the demo cube"
        )


def determined_directions(scene: Scene, vertex: int) -> np.ndarray:
    """(d <= 3, 3) float: orthonormal basis of the span of the true normals at the vertex."""
    normals = scene.truth.normals if scene.truth is not None else None
    if normals is None:
        return np.eye(3)
    _, strength, directions = np.linalg.svd(normals[vertex], full_matrices=False)
    found = directions[strength > SPAN_TOLERANCE * strength[0]]
    # At a corner the basis is the world axes, so that errors are in world coordinates.
    return np.eye(3) if len(found) == 3 else found


def best_seen_vertex(scene: Scene) -> int:
    """Id of the vertex that the photos determine best.

    Of the vertices whose true surface determines most directions, the one whose one-ring covers most pixels in the photos that
    show all of it from the front.
    """
    assert scene.truth is not None
    assert scene.truth.vertices is not None
    vertices, faces = scene.truth.vertices, scene.mesh.faces
    normals = face_normals(vertices, faces)
    rings = scene.mesh.one_rings
    area = np.zeros(len(vertices))
    for view in scene.views:
        uv, depth = view.camera.project(vertices)
        a, b, c = uv[faces].transpose(1, 0, 2)
        pixels = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
        size = np.array([view.camera.width, view.camera.height])
        inside = ((depth > 0) & (uv >= 0).all(axis=1) & (uv <= size - 1).all(axis=1))[faces].all(axis=1)
        front = (normals * (view.camera.center - vertices[faces[:, 0]])).sum(axis=1) > 0
        for vertex, ring in enumerate(rings):
            if len(ring) and (inside & front)[ring].all():
                area[vertex] += pixels[ring].sum()
    spans = np.array([len(determined_directions(scene, v)) if area[v] > 0 else 0 for v in range(len(vertices))])
    return int(np.lexsort((area, spans))[-1])

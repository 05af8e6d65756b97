"""Triangle meshes with their edges, boundary and one-rings."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from fairing.errors import InputError
from fairing.util.guards import check_coordinates


@dataclass(frozen=True, eq=False)
class Mesh:
    """Vertices and triangles, counter-clockwise seen from outside.

    Attributes:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int, indices into `vertices`.

    Raises:
        InputError: no faces, vertices that are not finite or implausibly large, or an index out of range.
    """

    vertices: np.ndarray
    faces: np.ndarray

    def __post_init__(self) -> None:
        vertices = np.array(self.vertices, dtype=np.float64)
        faces = np.array(self.faces, dtype=np.int64)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) == 0:
            raise InputError(f"mesh: expected vertices of shape (n, 3), found {vertices.shape}")
        if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
            raise InputError(f"mesh: expected triangles (m, 3), found shape {faces.shape}; it has no surface to fair")
        bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
        if len(bad):
            raise InputError(f"mesh: vertex {bad[0]} is not finite ({len(bad)} such vertices); repair the mesh")
        check_coordinates(vertices, "mesh")
        out = np.flatnonzero((faces < 0).any(axis=1) | (faces >= len(vertices)).any(axis=1))
        if len(out):
            raise InputError(
                f"mesh: face {out[0]} uses vertices {faces[out[0]].tolist()}, expected indices 0 to {len(vertices) - 1}"
            )
        vertices.setflags(write=False)
        faces.setflags(write=False)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    def moved(self, vertices: np.ndarray) -> "Mesh":
        """The same triangles with other vertex positions (n, 3), world units."""
        return Mesh(vertices, self.faces)

    @cached_property
    def edges(self) -> np.ndarray:
        """(e, 2) int: every undirected edge once, lower index first, sorted."""
        return self._edges_with_counts[0]

    @cached_property
    def boundary_vertices(self) -> np.ndarray:
        """(b,) int: vertices on an edge that only one triangle uses."""
        edges, counts = self._edges_with_counts
        return np.unique(edges[counts == 1])

    @cached_property
    def _edges_with_counts(self) -> tuple[np.ndarray, np.ndarray]:
        half_edges = self.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        # One number per edge: np.unique over rows is slower (ledger: unique edges).
        keys, counts = np.unique(
            half_edges.min(axis=1) * len(self.vertices) + half_edges.max(axis=1), return_counts=True
        )
        return np.column_stack(np.divmod(keys, len(self.vertices))), counts

    @cached_property
    def one_rings(self) -> list[np.ndarray]:
        """One-ring of each of the n vertices: (r,) int, ids of the faces that use it, ascending."""
        order = np.argsort(self.faces.ravel(), kind="stable")
        starts = np.searchsorted(self.faces.ravel()[order], np.arange(len(self.vertices) + 1))
        return [np.unique(order[a:b] // 3) for a, b in pairwise(starts)]

    @cached_property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal, world units."""
        return float(np.linalg.norm(np.ptp(self.vertices[np.unique(self.faces)], axis=0)))

"""Mesh inspection: defects and unusual features, which the engine handles and reports."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fairing.errors import InputError
from fairing.mesh import Mesh
from fairing.weld import without_area


@dataclass(frozen=True, eq=False)
class MeshFacts:
    """Findings of `inspect_mesh`. Edges are (low, high) vertex ids. Edges and the boundary consider only sound faces,
    which are neither degenerate nor repeated.

    Attributes:
        degenerate_faces: (d,) int: faces without area.
        repeated_faces: (r,) int: faces with the corners of an earlier face, in either orientation.
        crowded_edges: (c, 2) int: edges of more than two faces.
        misoriented_edges: (m, 2) int: edges whose two faces have opposite orientations.
        boundary_vertices: (b,) int: vertices on an edge of one face.
        unreferenced_vertices: (u,) int: vertices of no face.
        n_components: number of connected components.
    """

    degenerate_faces: np.ndarray
    repeated_faces: np.ndarray
    crowded_edges: np.ndarray
    misoriented_edges: np.ndarray
    boundary_vertices: np.ndarray
    unreferenced_vertices: np.ndarray
    n_components: int

    def warnings(self, vertex_ids: np.ndarray | None = None) -> tuple[str, ...]:
        """One line for each kind of defect.

        Args:
            vertex_ids: (n,) int: number of each vertex in the input, if that is not its index.
        """
        crowded_edges, misoriented_edges, unreferenced = (
            ids if vertex_ids is None else vertex_ids[ids]
            for ids in (self.crowded_edges, self.misoriented_edges, self.unreferenced_vertices)
        )
        found = [
            (self.degenerate_faces, "degenerate faces", "they take no part"),
            (self.repeated_faces, "faces with the corners of another", "remove them if they are a mistake"),
            (crowded_edges, "edges of more than two faces", "the mesh is not a manifold there"),
            (misoriented_edges, "edges between faces of opposite orientations", "orient the faces consistently"),
            (unreferenced, "vertices of no face", "they stay where they are"),
        ]
        return tuple(
            f"mesh: {what}: {len(items)} (first: {'-'.join(map(str, np.atleast_1d(items[0])))}); {consequence}"
            for items, what, consequence in found
            if len(items)
        )


def inspect_mesh(mesh: Mesh) -> MeshFacts:
    """Find degenerate and repeated faces, non-manifold edges, the boundary and the connected components.

    Raises:
        InputError: every face is degenerate.
    """
    is_degenerate = without_area(mesh.vertices, mesh.faces)
    if is_degenerate.all():
        raise InputError(
            f"mesh: expected a surface, found that all {len(mesh.faces)} faces have no area; repair the mesh"
        )
    is_repeated = ~is_degenerate
    candidates = np.flatnonzero(~is_degenerate)
    is_repeated[candidates[_first_of_each(np.sort(mesh.faces[candidates], axis=1))]] = False

    sound = mesh.faces[~is_degenerate & ~is_repeated]
    half_edges = sound[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    keys = half_edges.min(axis=1) * len(mesh.vertices) + half_edges.max(axis=1)
    keys, edge_of, count = np.unique(keys, return_inverse=True, return_counts=True)
    edges = np.column_stack(np.divmod(keys, len(mesh.vertices)))
    # +1 for a face that runs from the lower to the higher vertex, -1 for the other way: consistent pairs sum to 0.
    turn = np.bincount(edge_of, np.where(half_edges[:, 0] < half_edges[:, 1], 1, -1), len(edges))
    is_referenced = np.zeros(len(mesh.vertices), dtype=bool)
    is_referenced[mesh.faces] = True
    return MeshFacts(
        degenerate_faces=np.flatnonzero(is_degenerate),
        repeated_faces=np.flatnonzero(is_repeated),
        crowded_edges=edges[count > 2],
        misoriented_edges=edges[(count == 2) & (turn != 0)],
        boundary_vertices=np.unique(edges[count == 1]),
        unreferenced_vertices=np.flatnonzero(~is_referenced),
        n_components=_count_components(mesh) - int((~is_referenced).sum()),
    )


def _first_of_each(rows: np.ndarray) -> np.ndarray:
    """Index of the first occurrence of each distinct row of an integer array (r, 3)."""
    order = np.lexsort(rows.T)
    is_new = np.ones(len(order), dtype=bool)
    is_new[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    return order[is_new]


def _count_components(mesh: Mesh) -> int:
    n = len(mesh.vertices)
    ends = mesh.edges
    graph = coo_array((np.ones(len(ends), dtype=bool), (ends[:, 0], ends[:, 1])), shape=(n, n))
    return int(connected_components(graph, directed=False)[0])

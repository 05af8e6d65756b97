"""A part of a glTF scene: the vertices of one accessor at one node."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, eq=False)
class Part:
    """The vertices that the primitives of one mesh, at one node, share: those of one accessor.

    Attributes:
        node: index of the node; -1 for a mesh without nodes.
        mesh: index of the mesh.
        primitives: indices of its primitives with these vertices.
        start: index of the first vertex among those of the document.
        world_from_part: (4, 4) float.
        positions: (n, 3) float, in the frame of the part.
        faces: (m, 3) int, indices into `positions`, as the primitives have them.
    """

    node: int
    mesh: int
    primitives: list[int]
    start: int
    world_from_part: np.ndarray
    positions: np.ndarray
    faces: list[np.ndarray] = field(default_factory=list)

    @property
    def vertices(self) -> slice:
        """Where its vertices lie among those of the document."""
        return slice(self.start, self.start + len(self.positions))

    def all_faces(self) -> np.ndarray:
        """(m, 3) int: of all its primitives."""
        return np.concatenate([np.empty((0, 3), dtype=np.int64), *self.faces])

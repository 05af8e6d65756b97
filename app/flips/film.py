"""Meshes, edges and energies at every moment of a flip record. Moment k is the mesh after k flips."""

from dataclasses import dataclass

import numpy as np

from fairing.triangulation import FlipTrace

KEYFRAMES = 128  # flips from one kept mesh to the next


@dataclass(frozen=True, eq=False)
class Edges:
    """The edges of a mesh by what happens to them in the record, each (e, 2) int, vertices.

    Attributes:
        kept: present from the start to the end.
        came: made by an earlier flip.
        to_go: inconsistent: removed by a later flip.
        new: made by the last flip: at most one.
        gone: removed by the last flip: at most one.
    """

    kept: np.ndarray
    came: np.ndarray
    to_go: np.ndarray
    new: np.ndarray
    gone: np.ndarray


class FlipFilm:
    """Meshes, edges and energies at all moments of a record.

    Attributes:
        energies: (flips + 1,) float: energy of the mesh; within a round with the visibility that the round began with.
        rounds: (flips,) int: the round of each flip.
    """

    def __init__(self, trace: FlipTrace) -> None:
        self.trace = trace
        self.rounds = np.array([flip.round for flip in trace.flips], dtype=int)
        self.energies = _energies(trace)
        self._keyframes: dict[int, np.ndarray] = {0: trace.faces_at(0)}
        self._made = [_pair(flip.opposite) for flip in trace.flips]
        self._taken = [_pair(flip.edge) for flip in trace.flips]

    def __len__(self) -> int:
        return len(self.trace)

    def faces_at(self, moment: int) -> np.ndarray:
        """(m, 3) int. Raises IndexError: there is no such moment."""
        if not 0 <= moment <= len(self):
            raise IndexError(f"moment {moment}: this record has moments 0 to {len(self)}")
        began = max(frame for frame in self._keyframes if frame <= moment)
        faces = self._keyframes[began].copy()
        for k in range(began, moment):
            flip = self.trace.flips[k]
            (faces[flip.faces[0]],), (faces[flip.faces[1]],) = flip.quads.flipped()
            if (k + 1) % KEYFRAMES == 0:
                self._keyframes[k + 1] = faces.copy()
        return faces

    def edges_at(self, moment: int) -> Edges:
        """The edges of the mesh of a moment."""
        faces = self.faces_at(moment)
        pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        edges = [tuple(pair) for pair in np.unique(pairs, axis=0).tolist()]
        made, taken = set(self._made[:moment]), set(self._taken[moment:])
        new = set(self._made[moment - 1 : moment])
        gone = self._taken[moment - 1 : moment]
        return Edges(
            _array(edge for edge in edges if edge not in made and edge not in taken),
            _array(edge for edge in edges if edge in made and edge not in taken and edge not in new),
            _array(edge for edge in edges if edge in taken and edge not in new),
            _array(new),
            _array(gone),
        )

    def round_before(self, moment: int) -> int:
        """The moment at which the round of the last flip began."""
        return int(np.searchsorted(self.rounds, self.rounds[moment - 1])) if moment > 0 else 0

    def round_after(self, moment: int) -> int:
        """The moment at which the round of the next flip ends."""
        if moment >= len(self):
            return len(self)
        return int(np.searchsorted(self.rounds, self.rounds[moment], side="right"))


def _pair(edge: np.ndarray) -> tuple[int, int]:
    a, b = sorted(edge.tolist())
    return a, b


def _array(edges) -> np.ndarray:
    return np.array(list(edges), dtype=int).reshape(-1, 2)


def _energies(trace: FlipTrace) -> np.ndarray:
    energies = np.zeros(len(trace) + 1)
    for k, flip in enumerate(trace.flips):
        if k == 0 or trace.flips[k - 1].round != flip.round:
            energies[k] = flip.round_energy[0]
        energies[k + 1] = energies[k] + flip.energy[1] - flip.energy[0]
    if len(trace):
        energies[-1] = trace.flips[-1].round_energy[1]
    return energies

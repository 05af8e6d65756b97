"""Meshes at every moment of the face splits. A round begins with its candidates; then one part after another is judged."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from fairing.triangulation import SplitRound


class Group(IntEnum):
    """What happens to a face in its round."""

    NOT_CHOSEN = 0
    CANDIDATE = 1
    SPLIT = 2
    STAYS = 3


class SplitMoment(NamedTuple):
    """Attributes:
    number: of the round, from 0.
    place: number of the parts that are judged, in their order; 0: none is yet.
    part: the last one of them, an index into the arrays of the round; None: none is judged yet.
    """

    number: int
    place: int
    part: int | None


@dataclass(frozen=True, eq=False)
class SplitMesh:
    """The mesh of a moment.

    Attributes:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        groups: (m,) int: `Group` of each face.
        is_of_part: (m,) bool: faces of the part that was judged last.
    """

    vertices: np.ndarray
    faces: np.ndarray
    groups: np.ndarray
    is_of_part: np.ndarray


class SplitFilm:
    """All moments of the rounds of face splits, 0 to `len(film) - 1`.

    Of a round, the parts that are split come first, those for which the loss of held-out points falls most at the beginning; then
    those that stay, in the same order.
    """

    def __init__(self, rounds: Sequence[SplitRound]) -> None:
        self.rounds = tuple(rounds)
        self._orders = [_order(done) for done in rounds]
        self._begins = np.cumsum([0, *(1 + len(order) for order in self._orders)])

    def __len__(self) -> int:
        return int(self._begins[-1])

    def at(self, k: int) -> SplitMoment:
        """What the moment k is."""
        number = int(np.searchsorted(self._begins, k, side="right")) - 1
        place = k - int(self._begins[number])
        return SplitMoment(number, place, int(self._orders[number][place - 1]) if place else None)

    def mesh(self, k: int) -> SplitMesh:
        """The mesh of the moment k."""
        number, place, part = self.at(k)
        done = self.rounds[number]
        is_judged = np.zeros(len(done.judges), dtype=bool)
        is_judged[self._orders[number][:place]] = True
        vertices, faces, parent = done.mesh_with(is_judged)
        of_part = np.where(is_judged, np.where(done.is_split, Group.SPLIT, Group.STAYS), Group.CANDIDATE)
        group, part_of = np.full(len(done.faces), Group.NOT_CHOSEN), np.full(len(done.faces), -1)
        group[done.chosen], part_of[done.chosen] = of_part[done.parts], done.parts
        is_of_part = part_of[parent] == (-2 if part is None else part)
        return SplitMesh(vertices, faces, group[parent], is_of_part)

    def round_before(self, k: int) -> int:
        """The moment at which the round of the step before k began."""
        return int(self._begins[np.searchsorted(self._begins, k) - 1]) if k > 0 else 0

    def round_after(self, k: int) -> int:
        """The moment at which the next round begins; `len(film)` after the last."""
        return int(self._begins[np.searchsorted(self._begins, k, side="right")])


def _order(done: SplitRound) -> np.ndarray:
    """(p,) int: the parts of a round in the order in which they are shown."""
    gain = done.judges * (done.errors[:, 0] ** 2 - done.errors[:, 1] ** 2)
    return np.lexsort((-gain, ~done.is_split))

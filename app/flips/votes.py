"""Votes of lines of sight on tetrahedra, photo by photo, and the groups of tetrahedra that they make."""

from enum import IntEnum

import numpy as np

from fairing.triangulation import Carving, SightCosts

UNDECIDED, CLEAR = 0.5, 5.0  # lines of sight: below, a vote is undecided; from here on it is clear


class Vote(IntEnum):
    """What the lines of sight say of a tetrahedron."""

    CLEARLY_OUTSIDE = 0
    OUTSIDE = 1
    NONE = 2
    INSIDE = 3
    CLEARLY_INSIDE = 4


class VoteCounter:
    """Sums of the votes of the first photos. Going one photo on adds its lines; anything else counts again."""

    def __init__(self, carving: Carving) -> None:
        self._carving = carving
        self._counted: tuple[int, SightCosts] = (0, carving.votes(range(0)))

    def after(self, n_photos: int) -> SightCosts:
        """The sums over the lines of sight of the first `n_photos` photos."""
        if n_photos == len(self._carving.photos):
            return self._carving.all_votes
        counted, sums = self._counted
        if n_photos != counted:
            if n_photos < counted:
                counted, sums = 0, None
            more = self._carving.votes(range(counted, n_photos))
            sums = more if sums is None else SightCosts(*(a + b for a, b in zip(sums, more, strict=True)))
            self._counted = (n_photos, sums)
        return sums


def votes_of(sums: SightCosts) -> np.ndarray:
    """(T,) int: `Vote` of each tetrahedron: more lines that pass through it than points just before it, or fewer."""
    return np.digitize(sums.inside - sums.passing, [-CLEAR, -UNDECIDED, UNDECIDED, CLEAR])

"""Carving: how the start mesh came about, from points and lines of sight to the surface of the cut, recorded for replay.

What follows from the record by a pure function (votes of lines of sight, facets of the cut) is computed again on request.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fairing.triangulation.cut_surface import cut_facets
from fairing.triangulation.sight_lines import SightCosts, sight_costs
from fairing.triangulation.tetrahedra import Tetrahedra

MOST_POINTS = 50_000
"""Of more points no carving is recorded: the record of so many is 10 MB, and its tetrahedra are too many for a browser."""


@dataclass(frozen=True, eq=False)
class Carving:
    """The stages of a start mesh from n points in T tetrahedra, seen along r lines of sight by V photos.

    Attributes:
        mesh: the tetrahedra.
        colors: (n, 3) uint8, RGB, of the points.
        photos: names of the photos.
        lines: (r, 2) int: the point and the photo of each line of sight.
        sigma: uncertainty of the points, in units of `mesh.places`.
        quality: cost of a facet of quality 1, in lines of sight.
        is_outside: (T,) bool: the side of the minimum cut.
        fates: (f,) int8: `Fate` of each facet of the cut.
        decimated: vertices (p, 3) float, world units, and faces (q, 3) int of the seen surface, then of its stages with fewer
            and fewer vertices; the start mesh itself is not among them.
        left_out: number of points without a place among the n, by reason.
    """

    mesh: Tetrahedra
    colors: np.ndarray
    photos: tuple[str, ...]
    lines: np.ndarray
    sigma: float
    quality: float
    is_outside: np.ndarray
    fates: np.ndarray
    decimated: tuple[tuple[np.ndarray, np.ndarray], ...]
    left_out: dict[str, int]

    @cached_property
    def places(self) -> np.ndarray:
        """(n + 8, 3) float, world units: the points, then the corners of the box."""
        return self.mesh.center + self.mesh.unit * self.mesh.places

    @cached_property
    def cameras(self) -> np.ndarray:
        """(V, 3) float, world units: centers of the cameras."""
        return self.mesh.center + self.mesh.unit * self.mesh.cameras

    @cached_property
    def first_photo(self) -> np.ndarray:
        """(n,) int: the first photo that sees a point."""
        first = np.full(self.mesh.n_points, len(self.photos))
        np.minimum.at(first, self.lines[:, 0], self.lines[:, 1])
        return first

    @cached_property
    def at_box(self) -> np.ndarray:
        """(T,) bool: tetrahedra with a corner of the box."""
        return np.logical_or.reduce(self.mesh.corners >= self.mesh.n_points, axis=1)

    @cached_property
    def facets(self) -> tuple[np.ndarray, np.ndarray]:
        """The facets of the cut, see `cut_facets`."""
        return cut_facets(self.mesh, self.is_outside)

    @cached_property
    def all_votes(self) -> SightCosts:
        """The costs of all lines of sight."""
        return self.votes(range(len(self.photos)))

    @cached_property
    def facet_costs(self) -> np.ndarray:
        """(T, 4) float: cost of each facet as surface, whatever lines cross it."""
        return self.quality * self.mesh.facet_quality()

    @cached_property
    def cut_value(self) -> tuple[float, float, float]:
        """What the minimum cut pays: lines of sight that it interrupts, points with outside behind them, quality of facets."""
        across = self.is_outside[:, None] & ~self.is_outside[self.mesh.neighbours] & (self.mesh.neighbours >= 0)
        votes = self.all_votes
        return (
            float(votes.crossing[across].sum()), float(votes.inside[self.is_outside].sum()),
            float(self.facet_costs[across].sum()),
        )  # fmt: skip

    def votes(self, photos: range) -> SightCosts:
        """The costs of the lines of sight of some photos."""
        lines = self.lines[(self.lines[:, 1] >= photos.start) & (self.lines[:, 1] < photos.stop)]
        return sight_costs(self.mesh, lines[:, 0], lines[:, 1], np.full(self.mesh.n_points, self.sigma))

    def lines_through(self, tetrahedron: int, photos: range) -> np.ndarray:
        """(k,) int: the lines of sight of some photos that reach their camera through a tetrahedron."""
        corners = self.mesh.places[self.mesh.corners[tetrahedron]]
        begin, end = self.mesh.places[self.lines[:, 0]], self.mesh.cameras[self.lines[:, 1]]
        inwards = np.linalg.pinv((corners[1:] - corners[0]).T)  # also of a flat one
        # Barycentric coordinates, linear along a line: from and up to where along it all are positive.
        b, e = ((x - corners[0]) @ inwards.T for x in (begin, end))
        b, e = (np.column_stack([1 - x.sum(axis=1), x]) for x in (b, e))
        with np.errstate(divide="ignore", invalid="ignore"):
            at = b / (b - e)
        low = np.where(e > b, at, 0.0).max(axis=1, initial=0.0)
        high = np.where(e < b, at, 1.0).min(axis=1, initial=1.0)
        passes = (low < high) & ~((e == b) & (b <= 0)).any(axis=1)
        passes &= ~(self.mesh.corners[tetrahedron] == self.lines[:, :1]).any(axis=1)
        return np.flatnonzero(passes & (self.lines[:, 1] >= photos.start) & (self.lines[:, 1] < photos.stop))

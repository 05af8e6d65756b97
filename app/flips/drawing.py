"""What the 3D view shows at a moment before the flips: points, triangles and lines by name, as arrays."""

from dataclasses import dataclass, field

import numpy as np

from app.flips.body import Triangles, cross_sections, hull_of, sunk
from app.flips.section import Section
from app.flips.story import Chapter, Story
from app.flips.votes import UNDECIDED, Vote, VoteCounter, votes_of
from app.palette import CURVES, REJECTED, RGB, SURFACE
from app.stage import Stage
from app.surface_offset import OFFSET
from fairing.triangulation import Carving, Fate
from fairing.triangulation.tetrahedra import CORNERS

MOST_RAYS = 250  # of one photo

COST_LIMITS = (0.01, 0.03, 0.1, 0.3)  # lines of sight: between the colors of facets
MESHES: dict[str, tuple[RGB, str]] = {
    "clearly outside": (CURVES[0], "5 lines of sight or more say outside"),
    "outside": (CURVES[1], "more lines say outside than inside"),
    "none": (SURFACE, "no line of sight decides"),
    "inside": (CURVES[3], "more lines say inside than outside"),
    "clearly inside": (CURVES[4], "5 lines of sight or more say inside"),
    "cut outside": (CURVES[0], "outside, on the cameras' side of the cut"),
    "cut inside": (CURVES[4], "inside, on the object's side of the cut"),
    "cost 0": (CURVES[0], "costs less than 0.01 lines of sight"),
    "cost 1": (CURVES[1], "0.01 to 0.03"),
    "cost 2": (CURVES[2], "0.03 to 0.1"),
    "cost 3": (CURVES[3], "0.1 to 0.3"),
    "cost 4": (CURVES[4], "0.3 or more"),
    "surface": (SURFACE, "faces that stay"),
    "removed": (REJECTED, "faces that are left out"),
}
"""Color and meaning of each group of triangles."""
CLOSED = ("clearly outside", "outside", "none", "inside", "clearly inside", "cut outside", "cut inside")
"""Groups of whole tetrahedra."""
VOTE_MESHES: dict[int, str] = dict(
    zip(map(int, Vote), ("clearly outside", "outside", "none", "inside", "clearly inside"), strict=True)
)


@dataclass(frozen=True, eq=False)
class Drawing:
    """Everything that is drawn, page units.

    Attributes:
        meshes: (m, 3, 3) float32: triangles, by a name of `MESHES`.
        counts: number of tetrahedra or faces of each group that the moment has, whether a section shows them or not.
        points, new_points: (k,) int: points that are shown, and those that have just appeared.
        rays: (k, 2, 3) float32: lines of sight.
        sides: (m, 3, 3) float32: triangles of which the sides are drawn.
        tetrahedra: triangles that can be picked.
    """

    meshes: dict[str, np.ndarray] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    points: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    new_points: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    rays: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 3), dtype=np.float32))
    sides: np.ndarray = field(default_factory=lambda: np.zeros((0, 3, 3), dtype=np.float32))
    tetrahedra: Triangles = field(default_factory=lambda: Triangles(np.zeros((0, 3, 3)), np.zeros(0, dtype=int)))


class Draughtsman:
    """Draws the moments of one story for one browser."""

    def __init__(self, story: Story, carving: Carving, stage: Stage, votes: VoteCounter) -> None:
        self._story, self._carving, self._stage, self._votes = story, carving, stage, votes
        self.places = stage.page_from_world(carving.places)
        self._cameras = stage.page_from_world(carving.cameras)

    def draw(self, moment: int, section: Section) -> Drawing:
        """The drawing of a moment before the flips."""
        extent, k = self._story.at(moment)
        carving = self._carving
        if extent.chapter is Chapter.POINTS:
            first = carving.first_photo
            return Drawing(
                points=np.flatnonzero(first < k - 1),
                new_points=np.flatnonzero(first == k - 1),
                rays=self._rays(k - 1, True),
            )
        if extent.chapter is Chapter.TETRAHEDRA:
            ids = np.full(len(carving.is_outside), Vote.NONE)
            return self._sectioned(section, ids, np.zeros(len(ids), dtype=bool), VOTE_MESHES)
        if extent.chapter is Chapter.RAYS:
            sums = self._votes.after(k + 1)
            is_carved = sums.passing - sums.inside > UNDECIDED
            return self._sectioned(section, votes_of(sums), is_carved, VOTE_MESHES, rays=self._rays(k, False))
        if extent.chapter is Chapter.CUT and k == 0:
            names = {0: "cut inside", 1: "cut outside"}
            return self._sectioned(section, carving.is_outside.astype(int), carving.is_outside, names)
        if extent.chapter is Chapter.DECIMATION:
            vertices, faces = carving.decimated[k]
            corners = self._stage.page_from_world(vertices)[faces]
            return Drawing({"surface": sunk(corners, OFFSET)}, {"surface": len(faces)}, sides=corners)
        return self._surface(None if extent.chapter is Chapter.CUT else k)

    def _rays(self, photo: int, only_new: bool) -> np.ndarray:
        """(k, 2, 3) float32: some lines of sight of a photo, evenly chosen; of points that it is the first to see."""
        carving = self._carving
        lines = np.flatnonzero(carving.lines[:, 1] == photo)
        if only_new:
            lines = lines[carving.first_photo[carving.lines[lines, 0]] == photo]
        lines = lines[:: max(1, -(-len(lines) // MOST_RAYS))]
        point, view = carving.lines[lines].T
        return np.stack([self.places[point], self._cameras[view]], axis=1)

    def _sectioned(
        self,
        section: Section,
        groups: np.ndarray,
        is_carved: np.ndarray,
        names: dict[int, str],
        rays: np.ndarray | None = None,
    ) -> Drawing:
        """What is not carved behind the section, and the cross sections of all tetrahedra, in colors of their groups."""
        carving = self._carving
        corners = carving.mesh.corners
        heights = section.heights(self.places, self._stage)[corners]
        is_behind = (heights.max(axis=1) < 0) & ~carving.at_box
        ids = np.flatnonzero((heights.min(axis=1) < 0) & (heights.max(axis=1) > 0) & ~carving.at_box)
        crossed = cross_sections(self.places[corners[ids]], heights[ids], ids, section.normal(self._stage))
        parts = [hull_of(carving, is_behind & ~is_carved, self.places), crossed]
        shown = Triangles(
            np.concatenate([part.corners for part in parts]), np.concatenate([part.tetrahedra for part in parts])
        )
        # Nearest first, as seen initially: hidden pixels are then skipped, which without a graphics card takes most of the time.
        order = np.argsort(np.linalg.norm(shown.corners.mean(axis=1) - self._stage.eye, axis=1))
        shown = Triangles(shown.corners[order], shown.tetrahedra[order])
        group, inner = groups[shown.tetrahedra], groups[~carving.at_box]
        return Drawing(
            {name: shown.of(group == number) for number, name in names.items()},
            {name: int((inner == number).sum()) for number, name in names.items()},
            rays=np.zeros((0, 2, 3), dtype=np.float32) if rays is None else rays,
            tetrahedra=shown,
        )

    def _surface(self, left_out: int | None) -> Drawing:
        """The facets of the cut: in colors of their cost, or those left out for a reason."""
        carving = self._carving
        tetrahedron, facet = carving.facets
        corners = self.places[carving.mesh.corners[tetrahedron[:, None], CORNERS[facet]]]
        if left_out is None:
            group = np.digitize(cut_costs(carving).sum(axis=1), COST_LIMITS)
            names, is_shown = {k: f"cost {k}" for k in range(len(COST_LIMITS) + 1)}, np.ones(len(group), dtype=bool)
        else:
            before = self._story.fates[:left_out]
            is_shown = ~np.isin(carving.fates, before)
            group = (carving.fates == self._story.fates[left_out]).astype(int)
            names = {0: "surface", 1: "removed"}
        return Drawing(
            {name: corners[is_shown & (group == number)] for number, name in names.items()},
            {name: int((is_shown & (group == number)).sum()) for number, name in names.items()},
            tetrahedra=Triangles(corners[is_shown], tetrahedron[is_shown]),
        )


def cut_costs(carving: Carving) -> np.ndarray:
    """(f, 2) float: what the cut pays for each of its facets: lines of sight that it interrupts, and its quality."""
    tetrahedron, facet = carving.facets
    crossing = carving.all_votes.crossing
    beyond = carving.mesh.across(crossing, np.zeros(crossing.shape))
    return np.column_stack([beyond[tetrahedron, facet], carving.facet_costs[tetrahedron, facet]])


def facets_left(story: Story, k: int) -> int:
    """Number of facets that are left after the first k + 1 reasons."""
    carving = story.carving
    assert carving is not None
    return int((~np.isin(carving.fates, [int(fate) for fate in story.fates[: k + 1] if fate != Fate.KEPT])).sum())

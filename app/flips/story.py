"""Chapters of a record: how points became a mesh, its face splits and its flips. A moment is a moment of one chapter."""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from app.flips.film import FlipFilm
from app.flips.split_film import SplitFilm
from fairing.triangulation import Fate, FlipTrace


class Chapter(Enum):
    """Chapters in order; the value is the chapter's name."""

    POINTS = "Points"
    TETRAHEDRA = "Tetrahedra"
    RAYS = "Rays"
    CUT = "Cut"
    SEEN = "Seen"
    DECIMATION = "Decimation"
    SPLITS = "Splits"
    FLIPS = "Flips"


@dataclass(frozen=True)
class Extent:
    """The moments of a chapter: `count` from `begin`."""

    chapter: Chapter
    begin: int
    count: int

    @property
    def last(self) -> int:
        return self.begin + self.count - 1


class Story:
    """All moments of a record, 0 to `len(story)`.

    Attributes:
        film: the flips; their moment 0 is the start mesh.
        splits: the face splits before them.
        carving: how the start mesh came about; None if the record does not hold it.
        extents: the chapters that the record has.
        fates: reasons for which facets of the cut are left out, one a moment of `Chapter.SEEN`.
    """

    def __init__(self, trace: FlipTrace) -> None:
        self.film, self.splits, self.carving = FlipFilm(trace), SplitFilm(trace.splits), trace.carving
        self.fates: tuple[Fate, ...] = ()
        counts: dict[Chapter, int] = {}
        if self.carving is not None:
            n_photos = len(self.carving.photos)
            self.fates = tuple(fate for fate in Fate if fate != Fate.KEPT and (self.carving.fates == fate).any())
            counts = {
                Chapter.POINTS: n_photos + 1,
                Chapter.TETRAHEDRA: 1,
                Chapter.RAYS: n_photos,
                Chapter.CUT: 2,
                Chapter.SEEN: len(self.fates),
                Chapter.DECIMATION: len(self.carving.decimated),
            }
        counts |= {Chapter.SPLITS: len(self.splits), Chapter.FLIPS: len(self.film) + 1}
        extents, begin = [], 0
        for chapter, count in counts.items():
            if count:
                extents.append(Extent(chapter, begin, count))
                begin += count
        self.extents = tuple(extents)

    def __len__(self) -> int:
        return self.extents[-1].last

    @property
    def has_chapters(self) -> bool:
        """Whether there is more than the flips."""
        return len(self.extents) > 1

    @property
    def step_names(self) -> tuple[str, str]:
        """What moments are apart, and what contains several: a flip and a round, or where there is more than the flips a step
        and a chapter or round."""
        return ("step", "chapter or round") if self.has_chapters else ("flip", "round")

    def at(self, moment: int) -> tuple[Extent, int]:
        """The chapter of a moment, and the moment's number within it, from 0."""
        extent = self.extents[int(np.searchsorted([e.begin for e in self.extents], moment, side="right")) - 1]
        return extent, moment - extent.begin

    def flip(self, moment: int) -> int | None:
        """The moment of the film; None in other chapters."""
        extent, k = self.at(moment)
        return k if extent.chapter is Chapter.FLIPS else None

    def split(self, moment: int) -> int | None:
        """The moment of the face splits; None in other chapters."""
        extent, k = self.at(moment)
        return k if extent.chapter is Chapter.SPLITS else None

    def is_carving(self, moment: int) -> bool:
        """Whether a moment shows how points became a mesh."""
        return self.at(moment)[0].chapter not in (Chapter.SPLITS, Chapter.FLIPS)

    def part_before(self, moment: int) -> int:
        """Where the last step's chapter, or round of splits or flips, began."""
        extent, k = self.at(moment)
        if k == 0:
            return self.at(moment - 1)[0].begin if moment > 0 else 0
        rounds = self._rounds_of(extent)
        return extent.begin + (0 if rounds is None else rounds.round_before(k))

    def part_after(self, moment: int) -> int:
        """Where the next chapter begins, or the next step's round of splits or flips ends."""
        extent, k = self.at(moment)
        rounds = self._rounds_of(extent)
        return extent.last + 1 if rounds is None else extent.begin + rounds.round_after(k)

    def _rounds_of(self, extent: Extent) -> FlipFilm | SplitFilm | None:
        """What knows the rounds of a chapter; None for chapters without rounds."""
        return {Chapter.SPLITS: self.splits, Chapter.FLIPS: self.film}.get(extent.chapter)

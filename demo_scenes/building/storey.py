"""One storey of a wall: a rectangle with openings, and slots in which elements are placed."""

from dataclasses import dataclass, field

from demo_scenes.sheet import SheetBuilder

Outline = list[tuple[float, float]]


@dataclass(eq=False)
class Storey:
    """A rectangle of wall in the plane z = `z`, all lengths in metres.

    Attributes:
        x, y: its extent.
        material: of the wall.
        peak: (x, y) of a gable's top above the rectangle, or None.
        notches: outlines (x, y), left to right, that interrupt the lower edge; they begin and end on it.
        holes: outlines (x, y) strictly inside.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    z: float
    material: str
    peak: tuple[float, float] | None = None
    notches: list[Outline] = field(default_factory=list)
    holes: list[Outline] = field(default_factory=list)

    def add_to(self, sheet: SheetBuilder) -> None:
        """Add the wall around its openings."""
        outline = [(self.x[0], self.y[0])]
        for notch in sorted(self.notches):
            outline += notch
        outline += [(self.x[1], self.y[0]), (self.x[1], self.y[1])]
        outline += [self.peak] if self.peak is not None else []
        outline.append((self.x[0], self.y[1]))
        sheet.add(self.in_space(outline), (0, 0, 1), self.material, holes=[self.in_space(hole) for hole in self.holes])

    def in_space(self, outline: Outline) -> list[tuple[float, float, float]]:
        """An outline (x, y) in the plane of the wall."""
        return [(x, y, self.z) for x, y in outline]


@dataclass(frozen=True, eq=False)
class Slot:
    """The part of a storey that one element may fill.

    Attributes:
        storey: the wall.
        x: extent, metres: the width of a bay.
        y: extent, metres: the height of the storey, or less where something else lies above.
        is_ground: whether the lower edge is the ground.
        panes: materials of window panes to choose from.
    """

    storey: Storey
    x: tuple[float, float]
    y: tuple[float, float]
    is_ground: bool
    panes: tuple[str, ...]

    @property
    def center(self) -> float:
        return (self.x[0] + self.x[1]) / 2

    @property
    def width(self) -> float:
        return self.x[1] - self.x[0]

    @property
    def height(self) -> float:
        return self.y[1] - self.y[0]

    def level(self, fraction: float) -> float:
        """Metres: the y at a fraction of the height, to the millimetre."""
        return round(self.y[0] + fraction * self.height, 3)

    def span(self, half_width: float) -> tuple[float, float]:
        """Extent in x, metres, of `half_width` bays to either side of the centre, to the millimetre."""
        return round(self.center - half_width * self.width, 3), round(self.center + half_width * self.width, 3)

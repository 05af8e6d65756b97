"""The random building: storeys and bays of a street front, a wing, a roof, and side walls."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from demo_scenes.building import elements
from demo_scenes.building.storey import Slot, Storey
from demo_scenes.noise import seeded
from demo_scenes.sheet import Sheet, SheetBuilder

Element = Callable[[SheetBuilder, Slot, np.random.Generator, int], None]

GROUND: tuple[tuple[Element, float], ...] = (
    (elements.door_with_stairs, 0.22),
    (elements.porch, 0.16),
    (elements.archway, 0.2),
    (elements.tower, 0.12),
    (elements.window, 0.2),
    (elements.ledge, 0.1),
)
UPPER: tuple[tuple[Element, float], ...] = (
    (elements.window, 0.42),
    (elements.arched_window, 0.2),
    (elements.balcony, 0.22),
    (elements.ledge, 0.16),
)
EMPTY_SLOTS = 0.12  # share of slots without an element
FEW_SLOTS = 3  # buildings with no more slots have no empty one
SHOULDER = 0.45  # metres between a wing and the end of the main wall
PANES = ("window a", "window b", "window c")


@dataclass(frozen=True)
class Frame:
    """What the plan of a building fixes; everything else is drawn while it is built.

    Attributes:
        bays: x of the bays' boundaries, metres, left to right.
        storeys: y of the storeys' boundaries, metres, from 0.
        wing: first bay, bay behind the last, storeys and depth (metres) of a part that stands out; None: no wing.
        roof: "flat", "cornice", "eaves" or "gable".
        eaves: z of the eaves' and the cornice's front, y of its upper edge, y and z of the ridge, metres.
        sides: depth of the side walls, metres; 0: the mesh ends at the corners.
        is_smooth: whether curved parts are true curves; otherwise they are polygons.
        plain: whether part of the walls has no texture.
    """

    bays: tuple[float, ...]
    storeys: tuple[float, ...]
    wing: tuple[int, int, int, float] | None
    roof: str
    eaves: tuple[float, float, float, float]
    sides: float
    is_smooth: bool
    plain: bool

    @property
    def x(self) -> tuple[float, float]:
        """Extent of the main wall, metres."""
        return self.bays[0], self.bays[-1]

    @property
    def top(self) -> float:
        """Upper end of the main wall, metres, without the roof."""
        return self.storeys[-1]

    @property
    def slots(self) -> int:
        """Number of bays times number of storeys."""
        return (len(self.bays) - 1) * (len(self.storeys) - 1)

    @property
    def gable(self) -> float:
        """Height of the main gable, metres."""
        return round(0.28 * (self.x[1] - self.x[0]), 3) if self.roof == "gable" else 0.0

    @property
    def extent(self) -> tuple[float, float]:
        """Width and height, metres, with the roof."""
        return self.x[1] - self.x[0], self.eaves[2] if self.roof == "eaves" else self.top + self.gable

    @property
    def is_tall(self) -> bool:
        """Whether photos in portrait format suit the building."""
        return self.extent[1] > 1.1 * self.extent[0]


def build_walls(frame: Frame, seed: tuple[int, ...], spacing: float, smooth: int = 1) -> Sheet:
    """The building as one sheet of triangles.

    Args:
        seed: of all sizes and elements, which do not depend on the arguments that follow.
        spacing: aimed-at length of edges, metres.
        smooth: number by which the facets of curved parts are multiplied.
    """
    return _Walls(frame, seeded(*seed, 61), SheetBuilder(spacing), smooth).build()


class _Walls:
    """Adds the parts of a building in a fixed order."""

    def __init__(self, frame: Frame, rng: np.random.Generator, sheet: SheetBuilder, smooth: int) -> None:
        self.frame, self.rng, self.sheet, self.smooth = frame, rng, sheet, smooth
        n = len(frame.storeys) - 1
        names = ["wall a", "wall b"]
        base = int(rng.integers(2))
        materials = [names[base if k == 0 else 1 - base] for k in range(n)]
        if frame.plain:
            materials[int(rng.integers(n))] = "paint"
        self.materials = materials

    def build(self) -> Sheet:
        frame = self.frame
        wing = self._wing() if frame.wing is not None else None
        for k in range(len(frame.storeys) - 1):
            self._main_storey(k, wing)
        self._roof()
        if frame.sides > 0:
            for x, facing in zip(frame.x, (-1, 1), strict=True):
                for y in pairwise(frame.storeys):
                    self.sheet.rectangle((x, x), y, (-frame.sides, 0), (facing, 0, 0), "wall a")
        return self.sheet.build()

    def _main_storey(self, k: int, wing: "_Wing | None") -> None:
        """The storey's wall to the left and the right of the wing, or as a whole above it."""
        frame, y = self.frame, (self.frame.storeys[k], self.frame.storeys[k + 1])
        parts = [frame.x]
        if wing is not None and k < wing.storeys:
            parts = [(frame.x[0], wing.x[0]), (wing.x[1], frame.x[1])]
        is_top = k == len(frame.storeys) - 2
        for x in parts:
            storey = Storey(x, y, 0.0, self.materials[k])
            if is_top and frame.gable:
                storey.peak = (round((x[0] + x[1]) / 2, 3), round(y[1] + frame.gable, 3))
            blocked = None
            if wing is not None and k == wing.storeys:
                storey.notches.append(wing.section)
                blocked = wing.x
            bays = [b for b in self._bays() if b[0] >= x[0] - 1e-9 and b[1] <= x[1] + 1e-9]
            if blocked is not None:
                bays = [b for b in bays if b[1] <= blocked[0] + 1e-9 or b[0] >= blocked[1] - 1e-9]
            self._fill(storey, bays, y, k == 0)

    def _bays(self) -> list[tuple[float, float]]:
        return list(pairwise(self.frame.bays))

    def _fill(self, storey: Storey, bays: list[tuple[float, float]], y: tuple[float, float], is_ground: bool) -> None:
        """Elements in the bays, pilasters between them, then the wall around all of them."""
        rng = self.rng
        pilasters = rng.random() < 0.35
        for k, bay in enumerate(bays):
            slot = Slot(storey, bay, y, is_ground, PANES)
            if rng.random() >= (EMPTY_SLOTS if self.frame.slots > FEW_SLOTS else 0.0):
                choices, weights = zip(*(GROUND if is_ground else UPPER), strict=True)
                choices[int(rng.choice(len(choices), p=np.array(weights)))](self.sheet, slot, rng, self.smooth)
            is_inside = k + 1 < len(bays) and bays[k + 1][0] == bay[1]
            if pilasters and is_inside:
                half = 0.065 * (bay[1] - bay[0])
                between = Slot(storey, (bay[1] - half, bay[1] + half), y, is_ground, PANES)
                elements.pilaster(self.sheet, between, rng, self.smooth)
        storey.add_to(self.sheet)

    def _wing(self) -> "_Wing":
        """The part that stands out: its front, its sides, its roof."""
        assert self.frame.wing is not None
        first, behind, storeys, depth = self.frame.wing
        frame, rng, sheet = self.frame, self.rng, self.sheet
        x = max(frame.bays[first], frame.x[0] + SHOULDER), min(frame.bays[behind], frame.x[1] - SHOULDER)
        top = frame.storeys[storeys]
        rise = round(rng.uniform(0.3, 0.6) * (frame.storeys[storeys + 1] - top), 3)
        middle = round((x[0] + x[1]) / 2, 3)
        kind = ("gable", "shed", "flat")[int(rng.integers(3))]
        material = "paint" if frame.plain and rng.random() < 0.4 else "wall b"
        for k in range(storeys):
            y = frame.storeys[k], frame.storeys[k + 1]
            storey = Storey(x, y, depth, material)
            if k == storeys - 1 and kind == "gable":
                storey.peak = (middle, top + rise)
            n = behind - first
            edges = [x[0] + (x[1] - x[0]) * i / n for i in range(n + 1)]
            self._fill(storey, list(pairwise(edges)), y, k == 0)
            for side, facing in ((x[0], -1), (x[1], 1)):
                sheet.rectangle((side, side), y, (0, depth), (facing, 0, 0), material)
        (left, right), ridge = x, top + rise
        section = [(left, top), (right, top)]
        if kind == "gable":
            section = [(left, top), (middle, ridge), (right, top)]
            for side, facing in ((left, -1), (right, 1)):
                slope = [(side, top, 0), (side, top, depth), (middle, ridge, depth), (middle, ridge, 0)]
                sheet.add(slope, (facing * rise, abs(middle - side), 0), "tiles")
        elif kind == "shed":
            section = [(left, top), (left, ridge), (right, ridge), (right, top)]
            for side, facing in ((left, -1), (right, 1)):
                sheet.add([(side, top, 0), (side, top, depth), (side, ridge, 0)], (facing, 0, 0), material)
            sheet.add(
                [(left, top, depth), (right, top, depth), (right, ridge, 0), (left, ridge, 0)],
                (0, depth, rise),
                "tiles",
            )
        else:
            sheet.rectangle(x, (top, top), (0, depth), (0, 1, 0), "inside")
        return _Wing(x, storeys, section)

    def _roof(self) -> None:
        """A cornice or the eaves and a tiled slope above the main wall; flat roofs and gables have none in the mesh."""
        frame, sheet = self.frame, self.sheet
        if frame.roof not in ("cornice", "eaves"):
            return
        (left, right), top = frame.x, frame.top
        front, head, ridge, back = frame.eaves
        sheet.rectangle((left, right), (top, top), (0, front), (0, -1, 0), "wood")
        sheet.rectangle((left, right), (top, head), (front, front), (0, 0, 1), "stone")
        if frame.roof == "cornice":
            sheet.rectangle((left, right), (head, head), (-0.4, front), (0, 1, 0), "inside")
            return
        slope = [(left, head, front), (right, head, front), (right, ridge, back), (left, ridge, back)]
        sheet.add(slope, (0, front - back, ridge - head), "tiles")


@dataclass(frozen=True)
class _Wing:
    """Extent of a wing in x, its storeys, and its roof's section with the main wall, left to right."""

    x: tuple[float, float]
    storeys: int
    section: list[tuple[float, float]]

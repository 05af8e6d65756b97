"""The archway's geometry in metres: two deep round arches, a balcony with a low parapet, a block higher up."""

from itertools import pairwise

import numpy as np

from demo_scenes.sheet import Sheet, SheetBuilder

SPACING = 1.15  # aimed-at edge length
LEFT, RIGHT, TOP = -4.6, 4.6, 7.4
ARCH_CENTERS, ARCH_RADIUS, ARCH_SPRING, ARCH_SEGMENTS, ARCH_DEPTH = (-2.1, 2.1), 1.15, 2.0, 8, 1.0

# Left, right, bottom, floor, the parapet's top, how far it stands out.
BALCONY = (-3.6, 3.6, 3.75, 4.35, 4.65, 1.2)
PARAPET = 0.3


def build_archway() -> Sheet:
    """The whole front."""
    sheet = SheetBuilder(SPACING)
    outline: list[tuple[float, float, float]] = [(LEFT, 0, 0)]
    for center in ARCH_CENTERS:
        outline += _arch(sheet, center)
    outline += [(RIGHT, 0, 0), (RIGHT, TOP, 0), (LEFT, TOP, 0)]
    holes = [_balcony(sheet, *BALCONY), sheet.box_ledge((-0.9, 0.9), (5.5, 6.5), 0.8, "plaster")]
    for x0, name in ((-3.3, "window a"), (2.0, "window b")):
        holes.append(sheet.box_recess((x0, x0 + 1.3), (5.3, 6.7), (-0.4, 0), "stone", name))
    sheet.add(outline, (0, 0, 1), "brick", holes=holes)
    return sheet.build()


def _arch(sheet: SheetBuilder, center: float) -> list[tuple[float, float, float]]:
    """Jambs, round soffit and back of a deep arch; returns its mouth from left to right."""
    turn = np.pi * np.arange(ARCH_SEGMENTS + 1) / ARCH_SEGMENTS
    mouth = [(center - ARCH_RADIUS, 0.0)]
    mouth += [(center - ARCH_RADIUS * float(np.cos(t)), ARCH_SPRING + ARCH_RADIUS * float(np.sin(t))) for t in turn]
    mouth.append((center + ARCH_RADIUS, 0.0))
    for (x0, y0), (x1, y1) in pairwise(mouth):
        stone = [(x0, y0, 0), (x1, y1, 0), (x1, y1, -ARCH_DEPTH), (x0, y0, -ARCH_DEPTH)]
        sheet.add(stone, (y1 - y0, x0 - x1, 0), "stone")
    sheet.add([(x, y, -ARCH_DEPTH) for x, y in mouth], (0, 0, 1), "rubble")
    return [(x, y, 0) for x, y in mouth]


def _balcony(
    sheet: SheetBuilder, left: float, right: float, bottom: float, floor: float, top: float, front: float
) -> list[tuple[float, float, float]]:
    """A slab with a solid parapet on three sides; returns its section at the wall, a U."""
    in_left, in_right, in_front = left + PARAPET, right - PARAPET, front - PARAPET
    sheet.rectangle((left, right), (bottom, top), (front, front), (0, 0, 1), "plaster")
    sheet.rectangle((left, left), (bottom, top), (0, front), (-1, 0, 0), "plaster")
    sheet.rectangle((right, right), (bottom, top), (0, front), (1, 0, 0), "plaster")
    sheet.rectangle((left, right), (bottom, bottom), (0, front), (0, -1, 0), "stone")
    rim = [(left, 0), (in_left, 0), (in_left, in_front), (in_right, in_front), (in_right, 0), (right, 0)]
    rim += [(right, front), (left, front)]
    sheet.add([(x, top, z) for x, z in rim], (0, 1, 0), "stone")
    sheet.rectangle((in_left, in_left), (floor, top), (0, in_front), (1, 0, 0), "plaster")
    sheet.rectangle((in_right, in_right), (floor, top), (0, in_front), (-1, 0, 0), "plaster")
    sheet.rectangle((in_left, in_right), (floor, top), (in_front, in_front), (0, 0, -1), "plaster")
    sheet.rectangle((in_left, in_right), (floor, floor), (0, in_front), (0, 1, 0), "stone")
    section = [(left, bottom), (right, bottom), (right, top), (in_right, top), (in_right, floor)]
    section += [(in_left, floor), (in_left, top), (left, top)]
    return [(x, y, 0) for x, y in section]

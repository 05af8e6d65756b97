"""Geometry of the demo `archway`, metres: two deep round arches, a balcony with a low parapet, a block above it."""

from demo_scenes.parts import add_parapet, add_soffit, arch_outline, parapet_section
from demo_scenes.sheet import Sheet, SheetBuilder

SPACING = 1.15  # target edge length
LEFT, RIGHT, TOP = -4.6, 4.6, 7.4
ARCH_CENTERS, ARCH_RADIUS, ARCH_SPRING, ARCH_SEGMENTS, ARCH_DEPTH = (-2.1, 2.1), 1.15, 2.0, 8, 1.0

# Left, right, bottom, floor, top of the parapet, projection from the wall.
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
    """Add the jambs, soffit and back of a deep arch; returns its mouth from left to right."""
    mouth = arch_outline(center, ARCH_RADIUS, ARCH_SPRING, ARCH_SEGMENTS)
    add_soffit(sheet, mouth, 0, -ARCH_DEPTH, "stone")
    sheet.add([(x, y, -ARCH_DEPTH) for x, y in mouth], (0, 0, 1), "rubble")
    return [(x, y, 0) for x, y in mouth]


def _balcony(
    sheet: SheetBuilder, left: float, right: float, bottom: float, floor: float, top: float, front: float
) -> list[tuple[float, float, float]]:
    """Add a slab with a solid parapet on three sides; returns its section at the wall, a U."""
    sheet.rectangle((left, right), (bottom, top), (front, front), (0, 0, 1), "plaster")
    sheet.rectangle((left, left), (bottom, top), (0, front), (-1, 0, 0), "plaster")
    sheet.rectangle((right, right), (bottom, top), (0, front), (1, 0, 0), "plaster")
    sheet.rectangle((left, right), (bottom, bottom), (0, front), (0, -1, 0), "stone")
    add_parapet(sheet, (left, right), (floor, top), (0, front), PARAPET, "stone", "plaster", "stone")
    return [(x, y, 0) for x, y in parapet_section(left, right, bottom, floor, top, PARAPET)]

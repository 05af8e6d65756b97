"""Geometry of the demo `facade`, metres: x right, y up, z towards the street.

The parts are a plastered main wall with eaves and a tiled roof; a gabled brick wing that projects on the left, with an
apse under a round arch; a porch on two pillars whose parapet hides part of the wall; deep windows, a string course, a
door.
"""

import numpy as np

from demo_scenes.parts import Outline, add_apse, add_parapet, add_soffit, arch_outline, parapet_section
from demo_scenes.sheet import Sheet, SheetBuilder

SPACING = 1.3  # target edge length
LEFT, RIGHT, TOP = -6.0, 6.0, 7.6

WING_LEFT, WING_RIGHT, WING_FRONT = -5.0, -0.8, 1.6
GABLE_X, WALL_HEAD, GABLE_TOP = -2.9, 4.6, 6.6
SLOPE = (GABLE_TOP - WALL_HEAD) / (GABLE_X - WING_LEFT)
OVERHANG, ROOF_THICKNESS = 0.45, 0.36

ARCH_RADIUS, ARCH_SPRING, ARCH_SEGMENTS = 1.05, 2.2, 8
APSE_Z = WING_FRONT - 0.45  # end of the arch's soffit, beginning of the apse

PORCH_LEFT, PORCH_RIGHT, PORCH_FRONT = 0.6, 3.4, 1.7
SLAB_BOTTOM, SLAB_TOP, PARAPET_TOP = 2.9, 3.25, 4.0
PILLAR, PARAPET = 0.42, 0.32


def build_facade() -> Sheet:
    """The whole building."""
    sheet = SheetBuilder(SPACING)
    _main_wall(sheet)
    _eaves_and_roof(sheet)
    _wing_walls(sheet)
    _wing_roof(sheet)
    _apse(sheet)
    _porch(sheet)
    return sheet.build()


def _main_wall(sheet: SheetBuilder) -> None:
    windows = [
        sheet.box_recess((1.1, 2.4), (5.2, 6.8), (-0.4, 0), "stone", "window a"),
        sheet.box_recess((3.8, 5.1), (5.2, 6.8), (-0.4, 0), "stone", "window b"),
        sheet.box_recess((4.2, 5.4), (1.1, 2.8), (-0.4, 0), "stone", "window c"),
    ]
    door = [(1.4, 0, 0), (1.4, 2.3, 0), (2.6, 2.3, 0), (2.6, 0, 0)]
    sheet.rectangle((1.4, 1.4), (0, 2.3), (-0.45, 0), (1, 0, 0), "stone")
    sheet.rectangle((2.6, 2.6), (0, 2.3), (-0.45, 0), (-1, 0, 0), "stone")
    sheet.rectangle((1.4, 2.6), (2.3, 2.3), (-0.45, 0), (0, -1, 0), "stone")
    sheet.rectangle((1.4, 2.6), (0, 2.3), (-0.45, -0.45), (0, 0, 1), "wood")

    string_course = sheet.box_ledge((0.4, 5.6), (4.5, 4.84), 0.36, "stone")
    wing = [(WING_LEFT, 0, 0), *[(x, y, 0) for x, y in _gable_outline()], (WING_RIGHT, 0, 0)]
    outline = [(LEFT, 0, 0), *wing, *door, (RIGHT, 0, 0), (RIGHT, TOP, 0), (LEFT, TOP, 0)]
    porch_outline = parapet_section(PORCH_LEFT, PORCH_RIGHT, SLAB_BOTTOM, SLAB_TOP, PARAPET_TOP, PARAPET)
    porch = [(x, y, 0) for x, y in porch_outline]
    sheet.add(outline, (0, 0, 1), "plaster", holes=[*windows, string_course, porch])


def _eaves_and_roof(sheet: SheetBuilder) -> None:
    front, head, ridge_y, ridge_z = 0.45, TOP + 0.42, 11.0, -1.6
    sheet.rectangle((LEFT, RIGHT), (TOP, TOP), (0, front), (0, -1, 0), "wood")
    sheet.rectangle((LEFT, RIGHT), (TOP, head), (front, front), (0, 0, 1), "stone")
    roof = [(LEFT, head, front), (RIGHT, head, front), (RIGHT, ridge_y, ridge_z), (LEFT, ridge_y, ridge_z)]
    sheet.add(roof, (0, front - ridge_z, ridge_y - head), "tiles")


def _gable_outline() -> list[tuple[float, float]]:
    """Section (x, y) of the wing with the main wall: up its left wall, over the roof, down its right wall."""
    eave_left, eave_right = WING_LEFT - OVERHANG, WING_RIGHT + OVERHANG
    eave = WALL_HEAD - OVERHANG * SLOPE
    return [
        (WING_LEFT, WALL_HEAD),
        (eave_left, eave),
        (eave_left, eave + ROOF_THICKNESS),
        (GABLE_X, GABLE_TOP + ROOF_THICKNESS),
        (eave_right, eave + ROOF_THICKNESS),
        (eave_right, eave),
        (WING_RIGHT, WALL_HEAD),
    ]


def _wing_walls(sheet: SheetBuilder) -> None:
    sheet.rectangle((WING_LEFT, WING_LEFT), (0, WALL_HEAD), (0, WING_FRONT), (-1, 0, 0), "brick")
    sheet.rectangle((WING_RIGHT, WING_RIGHT), (0, WALL_HEAD), (0, WING_FRONT), (1, 0, 0), "brick")
    window = sheet.box_recess((-3.4, -2.4), (4.3, 5.4), (WING_FRONT - 0.4, WING_FRONT), "stone", "window d")
    wall = [
        (WING_LEFT, 0),
        *_arch(),
        (WING_RIGHT, 0),
        (WING_RIGHT, WALL_HEAD),
        (GABLE_X, GABLE_TOP),
        (WING_LEFT, WALL_HEAD),
    ]
    sheet.add([(x, y, WING_FRONT) for x, y in wall], (0, 0, 1), "brick", holes=[window])


def _wing_roof(sheet: SheetBuilder) -> None:
    front = WING_FRONT + OVERHANG
    (left, head), (eave_left, eave), (_, tile), (ridge_x, ridge), *_ = _gable_outline()
    for side in (1, -1):

        def at(x: float, y: float, z: float, side: int = side) -> tuple[float, float, float]:
            return (x if side > 0 else 2 * GABLE_X - x, y, z)

        soffit = [
            at(eave_left, eave, 0),
            at(eave_left, eave, front),
            at(GABLE_X, GABLE_TOP, front),
            at(GABLE_X, GABLE_TOP, WING_FRONT),
            at(left, head, WING_FRONT),
            at(left, head, 0),
        ]
        sheet.add(soffit, (side * SLOPE, -1, 0), "wood")
        fascia = [
            at(eave_left, eave, 0),
            at(eave_left, eave, front),
            at(eave_left, tile, front),
            at(eave_left, tile, 0),
        ]
        sheet.add(fascia, (-side, 0, 0), "wood")
        top = [at(eave_left, tile, 0), at(eave_left, tile, front), at(ridge_x, ridge, front), at(ridge_x, ridge, 0)]
        sheet.add(top, (-side * SLOPE, 1, 0), "tiles")
    verge = [(x, y, front) for x, y in [*_gable_outline()[1:6], (GABLE_X, GABLE_TOP)]]
    sheet.add(verge, (0, 0, 1), "stone")


def _apse(sheet: SheetBuilder) -> None:
    """Add the arch's soffit and the apse behind it."""
    add_soffit(sheet, _arch(), WING_FRONT, APSE_Z, "stone")
    center = np.array([GABLE_X, ARCH_SPRING, APSE_Z])
    add_apse(sheet, center, ARCH_RADIUS, ARCH_SEGMENTS, 3, "plaster inside", "mosaic")


def _arch() -> Outline:
    return arch_outline(GABLE_X, ARCH_RADIUS, ARCH_SPRING, ARCH_SEGMENTS)


def _porch(sheet: SheetBuilder) -> None:
    x0, x1, z1 = PORCH_LEFT, PORCH_RIGHT, PORCH_FRONT
    post0, post1, back = x0 + PILLAR, x1 - PILLAR, z1 - PILLAR
    front = [(x0, 0), (post0, 0), (post0, SLAB_BOTTOM), (post1, SLAB_BOTTOM), (post1, 0), (x1, 0)]
    front += [(x1, PARAPET_TOP), (x0, PARAPET_TOP)]
    sheet.add([(x, y, z1) for x, y in front], (0, 0, 1), "stone")
    side = [(0, SLAB_BOTTOM), (back, SLAB_BOTTOM), (back, 0), (z1, 0), (z1, PARAPET_TOP), (0, PARAPET_TOP)]
    for x, facing in ((x0, -1), (x1, 1)):
        sheet.add([(x, y, z) for z, y in side], (facing, 0, 0), "stone")
    for post, outer, facing in ((post0, x0, 1), (post1, x1, -1)):
        sheet.rectangle((post, post), (0, SLAB_BOTTOM), (back, z1), (facing, 0, 0), "stone")
        sheet.rectangle((min(post, outer), max(post, outer)), (0, SLAB_BOTTOM), (back, back), (0, 0, -1), "stone")
    below = [(x0, 0), (x1, 0), (x1, back), (post1, back), (post1, z1), (post0, z1), (post0, back), (x0, back)]
    sheet.add([(x, SLAB_BOTTOM, z) for x, z in below], (0, -1, 0), "stone")
    add_parapet(sheet, (x0, x1), (SLAB_TOP, PARAPET_TOP), (0, z1), PARAPET, "stone", "stone", "stone")

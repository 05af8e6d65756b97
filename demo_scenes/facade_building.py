"""The facade's geometry in metres: x right, y up, z towards the street.

A plastered main wall with eaves and a tiled roof; a gabled brick wing that stands out to the left, with an apse under
a round arch; a porch on two pillars whose parapet hides part of the wall; deep windows, a string course, a door.
"""

from itertools import pairwise

import numpy as np

from demo_scenes.sheet import Mapping, Sheet, SheetBuilder

SPACING = 1.3  # aimed-at edge length
LEFT, RIGHT, TOP = -6.0, 6.0, 7.6

WING_LEFT, WING_RIGHT, WING_FRONT = -5.0, -0.8, 1.6
GABLE_X, WALL_HEAD, GABLE_TOP = -2.9, 4.6, 6.6
SLOPE = (GABLE_TOP - WALL_HEAD) / (GABLE_X - WING_LEFT)
OVERHANG, ROOF_THICKNESS = 0.45, 0.36

ARCH_RADIUS, ARCH_SPRING, ARCH_SEGMENTS = 1.05, 2.2, 8
APSE_Z = WING_FRONT - 0.45  # where the arch's soffit ends and the apse begins

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
    porch = [(x, y, 0) for x, y in _porch_section()]
    sheet.add(outline, (0, 0, 1), "plaster", holes=[*windows, string_course, porch])


def _eaves_and_roof(sheet: SheetBuilder) -> None:
    front, head, ridge_y, ridge_z = 0.45, TOP + 0.42, 11.0, -1.6
    sheet.rectangle((LEFT, RIGHT), (TOP, TOP), (0, front), (0, -1, 0), "wood")
    sheet.rectangle((LEFT, RIGHT), (TOP, head), (front, front), (0, 0, 1), "stone")
    roof = [(LEFT, head, front), (RIGHT, head, front), (RIGHT, ridge_y, ridge_z), (LEFT, ridge_y, ridge_z)]
    sheet.add(roof, (0, front - ridge_z, ridge_y - head), "tiles")


def _gable_outline() -> list[tuple[float, float]]:
    """The wing against the main wall (x, y): up its left wall, over the roof, down its right wall."""
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
    arch = [(x, y, WING_FRONT) for x, y in _arch_outline()]
    wall = [
        (WING_LEFT, 0),
        *[(x, y) for x, y, _ in arch],
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


def _arch_outline() -> list[tuple[float, float]]:
    """The mouth of the arch (x, y): up the left jamb, over the round, down the right jamb."""
    turn = np.pi * np.arange(ARCH_SEGMENTS + 1) / ARCH_SEGMENTS
    round_arch = [(GABLE_X - ARCH_RADIUS * np.cos(t), ARCH_SPRING + ARCH_RADIUS * np.sin(t)) for t in turn]
    return [(GABLE_X - ARCH_RADIUS, 0), *round_arch, (GABLE_X + ARCH_RADIUS, 0)]


def _apse(sheet: SheetBuilder) -> None:
    """The arch's soffit, then a half-cylinder of wall under a quarter of a sphere, the inner dome."""
    outline = _arch_outline()
    for (x0, y0), (x1, y1) in pairwise(outline):
        stone = [(x0, y0, WING_FRONT), (x1, y1, WING_FRONT), (x1, y1, APSE_Z), (x0, y0, APSE_Z)]
        sheet.add(stone, (y1 - y0, x0 - x1, 0), "stone")

    center = np.array([GABLE_X, ARCH_SPRING, APSE_Z])
    turn = np.pi * np.arange(ARCH_SEGMENTS + 1) / ARCH_SEGMENTS
    for t0, t1 in pairwise(turn):
        (a, b) = (center - ARCH_RADIUS * np.array([np.cos(t), 0, np.sin(t)]) for t in (t0, t1))
        wall = [a * [1, 0, 1], b * [1, 0, 1], b, a]
        sheet.add(wall, center - (a + b) / 2, "plaster inside", mapping=_around_apse(center, (t0 + t1) / 2))

    # Lunes between the arch (tilt 0) and the spring line at the back (tilt 90 degrees); all meet in the two ends.
    tilt = np.pi / 2 * np.arange(4) / 3

    def at(t: float, lean: float) -> np.ndarray:
        direction = np.array([-np.cos(t), np.sin(t) * np.cos(lean), -np.sin(t) * np.sin(lean)])
        return center + ARCH_RADIUS * np.round(direction, 12)

    for lean0, lean1 in pairwise(tilt):
        for t0, t1 in pairwise(turn):
            corners = [at(t0, lean0), at(t0, lean1), at(t1, lean1), at(t1, lean0)]
            for triangle in ([0, 1, 2], [0, 2, 3]):
                points = np.array([corners[k] for k in triangle])
                if len(np.unique(np.round(points, 9), axis=0)) == 3:
                    facing = center - points.mean(axis=0)
                    sheet.add(points, facing, "mosaic", mapping=_over_dome(center))


def _around_apse(center: np.ndarray, turn: float) -> Mapping:
    """Unrolled cylinder; `turn` keeps the angle continuous at the seam."""

    def mapping(points: np.ndarray) -> np.ndarray:
        angle = np.arctan2(center[2] - points[..., 2], center[0] - points[..., 0])
        angle += 2 * np.pi * np.round((turn - angle) / (2 * np.pi))
        return np.stack([ARCH_RADIUS * angle, -points[..., 1]], axis=-1)

    return mapping


def _over_dome(center: np.ndarray) -> Mapping:
    """Distances from the dome's crown kept (azimuthal equidistant about its middle direction)."""
    axis = np.array([0, 1, -1]) / np.sqrt(2)
    right, up = np.array([1.0, 0, 0]), np.array([0, 1, 1]) / np.sqrt(2)

    def mapping(points: np.ndarray) -> np.ndarray:
        d = points - center
        across = np.stack([d @ right, -(d @ up)], axis=-1)
        radius = np.linalg.norm(across, axis=-1, keepdims=True)
        angle = np.arctan2(radius, (d @ axis)[..., None])
        return 3.0 + ARCH_RADIUS * angle * across / np.maximum(radius, 1e-12)

    return mapping


def _porch_section() -> list[tuple[float, float]]:
    """Slab and parapets where they meet the wall (x, y): a U."""
    inner_left, inner_right = PORCH_LEFT + PARAPET, PORCH_RIGHT - PARAPET
    return [
        (PORCH_LEFT, SLAB_BOTTOM),
        (PORCH_RIGHT, SLAB_BOTTOM),
        (PORCH_RIGHT, PARAPET_TOP),
        (inner_right, PARAPET_TOP),
        (inner_right, SLAB_TOP),
        (inner_left, SLAB_TOP),
        (inner_left, PARAPET_TOP),
        (PORCH_LEFT, PARAPET_TOP),
    ]


def _porch(sheet: SheetBuilder) -> None:
    x0, x1, z1 = PORCH_LEFT, PORCH_RIGHT, PORCH_FRONT
    post0, post1, back = x0 + PILLAR, x1 - PILLAR, z1 - PILLAR
    in0, in1, inz = x0 + PARAPET, x1 - PARAPET, z1 - PARAPET
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
    rim = [(x0, 0), (in0, 0), (in0, inz), (in1, inz), (in1, 0), (x1, 0), (x1, z1), (x0, z1)]
    sheet.add([(x, PARAPET_TOP, z) for x, z in rim], (0, 1, 0), "stone")
    sheet.rectangle((in0, in0), (SLAB_TOP, PARAPET_TOP), (0, inz), (1, 0, 0), "stone")
    sheet.rectangle((in1, in1), (SLAB_TOP, PARAPET_TOP), (0, inz), (-1, 0, 0), "stone")
    sheet.rectangle((in0, in1), (SLAB_TOP, PARAPET_TOP), (inz, inz), (0, 0, -1), "stone")
    sheet.rectangle((in0, in1), (SLAB_TOP, SLAB_TOP), (0, inz), (0, 1, 0), "stone")

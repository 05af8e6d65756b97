"""Elements of walls: windows, arches, doors with stairs, porches, towers, balconies, pilasters and ledges.

Each function adds the patches of one element to a sheet, and its opening to the storey. All sizes come from the random
generator; `smooth` multiplies the number of facets of curved parts, which then approximate true curves.
"""

from itertools import pairwise

import numpy as np

from demo_scenes.building.storey import Outline, Slot
from demo_scenes.parts import add_apse, add_parapet, add_soffit, arch_outline, parapet_section
from demo_scenes.sheet import SheetBuilder

ARCH_SEGMENTS = 6
COLUMN_SIDES = 6
TOWER_SEGMENTS = 6


def window(sheet: SheetBuilder, slot: Slot, rng: np.random.Generator, smooth: int) -> None:
    """A window in a recess with reveals, often with a sill that projects below it."""
    x = slot.span(rng.uniform(0.18, 0.29))
    y = slot.level(rng.uniform(0.36, 0.44)), slot.level(rng.uniform(0.72, 0.82))
    _recess(sheet, slot, x, y, rng)
    if rng.random() < 0.4:
        below = slot.level(0.18), slot.level(0.28)
        sill = sheet.box_ledge(_wider(x, 0.08), below, round(rng.uniform(0.22, 0.45), 3), "stone", slot.storey.z)
        slot.storey.holes.append([point[:2] for point in sill])


def arched_window(sheet: SheetBuilder, slot: Slot, rng: np.random.Generator, smooth: int) -> None:
    """A window with a round head."""
    radius = rng.uniform(0.18, 0.25) * slot.width
    foot, spring = slot.level(rng.uniform(0.28, 0.36)), slot.level(0.84) - radius
    outline = arch_outline(slot.center, radius, max(spring, foot + 0.2), ARCH_SEGMENTS * smooth, foot)
    back = slot.storey.z - rng.uniform(0.25, 0.5)
    add_soffit(sheet, outline, slot.storey.z, back, "stone")
    sheet.rectangle((outline[0][0], outline[-1][0]), (foot, foot), (back, slot.storey.z), (0, 1, 0), "stone")
    sheet.add([(x, y, back) for x, y in outline], (0, 0, 1), "wood")
    slot.storey.holes.append(outline)


def ledge(sheet: SheetBuilder, slot: Slot, rng: np.random.Generator, smooth: int) -> None:
    """A long block that projects from a wall without openings."""
    low = rng.uniform(0.3, 0.6)
    y = slot.level(low), slot.level(low + rng.uniform(0.1, 0.25))
    depth = round(rng.uniform(0.25, 0.7), 3)
    section = sheet.box_ledge(slot.span(rng.uniform(0.25, 0.36)), y, depth, "stone", slot.storey.z)
    slot.storey.holes.append([point[:2] for point in section])


def balcony(sheet: SheetBuilder, slot: Slot, rng: np.random.Generator, smooth: int) -> None:
    """A slab with a parapet on three sides, and a window above."""
    (left, right), wall = slot.span(0.36), slot.storey.z
    bottom, floor, top = slot.level(0.06), slot.level(0.15), slot.level(rng.uniform(0.32, 0.42))
    front, thickness = round(wall + rng.uniform(0.8, 1.3), 3), round(0.1 * slot.width, 3)
    sheet.rectangle((left, right), (bottom, top), (front, front), (0, 0, 1), "stone")
    sheet.rectangle((left, left), (bottom, top), (wall, front), (-1, 0, 0), "stone")
    sheet.rectangle((right, right), (bottom, top), (wall, front), (1, 0, 0), "stone")
    sheet.rectangle((left, right), (bottom, bottom), (wall, front), (0, -1, 0), "inside")
    add_parapet(sheet, (left, right), (floor, top), (wall, front), thickness, "stone", "inside", "inside")
    slot.storey.holes.append(parapet_section(left, right, bottom, floor, top, thickness))
    _recess(sheet, slot, slot.span(0.2), (slot.level(0.52), slot.level(0.84)), rng)


def door_with_stairs(sheet: SheetBuilder, slot: Slot, rng: np.random.Generator, smooth: int) -> None:
    """A recessed door above two to four steps."""
    steps, rise = int(rng.integers(2, 5)), round(rng.uniform(0.2, 0.26), 3)
    tread, wall = round(rng.uniform(0.34, 0.46), 3), slot.storey.z
    (left, right), (door_left, door_right) = slot.span(0.36), slot.span(rng.uniform(0.17, 0.22))
    sill, head = steps * rise, slot.level(0.86)
    side = [(wall, 0.0), (wall, sill)]
    for k in range(steps):
        front, top = wall + 0.5 + k * tread, sill - k * rise
        back = wall if k == 0 else front - tread
        sheet.rectangle((left, right), (top, top), (back, front), (0, 1, 0), "inside")
        sheet.rectangle((left, right), (top - rise, top), (front, front), (0, 0, 1), "stone")
        side += [(front, top), (front, top - rise)]
    for x, facing in ((left, -1), (right, 1)):
        sheet.add([(x, y, z) for z, y in _without_repeats(side)], (facing, 0, 0), "stone")
    back = wall - round(rng.uniform(0.3, 0.5), 3)
    _door(sheet, (door_left, door_right), (sill, head), (back, wall))
    sheet.rectangle((door_left, door_right), (sill, sill), (back, wall), (0, 1, 0), "stone")
    slot.storey.notches.append(
        [
            *[(left, 0.0), (left, sill), (door_left, sill), (door_left, head)],
            *[(door_right, head), (door_right, sill), (right, sill), (right, 0.0)],
        ]
    )


def porch(sheet: SheetBuilder, slot: Slot, rng: np.random.Generator, smooth: int) -> None:
    """A slab on two columns, round or square, in front of a recessed door."""
    (left, right), wall = slot.span(0.42), slot.storey.z
    bottom, top = slot.level(0.76), slot.level(0.89)
    front = round(wall + rng.uniform(1.2, 1.9), 3)
    radius = rng.uniform(0.075, 0.1) * slot.width
    is_round = rng.random() < 0.6
    columns = []
    for x in (left + 1.4 * radius, right - 1.4 * radius):
        sides, turn = (COLUMN_SIDES * smooth, 0.0) if is_round else (4, np.pi / 4)
        angle = turn + 2 * np.pi * np.arange(sides) / sides
        z = front - 1.4 * radius
        column = [(float(x + radius * np.cos(t)), float(z + radius * np.sin(t))) for t in angle]
        for (x0, z0), (x1, z1) in zip(column, [*column[1:], column[0]], strict=True):
            strip = [(x0, 0, z0), (x1, 0, z1), (x1, bottom, z1), (x0, bottom, z0)]
            sheet.add(strip, ((x0 + x1) / 2 - x, 0, (z0 + z1) / 2 - z), "stone")
        columns.append([(px, bottom, pz) for px, pz in column])
    sheet.add(
        [(left, bottom, wall), (right, bottom, wall), (right, bottom, front), (left, bottom, front)],
        (0, -1, 0),
        "inside",
        holes=columns,
    )
    sheet.rectangle((left, right), (bottom, top), (front, front), (0, 0, 1), "stone")
    sheet.rectangle((left, left), (bottom, top), (wall, front), (-1, 0, 0), "stone")
    sheet.rectangle((right, right), (bottom, top), (wall, front), (1, 0, 0), "stone")
    sheet.rectangle((left, right), (top, top), (wall, front), (0, 1, 0), "inside")
    slot.storey.holes.append([(left, bottom), (right, bottom), (right, top), (left, top)])
    x, y = slot.span(0.18), (0.0, slot.level(0.66))
    _door(sheet, x, y, (wall - 0.35, wall))
    slot.storey.notches.append([(x[0], 0.0), (x[0], y[1]), (x[1], y[1]), (x[1], 0.0)])


def archway(sheet: SheetBuilder, slot: Slot, rng: np.random.Generator, smooth: int) -> None:
    """A deep round arch from the ground, closed by a flat back or by an apse."""
    radius = rng.uniform(0.26, 0.34) * slot.width
    spring = min(slot.level(rng.uniform(0.4, 0.5)), slot.level(0.9) - radius)
    wall = slot.storey.z
    outline = arch_outline(slot.center, radius, spring, ARCH_SEGMENTS * smooth)
    if rng.random() < 0.4:
        back = wall - 0.45
        center = np.array([slot.center, spring, back])
        add_apse(sheet, center, radius, ARCH_SEGMENTS * smooth, 2 * smooth, "inside", "rubble")
    else:
        back = wall - rng.uniform(0.5, 1.0)
        sheet.add([(x, y, back) for x, y in outline], (0, 0, 1), "rubble")
    add_soffit(sheet, outline, wall, back, "stone")
    slot.storey.notches.append(outline)


def tower(sheet: SheetBuilder, slot: Slot, rng: np.random.Generator, smooth: int) -> None:
    """A half-round tower from the ground under a half-cone."""
    radius = rng.uniform(0.3, 0.4) * slot.width
    head = slot.level(rng.uniform(0.55, 0.68))
    apex = min(head + rng.uniform(0.7, 1.0) * radius, slot.level(0.93))
    center, wall = slot.center, slot.storey.z
    turn = np.pi * np.arange(TOWER_SEGMENTS * smooth + 1) / (TOWER_SEGMENTS * smooth)
    ring = [(center - radius * float(np.cos(t)), wall + round(radius * float(np.sin(t)), 12)) for t in turn]
    for k, ((x0, z0), (x1, z1)) in enumerate(pairwise(ring)):
        outward = ((x0 + x1) / 2 - center, 0.0, (z0 + z1) / 2 - wall)
        along = radius * float(turn[1]) * k

        def mapping(points: np.ndarray, x: float = x0, z: float = z0, along: float = along) -> np.ndarray:
            return np.stack([along + np.hypot(points[..., 0] - x, points[..., 2] - z), -points[..., 1]], axis=-1)

        strip = [(x0, 0, z0), (x1, 0, z1), (x1, head, z1), (x0, head, z0)]
        sheet.add(strip, outward, "wall b", mapping=mapping)
        slope = radius * radius / (apex - head)
        roof = [(x0, head, z0), (x1, head, z1), (center, apex, wall)]
        sheet.add(roof, (outward[0], slope, outward[2]), "tiles")
    left, right = ring[0][0], ring[-1][0]
    slot.storey.notches.append([(left, 0.0), (left, head), (center, apex), (right, head), (right, 0.0)])


def pilaster(sheet: SheetBuilder, slot: Slot, rng: np.random.Generator, smooth: int) -> None:
    """A flat column that stands on the storey's lower edge and projects from the wall."""
    (left, right), wall = slot.span(0.5), slot.storey.z
    foot, head, front = slot.y[0], slot.level(rng.uniform(0.8, 0.9)), round(wall + rng.uniform(0.2, 0.45), 3)
    sheet.rectangle((left, right), (foot, head), (front, front), (0, 0, 1), "stone")
    sheet.rectangle((left, left), (foot, head), (wall, front), (-1, 0, 0), "stone")
    sheet.rectangle((right, right), (foot, head), (wall, front), (1, 0, 0), "stone")
    sheet.rectangle((left, right), (head, head), (wall, front), (0, 1, 0), "stone")
    if not slot.is_ground:
        sheet.rectangle((left, right), (foot, foot), (wall, front), (0, -1, 0), "stone")
    slot.storey.notches.append([(left, foot), (left, head), (right, head), (right, foot)])


def _recess(
    sheet: SheetBuilder, slot: Slot, x: tuple[float, float], y: tuple[float, float], rng: np.random.Generator
) -> None:
    """A rectangular recess with a window pane at its back."""
    depth, pane = round(rng.uniform(0.22, 0.5), 3), slot.panes[int(rng.integers(len(slot.panes)))]
    mouth = sheet.box_recess(x, y, (round(slot.storey.z - depth, 3), slot.storey.z), "stone", pane)
    slot.storey.holes.append([point[:2] for point in mouth])


def _door(sheet: SheetBuilder, x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> None:
    """Jambs, lintel and door leaf of a recess without a floor."""
    sheet.rectangle((x[0], x[0]), y, z, (1, 0, 0), "stone")
    sheet.rectangle((x[1], x[1]), y, z, (-1, 0, 0), "stone")
    sheet.rectangle(x, (y[1], y[1]), z, (0, -1, 0), "stone")
    sheet.rectangle(x, y, (z[0], z[0]), (0, 0, 1), "wood")


def _wider(x: tuple[float, float], by: float) -> tuple[float, float]:
    return round(x[0] - by, 3), round(x[1] + by, 3)


def _without_repeats(outline: Outline) -> Outline:
    return [point for k, point in enumerate(outline) if point != outline[k - 1]]

"""Parts that buildings share: round arches, apses, and slabs with a parapet.

All parts are added to a `SheetBuilder`. Coordinates are metres: x right, y up, z towards the street.
"""

from itertools import pairwise

import numpy as np

from demo_scenes.sheet import Mapping, SheetBuilder

Outline = list[tuple[float, float]]


def arch_outline(center: float, radius: float, spring: float, segments: int, foot: float = 0.0) -> Outline:
    """Outline (x, y) of a round arch: up the left jamb, over the arch, down the right jamb.

    Args:
        center: x of the arch's axis.
        spring: y at which the jambs end and the arch begins.
        segments: number of straight pieces of the arch.
        foot: y of the jambs' lower ends.
    """
    turn = np.pi * np.arange(segments + 1) / segments
    arch = [(center - radius * float(np.cos(t)), spring + radius * float(np.sin(t))) for t in turn]
    return [(center - radius, foot), *arch, (center + radius, foot)]


def add_soffit(sheet: SheetBuilder, outline: Outline, front: float, back: float, material: str) -> None:
    """Add the surface that an outline (x, y) sweeps from z = `front` back to z = `back`, facing the opening."""
    for (x0, y0), (x1, y1) in pairwise(outline):
        strip = [(x0, y0, front), (x1, y1, front), (x1, y1, back), (x0, y0, back)]
        sheet.add(strip, (y1 - y0, x0 - x1, 0), material)


def add_apse(
    sheet: SheetBuilder,
    center: np.ndarray,
    radius: float,
    segments: int,
    tilts: int,
    wall: str,
    dome: str,
) -> None:
    """Add a half-cylinder of wall, open towards the street, under a quarter of a sphere.

    Args:
        center: (3,) float, metres: centre of the sphere; the wall reaches down to y = 0.
        segments: number of facets of the half-cylinder.
        tilts: number of facets from the mouth of the dome to its spring line at the back.
    """
    turn = np.pi * np.arange(segments + 1) / segments
    for t0, t1 in pairwise(turn):
        (a, b) = (center - radius * np.array([np.cos(t), 0, np.sin(t)]) for t in (t0, t1))
        strip = [a * [1, 0, 1], b * [1, 0, 1], b, a]
        mapping = _cylinder_mapping(center, radius, (t0 + t1) / 2)
        sheet.add(strip, center - (a + b) / 2, wall, mapping=mapping)

    # Lunes between the mouth (tilt 0) and the spring line at the back (tilt 90 degrees); all meet in the two ends.
    tilt = np.pi / 2 * np.arange(tilts + 1) / tilts

    def at(t: float, lean: float) -> np.ndarray:
        direction = np.array([-np.cos(t), np.sin(t) * np.cos(lean), -np.sin(t) * np.sin(lean)])
        return center + radius * np.round(direction, 12)

    for lean0, lean1 in pairwise(tilt):
        for t0, t1 in pairwise(turn):
            corners = [at(t0, lean0), at(t0, lean1), at(t1, lean1), at(t1, lean0)]
            for triangle in ([0, 1, 2], [0, 2, 3]):
                points = np.array([corners[k] for k in triangle])
                if len(np.unique(np.round(points, 9), axis=0)) == 3:
                    facing = center - points.mean(axis=0)
                    sheet.add(points, facing, dome, mapping=_dome_mapping(center, radius))


def parapet_section(left: float, right: float, bottom: float, floor: float, top: float, thickness: float) -> Outline:
    """Section (x, y) of a slab with two parapets where it meets the wall: a U."""
    in_left, in_right = left + thickness, right - thickness
    return [
        (left, bottom),
        (right, bottom),
        (right, top),
        (in_right, top),
        (in_right, floor),
        (in_left, floor),
        (in_left, top),
        (left, top),
    ]


def add_parapet(
    sheet: SheetBuilder,
    x: tuple[float, float],
    y: tuple[float, float],
    z: tuple[float, float],
    thickness: float,
    rim: str,
    inside: str,
    floor: str,
) -> None:
    """Add the top and the inner faces of a parapet on three sides, and the floor between them.

    Args:
        x: outer left and right face.
        y: the floor, and the parapet's top.
        z: the wall, and the parapet's front face.
        rim, inside, floor: materials.
    """
    (left, right), (low, top), (wall, front) = x, y, z
    in_left, in_right, in_front = left + thickness, right - thickness, front - thickness
    outline = [(left, wall), (in_left, wall), (in_left, in_front), (in_right, in_front), (in_right, wall)]
    outline += [(right, wall), (right, front), (left, front)]
    sheet.add([(px, top, pz) for px, pz in outline], (0, 1, 0), rim)
    sheet.rectangle((in_left, in_left), y, (wall, in_front), (1, 0, 0), inside)
    sheet.rectangle((in_right, in_right), y, (wall, in_front), (-1, 0, 0), inside)
    sheet.rectangle((in_left, in_right), y, (in_front, in_front), (0, 0, -1), inside)
    sheet.rectangle((in_left, in_right), (low, low), (wall, in_front), (0, 1, 0), floor)


def _cylinder_mapping(center: np.ndarray, radius: float, turn: float) -> Mapping:
    """Texture coordinates of an unrolled cylinder; `turn` keeps the angle continuous at the seam."""

    def mapping(points: np.ndarray) -> np.ndarray:
        angle = np.arctan2(center[2] - points[..., 2], center[0] - points[..., 0])
        angle += 2 * np.pi * np.round((turn - angle) / (2 * np.pi))
        return np.stack([radius * angle, -points[..., 1]], axis=-1)

    return mapping


def _dome_mapping(center: np.ndarray, radius: float) -> Mapping:
    """Azimuthal equidistant texture coordinates about the middle of the quarter sphere."""
    axis = np.array([0, 1, -1]) / np.sqrt(2)
    right, up = np.array([1.0, 0, 0]), np.array([0, 1, 1]) / np.sqrt(2)

    def mapping(points: np.ndarray) -> np.ndarray:
        d = points - center
        across = np.stack([d @ right, -(d @ up)], axis=-1)
        distance = np.linalg.norm(across, axis=-1, keepdims=True)
        angle = np.arctan2(distance, (d @ axis)[..., None])
        return 3.0 + radius * angle * across / np.maximum(distance, 1e-12)

    return mapping

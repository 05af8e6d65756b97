"""Buildings as one sheet of triangles, assembled from plane patches that meet without cracks.

A patch is a polygon with holes in space. Where patches meet, the corners of one become vertices of the other, and
every edge is divided in the same way for both, so that no vertex lies on another triangle's edge.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from demo_scenes.planar import lattice_inside, triangulate

UP = np.array([0.0, 1.0, 0.0])
# Texture coordinates (..., 2) in metres, right and down, of points (..., 3).
Mapping = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Patch:
    """A flat piece of the sheet.

    Attributes:
        loops: (k, 3) float each, metres: the outer border, then holes; in either sense of rotation.
        facing: (3,) float, roughly the outward normal.
        material: a name.
        mapping: texture coordinates; None takes metres in the patch's plane, courses level.
    """

    loops: list[np.ndarray]
    facing: np.ndarray
    material: str
    mapping: Mapping | None = None


@dataclass(frozen=True, eq=False)
class Sheet:
    """Triangles of a building.

    Attributes:
        vertices: (n, 3) float, metres.
        faces: (m, 3) int, counter-clockwise seen from outside.
        material_of_face: a name for each face.
        texture_metres: (m, 3, 2) float, metres: texture coordinates of the faces' corners.
    """

    vertices: np.ndarray
    faces: np.ndarray
    material_of_face: list[str]
    texture_metres: np.ndarray


@dataclass(eq=False)
class SheetBuilder:
    """Builder of a sheet from patches.

    Attributes:
        spacing: metres: target length of the triangles' edges.
    """

    spacing: float
    patches: list[Patch] = field(default_factory=list)

    def add(
        self,
        outline: Iterable,
        facing: Iterable[float],
        material: str,
        holes: Iterable[Iterable] = (),
        mapping: Mapping | None = None,
    ) -> None:
        """Add a polygon of (x, y, z) corners."""
        loops = [np.array(list(loop), float) for loop in (outline, *holes)]
        self.patches.append(Patch(loops, np.array(list(facing), float), material, mapping))

    def box_recess(
        self, x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], reveal: str, back: str
    ) -> list[tuple[float, float, float]]:
        """Add a recess from the wall at z[1] back to z[0]; returns its opening, the hole in the wall."""
        (x0, x1), (y0, y1), (z0, z1) = x, y, z
        self.rectangle((x0, x0), y, z, (1, 0, 0), reveal)
        self.rectangle((x1, x1), y, z, (-1, 0, 0), reveal)
        self.rectangle(x, (y0, y0), z, (0, 1, 0), reveal)
        self.rectangle(x, (y1, y1), z, (0, -1, 0), reveal)
        size = np.array([x1 - x0, y1 - y0])
        self.rectangle(x, y, (z0, z0), (0, 0, 1), back, lambda p: np.stack([p[..., 0] - x0, y1 - p[..., 1]], -1) / size)
        return [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)]

    def box_ledge(
        self, x: tuple[float, float], y: tuple[float, float], depth: float, material: str, wall: float = 0.0
    ) -> list[tuple[float, float, float]]:
        """Add a block that projects by `depth` from the wall at z = `wall`; returns its section, the hole in the wall."""
        z = (wall, wall + depth)
        self.rectangle(x, y, (z[1], z[1]), (0, 0, 1), material)
        self.rectangle(x, (y[0], y[0]), z, (0, -1, 0), material)
        self.rectangle(x, (y[1], y[1]), z, (0, 1, 0), material)
        self.rectangle((x[0], x[0]), y, z, (-1, 0, 0), material)
        self.rectangle((x[1], x[1]), y, z, (1, 0, 0), material)
        return [(x[0], y[0], wall), (x[1], y[0], wall), (x[1], y[1], wall), (x[0], y[1], wall)]

    def rectangle(
        self,
        x: tuple[float, float],
        y: tuple[float, float],
        z: tuple[float, float],
        facing: tuple[float, float, float],
        material: str,
        mapping: Mapping | None = None,
    ) -> None:
        """An axis-parallel rectangle: one of the three intervals is a single value."""
        if x[0] == x[1]:
            outline = [(x[0], y[0], z[0]), (x[0], y[1], z[0]), (x[0], y[1], z[1]), (x[0], y[0], z[1])]
        elif y[0] == y[1]:
            outline = [(x[0], y[0], z[0]), (x[1], y[0], z[0]), (x[1], y[0], z[1]), (x[0], y[0], z[1])]
        else:
            outline = [(x[0], y[0], z[0]), (x[1], y[0], z[0]), (x[1], y[1], z[0]), (x[0], y[1], z[0])]
        self.add(outline, facing, material, mapping=mapping)

    def build(self) -> Sheet:
        """Subdivide all edges, triangulate all patches and weld common vertices."""
        corners = np.unique(np.round(np.vstack([loop for patch in self.patches for loop in patch.loops]), 9), axis=0)
        index: dict[tuple[float, ...], int] = {}
        faces, materials, texture_metres = [], [], []
        for patch in self.patches:
            points, triangles = self._triangulated(patch, corners)
            ids = np.array([index.setdefault(tuple(p), len(index)) for p in np.round(points, 9).tolist()])
            faces.append(ids[triangles])
            materials += [patch.material] * len(triangles)
            mapping = patch.mapping or _level_mapping(patch.facing)
            texture_metres.append(mapping(points)[triangles])
        return Sheet(np.array(list(index)), np.vstack(faces), materials, np.concatenate(texture_metres))

    def _triangulated(self, patch: Patch, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (p, 3) and triangles (t, 3) of a patch."""
        right, up = plane_axes(patch.facing)
        divided = [self._divided(loop, corners) for loop in patch.loops]
        flat = [loop @ np.column_stack([right, up]) for loop in divided]
        for k, loop in enumerate(flat):
            x, y = loop.T
            is_ccw = (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() > 0
            if is_ccw != (k == 0):
                flat[k], divided[k] = loop[::-1], divided[k][::-1]
        added = lattice_inside(flat, self.spacing, 0.55 * self.spacing)
        normal = np.cross(right, up)
        height = divided[0][0] @ normal
        inside = added @ np.array([right, up]) + height * normal
        return np.vstack([*divided, inside]), triangulate(flat, added)

    def _divided(self, loop: np.ndarray, corners: np.ndarray) -> np.ndarray:
        """The loop with other patches' corners on its edges, each part then divided evenly."""
        points = []
        for a, b in zip(loop, np.roll(loop, -1, axis=0), strict=True):
            along = b - a
            t = (corners - a) @ along / (along @ along)
            off = np.linalg.norm(corners - a - t[:, None] * along, axis=1)
            stops = np.unique([0.0, *t[(off < 1e-6) & (t > 1e-6) & (t < 1 - 1e-6)], 1.0])
            for s, e in pairwise(stops):
                count = max(1, round((e - s) * np.linalg.norm(along) / self.spacing))
                points.append(a + (s + (e - s) * np.arange(count) / count)[:, None] * along)
        return np.vstack(points)


def plane_axes(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors right and up in the plane of that outward normal, as seen upright from outside."""
    normal = normal / np.linalg.norm(normal)
    right = np.cross(UP, normal) if abs(normal[1]) < 0.99 else np.array([1.0, 0, 0])
    right /= np.linalg.norm(right)
    return right, np.cross(normal, right)


def _level_mapping(facing: np.ndarray) -> Mapping:
    right, up = plane_axes(facing)
    return lambda points: np.stack([points @ right, -(points @ up)], axis=-1)

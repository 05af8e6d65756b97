"""Layout of the texture atlas: two faces of one size share a rectangle, rectangles are packed in rows.

Every face is a right triangle in the atlas. Its legs have as many texels as the face's two edges have pixels in the photos, so
a texel is about a photo pixel everywhere. Around each face a gutter continues its texture, so that filtering (and the first
mip levels) never reads a neighbour's texels.

Unwrapping connected faces into charts would save gutters and inner seams, but needs an additional library and mixes the
textures of faces that the engine treats separately.
"""

from dataclasses import dataclass

import numpy as np

SHORTEST_LEG = 4  # texels
STEPS_PER_OCTAVE = 4  # leg lengths are rounded up to these steps, so that faces of equal size can be paired
SLACK = 1.02  # factor by which the texture grows when its rows do not fit


@dataclass(frozen=True, eq=False)
class AtlasLayout:
    """A rectangle holds a face in its upper left half and, turned by 180 degrees, another in the lower right.

    Attributes:
        width, height: texels of the texture.
        gutter: texels around a face that continue its texture; towards the paired face about half of that.
        order: (m, 3) int: 0 to 2: the face's corners at the right angle, along the rectangle's width, and along its
            height.
        corner: (m, 2) int: column and row of the rectangle's first texel.
        legs: (m, 2) int: texels between the right angle and the corners along width and height.
        is_turned: (m,) bool: whether the face lies in the lower right half.
        scale: texels per photo pixel, at most 1; less if the faces do not fit at full resolution.
    """

    width: int
    height: int
    gutter: int
    order: np.ndarray
    corner: np.ndarray
    legs: np.ndarray
    is_turned: np.ndarray
    scale: float

    @classmethod
    def plan(cls, edge_lengths: np.ndarray, largest: int, gutter: int = 4) -> "AtlasLayout":
        """Pack faces into a texture.

        Args:
            edge_lengths: (m, 3) float, photo px: edge j lies between corners j and j + 1.
            largest: limit of width and height, texels.
            gutter: texels; less for small textures of many faces.

        Raises:
            ValueError: the faces do not fit even at the least size.
        """
        order, legs_px = _legs(np.asarray(edge_lengths, dtype=np.float64))
        scale = 1.0
        while True:
            legs = _rounded_up(legs_px * scale)
            size, corner, is_turned = pack_in_pairs(legs + 3 * gutter + 1)
            if size.max() <= largest:
                return cls(int(size[0]), int(size[1]), gutter, order, corner, legs, is_turned, scale)
            if (legs <= SHORTEST_LEG).all():
                raise ValueError(f"{len(legs)} faces do not fit into a texture of {largest} texels")
            scale *= min(0.97, largest / size.max())

    @staticmethod
    def most_faces(largest: int, gutter: int = 4) -> int:
        """Number of faces of the least size that fit into a texture of at most `largest` texels in width and height."""
        return 2 * (largest // (SHORTEST_LEG + 3 * gutter + 1)) ** 2

    @property
    def box(self) -> np.ndarray:
        """(m, 2) int: width and height of each face's rectangle, texels."""
        return self.legs + 3 * self.gutter + 1

    @property
    def uv(self) -> np.ndarray:
        """(m, 3, 2) float: texture coordinates of each face's corners 0, 1, 2; 0 to 1, origin at the top left."""
        local = np.full((len(self.legs), 3, 2), float(self.gutter))
        local[:, 1, 0] += self.legs[:, 0]
        local[:, 2, 1] += self.legs[:, 1]
        local = np.where(self.is_turned[:, None, None], self.box[:, None] - 1 - local, local)
        placed = (self.corner[:, None] + local + 0.5) / (self.width, self.height)
        uv = np.empty_like(placed)
        np.put_along_axis(uv, self.order[..., None], placed, axis=1)
        return uv


def _legs(edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (m, 3) in the order right angle, end of the longer leg, of the shorter; and the legs' lengths (m, 2).

    The right angle goes to the corner opposite the longest edge, which distorts the triangle least.
    """
    apex = (edges.argmax(axis=1) + 2) % 3
    faces = np.arange(len(edges))
    to_next, to_previous = edges[faces, apex], edges[faces, (apex + 2) % 3]
    swap = to_previous > to_next
    first = np.where(swap, (apex + 2) % 3, (apex + 1) % 3)
    second = np.where(swap, (apex + 1) % 3, (apex + 2) % 3)
    order = np.column_stack([apex, first, second])
    return order, np.column_stack([np.maximum(to_next, to_previous), np.minimum(to_next, to_previous)])


def _rounded_up(lengths: np.ndarray) -> np.ndarray:
    steps = np.ceil(STEPS_PER_OCTAVE * np.log2(np.maximum(lengths, SHORTEST_LEG) / SHORTEST_LEG) - 1e-9)
    return np.ceil(SHORTEST_LEG * 2 ** (steps / STEPS_PER_OCTAVE) - 1e-9).astype(np.int64)


def pack_in_pairs(boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pack rectangles that two faces of the same size share: width and height (2,) of the texture, about square; first texel (m, 2)
    of each face's rectangle; which faces are turned by 180 degrees (m,).

    Args:
        boxes: (m, 2) int: width and height of each face's rectangle, texels; m at least 1.
    """
    faces = np.lexsort((np.arange(len(boxes)), -boxes[:, 0], -boxes[:, 1]))
    ordered = boxes[faces]
    starts = np.r_[True, (ordered[1:] != ordered[:-1]).any(axis=1)]
    rank = np.arange(len(boxes)) - np.maximum.accumulate(np.where(starts, np.arange(len(boxes)), 0))
    turned = rank % 2 == 1
    box_of = np.cumsum(~turned) - 1
    shared = ordered[~turned]
    side = max(float(np.sqrt(shared.prod(axis=1).sum())), float(shared[:, 0].max()))
    while True:
        width = int(np.ceil(side))
        places, height = _rows(shared.tolist(), width)
        if height <= side * SLACK:
            break
        side *= SLACK
    corner, is_turned = np.empty((len(boxes), 2), dtype=np.int64), np.empty(len(boxes), dtype=bool)
    corner[faces], is_turned[faces] = np.array(places, dtype=np.int64)[box_of], turned
    return np.array([width, height]), corner, is_turned


def _rows(boxes: list[list[int]], width: int) -> tuple[list[tuple[int, int]], int]:
    """Rectangles, tallest first, packed in rows of a width: their first texels, and the height of all rows."""
    places, x, y, row = [], 0, 0, 0
    for w, h in boxes:
        if x + w > width:
            x, y, row = 0, y + row, 0
        row = max(row, h)
        places.append((x, y))
        x += w
    return places, y + row

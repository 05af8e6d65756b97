"""Locks: vertices locked by number, at the boundary, inside boxes, or outside the region of interest."""

import numpy as np

from fairing.errors import InputError
from fairing.options import FairingOptions
from fairing.scene import Scene


def locked_by_options(scene: Scene, options: FairingOptions) -> np.ndarray:
    """(n,) bool: the vertices that the options lock, by their positions at the start.

    Raises:
        InputError: a number that is no vertex of the input, or a region without vertices.
    """
    vertices = scene.mesh.vertices
    locked = inside_boxes(vertices, options.locked_boxes)
    chosen = np.asarray(options.locked_vertices, dtype=np.int64)
    count = len(scene.original_from_welded)
    if len(chosen) and (chosen.min() < 0 or chosen.max() >= count):
        wrong = int(chosen[(chosen < 0) | (chosen >= count)][0])
        raise InputError(f"locked_vertices: expected numbers 0 to {count - 1}, found {wrong}")
    locked[scene.original_from_welded[chosen]] = True
    if options.lock_boundary:
        locked[scene.connected_mesh.boundary_vertices] = True
    if options.region:
        inside = inside_boxes(vertices, options.region)
        if not inside.any():
            low, high = vertices.min(axis=0), vertices.max(axis=0)
            raise InputError(
                f"region: expected a box that holds vertices of the mesh, found none in {_plain(options.region)}; the "
                f"mesh reaches from {_plain(low)} to {_plain(high)}"
            )
        locked |= ~inside
    return locked


def inside_boxes(points: np.ndarray, boxes: tuple[float, ...]) -> np.ndarray:
    """(n,) bool: points (n, 3) float inside or on any of the boxes, x0 y0 z0 x1 y1 z1 each, world units."""
    inside = np.zeros(len(points), dtype=bool)
    for box in np.reshape(np.asarray(boxes, dtype=np.float64), (-1, 2, 3)):
        inside |= ((points >= box[0]) & (points <= box[1])).all(axis=1)
    return inside


def _plain(numbers: object) -> str:
    return " ".join(f"{number:g}" for number in np.asarray(numbers, dtype=np.float64).tolist())

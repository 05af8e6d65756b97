"""The object of a capture: a box around the points that most photos look at, without ground and background.

Only where the cameras go around it: photos of a facade or from the middle of a courtyard have no such object.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from fairing.geometry.up_direction import up_direction
from fairing.scene import BoxCorners, SparsePoints, View

IN_SIGHT = 0.6
"""A point is looked at if so many of the photos have it inside their frame, hidden or not."""
MOST_ALIGNED = 0.7
"""Cameras go around an object if the mean of the unit vectors from it to them is shorter: they spread over an arc of more than
160 degrees."""
WIDEST_MISS = np.radians(20)
"""... if four fifths of the optical axes miss its middle by less than this angle, ..."""
LEAST_SHARE = 0.3
"""... and if it has so many of the observations: in the middle of a courtyard there is nothing."""
QUANTILE, MARGIN = 0.01, 0.03
"""Points beyond these quantiles along each axis do not widen the box; its sides are moved outwards by this part of it."""
MIN_POINTS = 50
"""Fewer points make no object."""
# The ground: a plane across the up direction with so many of the points, which reaches beyond the object by this factor and has
# hardly any of the object's points below it. Distances are in diagonals of the box.
_TILT = np.cos(np.radians(20))
_GROUND_SHARE, _BEYOND, _BELOW = 0.03, 1.2, 0.1
_NEAR, _CLEARANCE, _DEVIATIONS, _TRIALS = 0.01, 0.002, 4.0, 1000
_ITERATIONS = 30


@dataclass(frozen=True, eq=False)
class ObjectBox:
    """A box whose points are triangulated.

    Attributes:
        axes: (3, 3) float: unit vectors of its sides as rows; the last is up where the box was found.
        low, high: (3,) float, world units: its ends along them.
        n_points: number of sparse points in it.
        orbited: whether the cameras go around it, so that it is the object of the capture; False of a chosen box.
        reason: why it is used, or why it is not the object, in words.
    """

    axes: np.ndarray
    low: np.ndarray
    high: np.ndarray
    n_points: int
    orbited: bool
    reason: str

    @property
    def middle(self) -> np.ndarray:
        """(3,) float, world units."""
        return (self.low + self.high) / 2 @ self.axes

    @property
    def size(self) -> np.ndarray:
        """(3,) float, world units: lengths of its sides."""
        return self.high - self.low

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) float each, world units: the smallest and largest coordinates in it along the axes of the world."""
        ends = self.edges().reshape(-1, 3)
        return ends.min(axis=0), ends.max(axis=0)

    def edges(self) -> np.ndarray:
        """(12, 2, 3) float, world units: the ends of its edges."""
        low, high = self.low, self.high
        corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        pairs = [(i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit]
        return corners[np.array(pairs)] @ self.axes

    def contains(self, points: np.ndarray) -> np.ndarray:
        """(n,) bool for points (n, 3)."""
        along = points @ self.axes.T
        return np.all((along >= self.low) & (along <= self.high), axis=1)


def box_of_corners(corners: BoxCorners) -> ObjectBox:
    """The box with these corners, whose points are not counted."""
    return ObjectBox(np.eye(3), np.array(corners[:3]), np.array(corners[3:]), 0, False, "it was chosen")


def find_object(views: Sequence[View], points: SparsePoints) -> ObjectBox | None:
    """The box around what most photos look at; None if hardly any points are."""
    positions = points.positions
    centers = np.array([view.camera.center for view in views])
    rotations = np.array([view.camera.camera_from_world[:, :3] for view in views])
    middle, miss = _crossing(centers, rotations[:, 2])
    looked_at = _share_in_sight(views, positions) >= IN_SIGHT
    if looked_at.sum() < MIN_POINTS:
        return None
    up = up_direction(rotations)
    ground = _ground(positions, looked_at, up)
    if ground is not None:
        normal, height, thickness = ground
        above = looked_at & (positions @ normal > height + thickness)
        if above.sum() >= MIN_POINTS:
            up, looked_at = normal, above
        else:
            ground = None
    axes = _axes(positions[looked_at], up)
    along = positions[looked_at] @ axes.T
    low, high = np.quantile(along, (QUANTILE, 1 - QUANTILE), axis=0)
    margin = MARGIN * (high - low).max()
    low, high = low - margin, high + margin
    if ground is not None:
        low[2] = max(low[2], ground[1] + ground[2])
    box = ObjectBox(axes, low, high, 0, False, "")
    inside = box.contains(positions)
    share = float(inside[points.observations[:, 0]].mean())
    towards = centers - middle
    spread = float(np.linalg.norm((towards / np.linalg.norm(towards, axis=1, keepdims=True)).mean(axis=0)))
    reason = _reason(spread, float(np.quantile(miss, 0.8)), share)
    return replace(box, n_points=int(inside.sum()), orbited=not reason, reason=reason or "the cameras go around it")


def _reason(spread: float, miss: float, share: float) -> str:
    """Why cameras do not go around an object; empty if they do."""
    if spread >= MOST_ALIGNED:
        return "the cameras look from one side"
    if miss >= WIDEST_MISS:
        return "the cameras look at no common place"
    if share < LEAST_SHARE:
        return f"only {share:.0%} of the observations are of what most photos look at"
    return ""


def _crossing(centers: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The point (3,) nearest to most optical axes, and the angle (V,) by which each misses it (pi for one behind the camera).

    Reweighted least squares of the distances, with Geman-McClure weights of the angles.
    """
    across = np.eye(3) - axes[:, :, None] * axes[:, None]
    weight = np.ones(len(centers))
    point, angle = centers.mean(axis=0), np.zeros(len(centers))
    for _ in range(_ITERATIONS):
        H = np.einsum("n,nij->ij", weight, across)
        g = np.einsum("n,nij,nj->i", weight, across, centers)
        point = np.linalg.solve(H + 1e-9 * np.trace(H) * np.eye(3), g + 1e-9 * np.trace(H) * centers.mean(axis=0))
        towards = point - centers
        distance = np.maximum(np.linalg.norm(towards, axis=1), 1e-12)
        angle = np.arccos(np.clip((towards * axes).sum(axis=1) / distance, -1, 1))
        weight = 1 / (1 + (angle / (WIDEST_MISS / 2)) ** 2) ** 2 / distance**2
    return point, angle


def _share_in_sight(views: Sequence[View], positions: np.ndarray) -> np.ndarray:
    """(n,) float: the part of the photos that have each point inside their frame."""
    count = np.zeros(len(positions))
    for view in views:
        uv, depth = view.camera.project(positions)
        with np.errstate(invalid="ignore"):
            size = (view.camera.width - 0.5, view.camera.height - 0.5)
            count += ((uv > -0.5) & (uv < size)).all(axis=1) & (depth > 0)
    return count / len(views)


def _ground(positions: np.ndarray, looked_at: np.ndarray, up: np.ndarray) -> tuple[np.ndarray, float, float] | None:
    """The ground under the points that are looked at: its normal (3,), height along it and thickness; None without one."""
    low, high = np.quantile(positions[looked_at], (QUANTILE, 1 - QUANTILE), axis=0)
    middle, diagonal = (low + high) / 2, float(np.linalg.norm(high - low))
    # Farther points lie on other planes, or on the ground where it bends.
    near = np.flatnonzero(np.linalg.norm(positions - middle, axis=1) < 1.5 * diagonal)
    reach = _NEAR * diagonal
    rng = np.random.default_rng(0)
    best, most = None, 0
    for _ in range(_TRIALS):
        a, b, c = positions[rng.choice(near, 3)]
        normal = np.cross(b - a, c - a)
        length = float(np.linalg.norm(normal))
        if length == 0:
            continue
        normal *= np.sign(normal @ up) / length
        if normal @ up < _TILT:
            continue
        count = int((np.abs((positions[near] - a) @ normal) < reach).sum())
        if count > most:
            best, most = (normal, float(a @ normal)), count
    if best is None or most < max(_GROUND_SHARE * len(positions), MIN_POINTS):
        return None
    normal, height = best
    on_it = near[np.abs(positions[near] @ normal - height) < reach]
    centroid = positions[on_it].mean(axis=0)
    fitted = np.linalg.svd(positions[on_it] - centroid, full_matrices=False)[2][2]
    normal = fitted * (np.sign(fitted @ normal) or 1.0)
    height = float(centroid @ normal)
    deviation = 1.4826 * float(np.median(np.abs(positions[on_it] @ normal - height)))
    thickness = _DEVIATIONS * deviation + _CLEARANCE * diagonal
    heights = positions[looked_at] @ normal - height
    apart = np.abs(heights) > thickness
    if apart.sum() < MIN_POINTS or (heights[apart] < 0).mean() > _BELOW:
        return None
    standing = positions[looked_at][heights > thickness]
    if len(standing) < MIN_POINTS:
        return None
    axes = _axes(standing, normal)[:2]
    inner = np.ptp(np.quantile(standing @ axes.T, (QUANTILE, 1 - QUANTILE), axis=0), axis=0)
    outer = np.ptp(np.quantile(positions[on_it] @ axes.T, (QUANTILE, 1 - QUANTILE), axis=0), axis=0)
    return (normal, height, thickness) if (outer > _BEYOND * inner).all() else None


def _axes(positions: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(3, 3) float: axes of the narrowest rectangle around points, seen from above, and the up direction, as rows."""
    side = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    side /= np.linalg.norm(side)
    level = np.stack([side, np.cross(up, side)])
    seen = positions @ level.T
    low, high = np.quantile(seen, (QUANTILE, 1 - QUANTILE), axis=0)
    seen = seen[((seen >= low) & (seen <= high)).all(axis=1)]
    angle = np.radians(cv2.minAreaRect(seen.astype(np.float32))[2])
    first = np.cos(angle) * level[0] + np.sin(angle) * level[1]
    return np.stack([first, np.cross(up, first), up])

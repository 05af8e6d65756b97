"""Scan registration: the similarity from a scan to the frame of the photos, by matched points, then by closest points.

A scan has its own frame and often its own unit; a similarity x -> s R x + t maps it to the world.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import trimesh
from scipy.optimize import least_squares
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from fairing.errors import InputError
from fairing.geometry.closest_point import SurfaceTree
from fairing.geometry.normals import unit_normals
from fairing.geometry.triangles import closest_on_triangles
from fairing.mesh import Mesh
from fairing.scene import View

FEWEST_MATCHES = 3
OUTLIER_PX = 3.0  # pixels: larger errors of an observation lose influence
NEIGHBOURS = 12  # number of neighbours that a point cloud's normal is fitted to
KEPT = 0.8  # fraction of the pairs used in each round, the nearest ones; the rest may be seen by one side only
MAX_ROUNDS = 60
WEAK = 0.05  # fraction of the largest singular value; below it the scale of the matches is kept
LARGEST_ERROR = 1e50  # px: its fourth power, which the solver computes, is finite
CONVERGED = 1e-7  # fraction of the diagonal: largest movement of the scan in the last round


@dataclass(frozen=True, eq=False)
class Similarity:
    """x -> scale * rotation @ x + translation.

    Attributes:
        scale: world units per unit of the scan.
        rotation: (3, 3) float.
        translation: (3,) float, world units.
    """

    scale: float
    rotation: np.ndarray
    translation: np.ndarray

    def apply(self, points: np.ndarray) -> np.ndarray:
        """World positions (n, 3) float from positions (n, 3) float in the scan."""
        return self.scale * points @ self.rotation.T + self.translation

    def undo(self, points: np.ndarray) -> np.ndarray:
        """Positions (n, 3) float in the scan from world positions (n, 3) float."""
        return (points - self.translation) @ self.rotation / self.scale


@dataclass(frozen=True, eq=False)
class Match:
    """A point of the scan with its world position or its pixels in photos.

    Attributes:
        point: (3,) float, in the scan's frame and unit.
        world: (3,) float, world units, or None.
        sightings: (view id, (2,) float pixels) for each photo that observes the point.
    """

    point: np.ndarray
    world: np.ndarray | None = None
    sightings: tuple[tuple[int, np.ndarray], ...] = ()


@dataclass(frozen=True, eq=False)
class Registered:
    """A similarity and its residuals.

    Attributes:
        world_from_scan: the fitted similarity.
        errors: (n,) float: errors of the matches in pixels (for a world point in the photo nearest to it), or of
            closest points in world units.
    """

    world_from_scan: Similarity
    errors: np.ndarray


def register_matches(matches: Sequence[Match], views: Sequence[View]) -> Registered:
    """The similarity that maps the scan's points to their world positions and observed pixels.

    Minimizes the Cauchy loss of all errors in pixels (ledger: loss of matches). The initial value is the closed form
    (Umeyama 1991) for points whose world position is given or triangulated from two photos; with fewer than three such
    points it is the pose from one photo (PnP), where the scan's unit is assumed to be the world's.

    Raises:
        InputError: there are fewer than three matches, they are collinear, or they do not determine an initial value.
    """
    if len(matches) < FEWEST_MATCHES:
        raise InputError(
            f"registration: expected at least {FEWEST_MATCHES} matches, found {len(matches)}; match more points"
        )
    points = np.array([match.point for match in matches], dtype=np.float64)
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spread[1] < 1e-6 * spread[0]:
        raise InputError("registration: the matched points lie on one line; match points that span the scene")
    start = _first_guess(matches, views)
    centers = np.array([view.camera.center for view in views])
    focal = np.array([view.camera.K[0, 0] for view in views])

    def errors(parameters: np.ndarray) -> np.ndarray:
        found = _similarity(parameters, start, points).apply(points)
        result = []
        for match, position in zip(matches, found, strict=True):
            if match.world is not None:
                distance = np.linalg.norm(centers - match.world, axis=1)
                result.extend((focal / distance).max() * (position - match.world))
            for view, pixel in match.sightings:
                result.extend(views[view].camera.project(position)[0] - pixel)
        finite = np.nan_to_num(np.array(result), nan=1e6, posinf=1e6, neginf=-1e6)
        return np.clip(finite, -LARGEST_ERROR, LARGEST_ERROR)

    fitted = least_squares(errors, np.zeros(7), loss="cauchy", f_scale=OUTLIER_PX, x_scale="jac")
    each = _norms_by_match(errors(fitted.x), matches)
    return Registered(_similarity(fitted.x, start, points), each)


def refine_by_closest_points(scan: Mesh | np.ndarray, start: Similarity, targets: np.ndarray) -> Registered:
    """Iterative closest points, point to plane (Chen and Medioni 1992), trimmed to the nearest 80 % (Chetverikov 2002).

    Args:
        scan: a surface, or points (n, 3) float.
        start: initial similarity from `register_matches`, within the basin of attraction.
        targets: (p, 3) float, world units: points on the surface, for example a capture's sparse points.

    Returns:
        The similarity of the round with the smallest median distance, which never exceeds that of `start`.

    Raises:
        InputError: fewer than ten targets.
    """
    if len(targets) < 10:
        raise InputError(f"registration: expected at least 10 points to fit the scan to, found {len(targets)}")
    closest = _closest_on(scan)
    positions = scan.vertices if isinstance(scan, Mesh) else scan
    probes = positions[:: max(1, len(positions) // 500)]
    reach = float(np.linalg.norm(np.ptp(start.apply(positions), axis=0)))
    current = best = start
    best_errors: np.ndarray | None = None
    for _ in range(MAX_ROUNDS):
        q, normals = closest(current.undo(targets))
        found, normals = current.apply(q), normals @ current.rotation.T
        distance = np.linalg.norm(found - targets, axis=1)
        if best_errors is None or np.median(distance) < np.median(best_errors):
            best, best_errors = current, distance
        kept = distance <= np.quantile(distance, KEPT)
        moved = _point_to_plane(found[kept], targets[kept], normals[kept], current)
        shift = np.abs(moved.apply(probes) - current.apply(probes)).max()
        current = moved
        if shift < CONVERGED * reach:
            break
    assert best_errors is not None
    return Registered(best, best_errors)


def _first_guess(matches: Sequence[Match], views: Sequence[View]) -> Similarity:
    known = [(match.point, _world_of(match, views)) for match in matches]
    pairs = [(point, world) for point, world in known if world is not None]
    if len(pairs) >= FEWEST_MATCHES:
        scan, world = (np.array(side) for side in zip(*pairs, strict=True))
        matrix = trimesh.registration.procrustes(scan, world, reflection=False)[0]
        scale = float(np.cbrt(np.linalg.det(matrix[:3, :3])))
        return Similarity(scale, matrix[:3, :3] / scale, matrix[:3, 3])
    sightings: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for match in matches:
        for view, pixel in match.sightings:
            sightings.setdefault(view, []).append((match.point, pixel))
    view, seen = max(sightings.items(), key=lambda item: len(item[1]), default=(0, []))
    if len(seen) < 4:
        raise InputError(
            "registration: expected three points known in the world or in two photos each, or four in one photo, "
            f"found {len(pairs)} and {len(seen)}; match more points"
        )
    camera = views[view].camera
    scan, pixels = (np.array(side, dtype=np.float64) for side in zip(*seen, strict=True))
    # SQPNP has absolute tolerances, so its points have a spread of 1.
    middle, spread = _middle_and_spread(scan)
    unit_points = (scan - middle) / (spread or 1.0)
    found, turn, shift = cv2.solvePnP(unit_points, pixels, camera.K, None, flags=cv2.SOLVEPNP_SQPNP)
    if not found:
        raise InputError(f"registration: photo {views[view].name} gives no pose; check its matches")
    R, t = camera.camera_from_world[:, :3], camera.camera_from_world[:, 3]
    rotation = R.T @ cv2.Rodrigues(turn)[0]
    return Similarity(1.0, rotation, R.T @ (spread * shift[:, 0] - t) - rotation @ middle)


def _world_of(match: Match, views: Sequence[View]) -> np.ndarray | None:
    """The match's world position: given, or triangulated from two or more photos; else None."""
    if match.world is not None:
        return match.world
    if len(match.sightings) < 2:
        return None
    rows = []
    for view, (x, y) in match.sightings:
        P = views[view].camera.image_from_world
        rows += [x * P[2] - P[0], y * P[2] - P[1]]
    homogeneous = np.linalg.svd(np.array(rows) / np.linalg.norm(rows, axis=1, keepdims=True))[2][-1]
    return homogeneous[:3] / homogeneous[3]


def _similarity(parameters: np.ndarray, start: Similarity, points: np.ndarray) -> Similarity:
    """The similarity changed about the middle of the scan's points (n, 3), so that neither its unit nor its origin matters.

    Args:
        parameters: (7,) float: a rotation vector, a translation in units of the points' spread, and a log scale.
    """
    middle, spread = _middle_and_spread(points)
    rotation = Rotation.from_rotvec(parameters[:3]).as_matrix() @ start.rotation
    scale = start.scale * float(np.exp(parameters[6]))
    moved = start.apply(middle) + start.scale * spread * parameters[3:6]
    return Similarity(scale, rotation, moved - scale * rotation @ middle)


def _middle_and_spread(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Mean (3,) of points (n, 3) and the root mean square of their distances from it."""
    middle = points.mean(axis=0)
    return middle, float(np.sqrt(((points - middle) ** 2).sum(axis=1).mean()))


def _norms_by_match(errors: np.ndarray, matches: Sequence[Match]) -> np.ndarray:
    """(n,) float: the largest error of each match, pixels."""
    result, at = [], 0
    for match in matches:
        sizes = ([3] if match.world is not None else []) + [2] * len(match.sightings)
        each = []
        for size in sizes:
            each.append(float(np.linalg.norm(errors[at : at + size])))
            at += size
        result.append(max(each, default=0.0))
    return np.array(result)


def _closest_on(scan: Mesh | np.ndarray):
    """A function from points (p, 3) to the closest points (p, 3) of the scan and the unit normals (p, 3) there."""
    if isinstance(scan, Mesh):
        tree = SurfaceTree(scan)
        triangles = scan.vertices[scan.faces]
        normals, _ = unit_normals(scan.vertices, scan.faces)

        def on_surface(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            face = tree.closest(points)[1]
            return closest_on_triangles(triangles[face], points), normals[face]

        return on_surface
    tree = KDTree(scan)
    normals, _ = normals_and_variation(scan, tree)

    def on_cloud(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        nearest = tree.query(points)[1]
        return scan[nearest], normals[nearest]

    return on_cloud


def normals_and_variation(points: np.ndarray, tree: KDTree) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals and surface variation of a point cloud (Pauly et al. 2002).

    Both follow from the covariance of each point's nearest neighbours: the direction of the smallest variance, and its
    fraction of the total variance.

    Args:
        points: (n, 3) float, world units.
        tree: of these points.

    Returns:
        (n, 3) float unit normals, of either sign; (n,) float surface variation, 0 to 1/3.
    """
    neighbours = tree.query(points, k=min(NEIGHBOURS, len(points)))[1]
    around = points[neighbours] - points[neighbours].mean(axis=1, keepdims=True)
    values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))
    return vectors[:, :, 0], np.clip(values[:, 0], 0, None) / np.maximum(values.sum(axis=1), 1e-300)


def _point_to_plane(found: np.ndarray, targets: np.ndarray, normals: np.ndarray, current: Similarity) -> Similarity:
    """The similarity after one linearised step that moves `found` onto the planes through `targets`."""
    middle, size = _middle_and_spread(found)
    arm = (found - middle) / size
    J = np.column_stack([np.cross(arm, normals), normals, (arm * normals).sum(axis=1)])
    residual = ((found - targets) * normals).sum(axis=1) / size
    # Three planes that meet in a corner fit at any scale, so the scale is kept. One plane leaves sliding and turning free.
    values = np.linalg.svd(J, compute_uv=False)
    free = 7 if values[-1] > WEAK * values[0] else 6
    step = np.zeros(7)
    step[:free] = np.linalg.lstsq(J[:, :free], -residual, rcond=1e-4)[0]
    turn, grow = Rotation.from_rotvec(step[:3]).as_matrix(), float(np.exp(step[6]))
    shift = middle + size * step[3:6]
    return Similarity(
        grow * current.scale,
        turn @ current.rotation,
        grow * turn @ (current.translation - middle) + shift,
    )

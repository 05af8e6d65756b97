"""Range data brought into the frame of the photos: first by points that somebody matched, then by closest points.

A scan has a frame, and often a unit, of its own; what takes it to the world is a similarity x -> s R x + t.
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
from fairing.mesh import Mesh
from fairing.scene import View

FEWEST_MATCHES = 3
OUTLIER_PX = 3.0  # of a sighting's error: from which on it loses influence
NEIGHBOURS = 12  # points that a normal of a point cloud is fitted to
KEPT = 0.8  # of the pairs in each round, the nearest: the rest is taken for what only one side saw
MAX_ROUNDS = 60
WEAK = 0.05  # of the strongest singular value: a scale held more weakly stays as the matches gave it
CONVERGED = 1e-7  # of the diagonal: movement of the scan in a round


@dataclass(frozen=True, eq=False)
class Similarity:
    """x -> scale * rotation @ x + translation.

    Attributes:
        scale: world units of a unit of the scan.
        rotation: (3, 3) float.
        translation: (3,) float, world units.
    """

    scale: float
    rotation: np.ndarray
    translation: np.ndarray

    def apply(self, points: np.ndarray) -> np.ndarray:
        """World positions (n, 3) of the scan's positions (n, 3)."""
        return self.scale * points @ self.rotation.T + self.translation

    def undo(self, points: np.ndarray) -> np.ndarray:
        """The scan's positions (n, 3) of world positions (n, 3)."""
        return (points - self.translation) @ self.rotation / self.scale


@dataclass(frozen=True, eq=False)
class Match:
    """A point of the scan that somebody knows elsewhere.

    Attributes:
        point: (3,) float, in the scan.
        world: (3,) float, world units, or None.
        sightings: (view id, (2,) pixels) of photos that show it.
    """

    point: np.ndarray
    world: np.ndarray | None = None
    sightings: tuple[tuple[int, np.ndarray], ...] = ()


@dataclass(frozen=True, eq=False)
class Registered:
    """A similarity and how well it fits.

    Attributes:
        world_from_scan: what was found.
        errors: (n,) float: of the matches in pixels (a world point's error as the nearest photo would see it), or of
            closest points in world units.
    """

    world_from_scan: Similarity
    errors: np.ndarray


def register_matches(matches: Sequence[Match], views: Sequence[View]) -> Registered:
    """The similarity that brings the scan's points to their world points and to the pixels that show them.

    Cauchy's norm over all errors in pixels (Huber's lets one wrong match of twelve shift the scan), begun at the closed
    form (Umeyama 1991) of the points whose world position is given or follows from two photos; with fewer than three of
    them at the pose from one photo (PnP, the scan's unit then taken for the world's).

    Raises:
        InputError: fewer than three matches, matches on one line, or too little to begin with.
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
        found = _similarity(parameters, start).apply(points)
        result = []
        for match, position in zip(matches, found, strict=True):
            if match.world is not None:
                distance = np.linalg.norm(centers - match.world, axis=1)
                result.extend((focal / distance).max() * (position - match.world))
            for view, pixel in match.sightings:
                result.extend(views[view].camera.project(position)[0] - pixel)
        return np.nan_to_num(np.array(result), nan=1e6, posinf=1e6, neginf=-1e6)

    fitted = least_squares(errors, np.zeros(7), loss="cauchy", f_scale=OUTLIER_PX, x_scale="jac")
    each = _norms_by_match(errors(fitted.x), matches)
    return Registered(_similarity(fitted.x, start), each)


def refine_by_closest_points(scan: Mesh | np.ndarray, start: Similarity, targets: np.ndarray) -> Registered:
    """Iterated closest points (Chen and Medioni 1992, point to plane; Chetverikov 2002, the nearest 80 % count).

    Args:
        scan: a surface, or points (n, 3).
        start: from `register_matches`; must be within the basin, as always with closest points.
        targets: (p, 3) float, world units: points known of the surface, for example a capture's sparse points.

    Returns:
        The similarity after the round that fitted best; never one whose median distance exceeds the start's.

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
    found, turn, shift = cv2.solvePnP(scan, pixels, camera.K, None, flags=cv2.SOLVEPNP_SQPNP)
    if not found:
        raise InputError(f"registration: photo {views[view].name} gives no pose; check its matches")
    R, t = camera.camera_from_world[:, :3], camera.camera_from_world[:, 3]
    return Similarity(1.0, R.T @ cv2.Rodrigues(turn)[0], R.T @ (shift[:, 0] - t))


def _world_of(match: Match, views: Sequence[View]) -> np.ndarray | None:
    """The match's position in the world: as given, or where the lines of sight of two or more photos meet."""
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


def _similarity(parameters: np.ndarray, start: Similarity) -> Similarity:
    """Turn (3), shift (3, in units of the start's translation in the scan) and log scale (1) on top of a similarity."""
    turn = Rotation.from_rotvec(parameters[:3]).as_matrix()
    scale = start.scale * float(np.exp(parameters[6]))
    return Similarity(scale, turn @ start.rotation, start.translation + start.scale * parameters[3:6])


def _norms_by_match(errors: np.ndarray, matches: Sequence[Match]) -> np.ndarray:
    """(n,) float: the largest error of each match, px."""
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
    """A function from points (p, 3) to the scan's nearest points (p, 3) and the unit normals there (p, 3)."""
    if isinstance(scan, Mesh):
        tree = SurfaceTree(scan)
        triangles = scan.vertices[scan.faces]
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)

        def on_surface(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            face = tree.closest(points)[1]
            return trimesh.triangles.closest_point(triangles[face], points), normals[face]

        return on_surface
    tree = KDTree(scan)
    normals, _ = normals_and_variation(scan, tree)

    def on_cloud(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        nearest = tree.query(points)[1]
        return scan[nearest], normals[nearest]

    return on_cloud


def normals_and_variation(points: np.ndarray, tree: KDTree) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals (n, 3) of a point cloud and its surface variation (n,), 0 in a plane to 1/3 (Pauly et al. 2002).

    From the covariance of each point's nearest neighbours: the direction of least spread, and its share of the spread.
    """
    neighbours = tree.query(points, k=min(NEIGHBOURS, len(points)))[1]
    around = points[neighbours] - points[neighbours].mean(axis=1, keepdims=True)
    values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))
    return vectors[:, :, 0], np.clip(values[:, 0], 0, None) / np.maximum(values.sum(axis=1), 1e-300)


def _point_to_plane(found: np.ndarray, targets: np.ndarray, normals: np.ndarray, current: Similarity) -> Similarity:
    """The similarity after the linearised step that brings `found` onto the planes through `targets`."""
    middle = found.mean(axis=0)
    size = float(np.sqrt(((found - middle) ** 2).sum(axis=1).mean()))
    arm = (found - middle) / size
    J = np.column_stack([np.cross(arm, normals), normals, (arm * normals).sum(axis=1)])
    residual = ((found - targets) * normals).sum(axis=1) / size
    # Three planes that meet in a corner fit at any size: then the scale stays. A plane leaves sliding and turning free.
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

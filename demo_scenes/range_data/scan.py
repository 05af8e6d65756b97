"""Simulated laser scan of the facade: three stations, noise, its own frame and unit, and a few matches with photos.

The scanner's rays form a regular grid and miss the corners, as in the paper's start data.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from demo_scenes.noise import seeded
from demo_scenes.photography import looking_at
from demo_scenes.start import observed_points
from fairing.camera import Camera
from fairing.geometry.rasterize import rasterize
from fairing.mesh import Mesh
from fairing.registration.alignment import Similarity
from fairing.scene import Scene, SparsePoints

STATIONS = ((-8.0, 1.7, 11.0), (0.5, 1.7, 14.0), (8.5, 1.7, 10.5))  # metres, in front of the facade
AIM = (0.0, 5.0, 0.0)
GRID = (360, 300)  # rays of a station
RAYS_PER_RADIAN = 260.0
RANGE_NOISE = 0.003  # metres
MATCHES = 8
CLICKED_IN = 3  # photos of a match
POINTS, POINT_ERROR = 4000, 0.0005  # sparse points drawn, and their error as a fraction of the diagonal
# Scan: millimetres, z up; an arbitrary rotation and translation.
WORLD_FROM_SCAN = Similarity(
    0.001, Rotation.from_euler("xyz", [-87.0, 4.0, 31.0], degrees=True).as_matrix(), np.array([3.1, -0.8, 6.4])
)


@dataclass(frozen=True, eq=False)
class ScannedDemo:
    """A scan and the data needed to register it.

    Attributes:
        scan: (n, 3) float: points in the scan's frame, millimetres.
        matches: lines of a file of matches: a point of the scan and the pixels at which photos show it.
        sparse_points: of a reconstruction from the photos.
    """

    scan: np.ndarray
    matches: tuple[str, ...]
    sparse_points: SparsePoints


def scan_of(scene: Scene) -> ScannedDemo:
    """The scan of a demo scene as large as the facade, with its true surface known; always the same."""
    assert scene.truth is not None
    truth, rng = scene.truth.surface, seeded(7, 41)
    points = np.concatenate([_station(truth, np.array(eye), rng) for eye in STATIONS])
    sparse = observed_points(truth, scene.views, POINTS, POINT_ERROR * truth.diagonal, seeded(7, 42))
    scan = WORLD_FROM_SCAN.undo(points)
    return ScannedDemo(scan, tuple(_matches(scene, truth, points, scan)), sparse)


def _station(truth: Mesh, eye: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(n, 3) float: where the rays of one station meet the surface, the noise along the ray."""
    camera = looking_at(eye, np.array(AIM), np.array([0, 1.0, 0]), RAYS_PER_RADIAN, *GRID)
    face_id, depth = rasterize(truth.vertices, truth.faces, camera)
    row, column = np.nonzero(face_id >= 0)
    M = camera.image_from_world[:, :3]
    rays = np.linalg.solve(M, np.stack([column, row, np.ones(len(row))])).T * depth[row, column][:, None]
    length = np.linalg.norm(rays, axis=1, keepdims=True)
    return eye + rays * (1 + RANGE_NOISE * rng.standard_normal((len(rays), 1)) / length)


def _matches(scene: Scene, truth: Mesh, points: np.ndarray, scan: np.ndarray) -> list[str]:
    """Corners far from each other, each with the scan's point nearest to it and the clicked pixels."""
    distance, nearest = KDTree(points).query(truth.vertices)
    sees = np.stack([_sees(truth, view.camera) for view in scene.views], axis=1)
    candidates = np.flatnonzero((distance < np.quantile(distance, 0.3)) & (sees.sum(axis=1) >= CLICKED_IN))
    chosen = [int(candidates[np.argmax(truth.vertices[candidates, 1])])]
    while len(chosen) < MATCHES:
        apart = np.linalg.norm(truth.vertices[candidates][:, None] - truth.vertices[chosen], axis=2).min(axis=1)
        chosen.append(int(candidates[np.argmax(apart)]))
    lines = ["# a point of the scan (mm), then photos that show it, and where (clicked)"]
    for corner in chosen:
        views = np.flatnonzero(sees[corner])[np.linspace(0, sees[corner].sum() - 1, CLICKED_IN).astype(int)]
        sightings = []
        for view in (scene.views[v] for v in views):
            x, y = np.rint(view.camera.project(truth.vertices[corner])[0]).tolist()
            sightings.append(f"{view.name} {x:.0f} {y:.0f}")
        place = scan[np.asarray(nearest)[corner]]
        lines.append("  ".join([" ".join(f"{c:.1f}" for c in place), *sightings]))
    return lines


def _sees(truth: Mesh, camera: Camera) -> np.ndarray:
    """(n,) bool: vertices that nothing hides."""
    uv, depth = camera.project(truth.vertices)
    column, row = np.rint(uv).astype(int).T
    inside = (depth > 0) & (column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height)
    _, front = rasterize(truth.vertices, truth.faces, camera)
    return inside & (depth < 1.005 * front[np.where(inside, row, 0), np.where(inside, column, 0)])

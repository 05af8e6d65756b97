"""Convention mistakes: wrong axes or pixel conventions that would explain cameras that do not fit the photos."""

from collections.abc import Callable

import numpy as np

from fairing.camera import Camera
from fairing.scene import Scene

LARGEST_DISTANCE = 3.0
"""Px: cameras that project sparse points farther from their observations (median) do not fit them."""
_AXES = np.diag([1.0, -1.0, -1.0])


def _opengl(camera: Camera) -> np.ndarray:
    return camera.K @ _AXES @ camera.camera_from_world


def _inverse(camera: Camera) -> np.ndarray:
    Rt = camera.camera_from_world
    return camera.K @ np.column_stack([Rt[:, :3].T, -Rt[:, :3].T @ Rt[:, 3]])


def _inverse_opengl(camera: Camera) -> np.ndarray:
    Rt = camera.camera_from_world
    return camera.K @ _AXES @ np.column_stack([Rt[:, :3].T, -Rt[:, :3].T @ Rt[:, 3]])


def _image(matrix: Callable[[Camera], list[list[float]]]) -> Callable[[Camera], np.ndarray]:
    def changed(camera: Camera) -> np.ndarray:
        M = np.array(matrix(camera), dtype=np.float64)
        # Camera negates a mirrored matrix (P and -P are equivalent); this undoes it.
        return np.sign(np.linalg.det(M)) * M @ camera.image_from_world

    return changed


MISTAKES: dict[str, Callable[[Camera], np.ndarray]] = {
    # Almost equivalent to mirrored photos (up to the principal point); the more likely mistake comes first.
    "axes are y up, z backwards (OpenGL)": _opengl,
    "poses are camera to world instead of world to camera": _inverse,
    "poses are camera to world, with y up, z backwards (OpenGL)": _inverse_opengl,
    "photos are mirrored left to right": _image(lambda c: [[-1, 0, c.width - 1], [0, 1, 0], [0, 0, 1]]),
    "photos are upside down (y counts upwards)": _image(lambda c: [[1, 0, 0], [0, -1, c.height - 1], [0, 0, 1]]),
    "photos are turned by 180 degrees": _image(lambda c: [[-1, 0, c.width - 1], [0, -1, c.height - 1], [0, 0, 1]]),
    "cameras are for photos of half the size": _image(lambda _: [[2, 0, 0.5], [0, 2, 0.5], [0, 0, 1]]),
    "cameras are for photos of twice the size": _image(lambda _: [[0.5, 0, -0.25], [0, 0.5, -0.25], [0, 0, 1]]),
}
"""The actual convention in words, and the corrected matrix (3, 4) of a camera under it; its third row gives the depth."""


def project(image_from_world: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (n, 2) and depths (n,), world units, of points (n, 3), world units, by a matrix (3, 4) that may be mirrored."""
    homogeneous = points @ image_from_world[:, :3].T + image_from_world[:, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        return homogeneous[:, :2] / homogeneous[:, 2:], homogeneous[:, 2]


def share_in_view(scene: Scene, matrix: Callable[[Camera], np.ndarray]) -> float:
    """Fraction of the mesh's vertices that lie inside a photo and in front of its camera, 0 to 1, mean over the photos.

    Args:
        matrix: of a camera, (3, 4) float, from world units to homogeneous pixels.
    """
    vertices = scene.mesh.vertices[np.unique(scene.mesh.faces)]
    shares = []
    for view in scene.views:
        pixels, depth = project(matrix(view.camera), vertices)
        with np.errstate(invalid="ignore"):
            inside = ((pixels >= -0.5) & (pixels <= [view.camera.width - 0.5, view.camera.height - 0.5])).all(axis=1)
        shares.append((inside & (depth > 0)).mean())
    return float(np.mean(shares))


def explain_view(scene: Scene) -> str | None:
    """The convention mistake that explains why the photos hardly show the mesh, or None."""
    shares = {name: share_in_view(scene, matrix) for name, matrix in MISTAKES.items()}
    best = max(shares, key=shares.__getitem__)
    return best if shares[best] > 0.3 else None


def observed_distance(scene: Scene, matrix: Callable[[Camera], np.ndarray]) -> float:
    """Median reprojection error of the sparse points, px; infinite if most lie behind the cameras.

    Args:
        matrix: of a camera, (3, 4) float, from world units to homogeneous pixels.
    """
    sparse = scene.sparse_points
    assert sparse is not None
    distances = []
    for v, view in enumerate(scene.views):
        mine = sparse.observations[:, 1] == v
        uv, depth = project(matrix(view.camera), sparse.positions[sparse.observations[mine, 0]])
        with np.errstate(invalid="ignore"):
            distances.append(np.where(depth > 0, np.linalg.norm(uv - sparse.pixels[mine], axis=1), np.inf))
    return float(np.median(np.concatenate(distances)))


def explain_reprojection(scene: Scene) -> str | None:
    """The likely mistake in cameras that do not project the sparse points onto their observations, or None.

    A shift common to all photos indicates another convention of pixel centres if it is half a pixel, else a wrong principal
    point; large errors indicate wrong axes. Cameras and points that were reconstructed together under a mistake fit each
    other, so the absence of a finding proves nothing. Points found in the photos with the cameras as they are fit them, too,
    and are not examined.
    """
    sparse = scene.sparse_points
    if sparse is None or sparse.origin == "own" or len(sparse.observations) < 20:
        return None
    distance = observed_distance(scene, lambda camera: camera.image_from_world)
    if distance > LARGEST_DISTANCE:
        tried = {name: observed_distance(scene, matrix) for name, matrix in MISTAKES.items()}
        best = min(tried, key=tried.__getitem__)
        if tried[best] < 0.3 * distance:
            now = "are behind the cameras" if np.isinf(distance) else f"have a reprojection error of {distance:.3g} px"
            return f"sparse points {now} (median), but of {tried[best]:.2g} px if {best}"
    shifts = np.array([shift for v in range(len(scene.views)) if (shift := median_shift(scene, v)) is not None])
    shift = np.median(shifts, axis=0)
    spread = np.median(np.abs(shifts - shift), axis=0).max()
    if np.abs(shift).max() < 0.3 or spread > 0.15 or distance > 20:
        return None
    text = f"in all photos sparse points are shifted by ({shift[0]:+.2f}, {shift[1]:+.2f}) px from their observations"
    if np.abs(np.abs(shift) - 0.5).max() < 0.15 and shift[0] * shift[1] > 0:
        return (
            f"{text}: half a pixel, so the cameras assume the centre of the top-left pixel at "
            f"{'(0.5, 0.5)' if shift[0] > 0 else '(0, 0)'} instead of {'(0, 0)' if shift[0] > 0 else '(0.5, 0.5)'}"
        )
    return f"{text}: the principal point is wrong by that amount"


def cameras_fit(scene: Scene) -> bool:
    """Whether given sparse points lie in front of the cameras and project onto their observations, so that these are right."""
    sparse = scene.sparse_points
    if sparse is None or len(sparse.observations) < 20:
        return False
    return observed_distance(scene, lambda camera: camera.image_from_world) <= LARGEST_DISTANCE


def median_shift(scene: Scene, v: int) -> np.ndarray | None:
    """(2,) float, px: median of projection minus observation over a photo's sparse points; None for fewer than five."""
    sparse = scene.sparse_points
    if sparse is None:
        return None
    mine = sparse.observations[:, 1] == v
    if mine.sum() < 5:
        return None
    uv, _ = scene.views[v].camera.project(sparse.positions[sparse.observations[mine, 0]])
    return np.median(uv - sparse.pixels[mine], axis=0)

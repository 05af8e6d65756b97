"""Visibility of faces by their outlines: which photos may show a face, and the reason where one does not."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from fairing.camera import Camera
from fairing.cells.depth_map import depth_map
from fairing.geometry.normals import face_normals
from fairing.options import VisibilityOptions
from fairing.scene import Scene


class Visibility(IntEnum):
    """Whether a view shows a face; every value above `PARTLY_SEEN` is the reason why the view is not used."""

    SEEN = 0
    PARTLY_SEEN = 1
    BEHIND_CAMERA = 2
    TURNED_AWAY = 3
    GRAZING = 4
    OUTSIDE_PHOTO = 5
    TOO_SMALL = 6
    HIDDEN = 7  # by other faces, or by the photo's mask
    SURPLUS = 8
    DEGENERATE = 9

    @property
    def takes_part(self) -> bool:
        return self <= Visibility.PARTLY_SEEN


@dataclass(frozen=True, eq=False)
class Footprints:
    """The projected faces: (m,) arrays for one camera, or (m, V) for all.

    Attributes:
        area: float, px^2.
        height: float, px: height on the longest edge.
        longest_edge: float, px.
        reason: int8, `Visibility` by the outline alone; occlusion is not considered.
    """

    area: np.ndarray
    height: np.ndarray
    longest_edge: np.ndarray
    reason: np.ndarray


def footprints(
    vertices: np.ndarray, faces: np.ndarray, camera: Camera, orientation: int, options: VisibilityOptions, blur: float
) -> Footprints:
    """Project all faces into a photo and judge visibility by their outlines.

    Occlusion is judged later, sample by sample (`fairing.cells.sample_masks`).

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        orientation: 1 if the faces are counter-clockwise seen from outside, -1 if clockwise.
        blur: sigma_smooth of the level, px.

    Returns:
        Arrays of shape (m,).
    """
    uv, depth = camera.project(vertices)
    corners, corner_depth = uv[faces], depth[faces]
    with np.errstate(invalid="ignore", over="ignore"):
        edges = corners[:, [1, 2, 0]] - corners
        area = 0.5 * np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
        longest = np.sqrt((edges**2).sum(-1).max(-1))
        height = 2 * area / np.maximum(longest, 1e-12)
    points = vertices[faces]
    normal = orientation * face_normals(vertices, faces)
    sight = camera.center - points.mean(1)
    norms = np.linalg.norm(normal, axis=1) * np.linalg.norm(sight, axis=1)
    sine = (normal * sight).sum(1) / np.maximum(norms, 1e-300)
    low, high = corners.min(1), corners.max(1)

    reason = np.full(len(faces), Visibility.SEEN, dtype=np.int8)
    reason[~(height >= options.min_footprint * max(1.0, blur))] = Visibility.TOO_SMALL
    reason[(high < 1).any(1) | (low[:, 0] > camera.width - 2) | (low[:, 1] > camera.height - 2)] = (
        Visibility.OUTSIDE_PHOTO
    )
    reason[sine < np.sin(np.deg2rad(options.min_angle))] = Visibility.GRAZING
    reason[sine <= 0] = Visibility.TURNED_AWAY
    reason[(corner_depth <= 0).any(1)] = Visibility.BEHIND_CAMERA
    reason[norms == 0] = Visibility.DEGENERATE
    return Footprints(area, height, longest, reason)


def footprints_in_views(
    vertices: np.ndarray,
    faces: np.ndarray,
    cameras: Sequence[Camera],
    orientation: int,
    options: VisibilityOptions,
    blur: float,
    pool: Executor,
) -> Footprints:
    """`footprints` in all photos, several at a time: arrays of shape (m, V).

    Args:
        vertices: (n, 3) float, world units.
        faces: (m, 3) int.
        cameras: V cameras.
        orientation: see `mesh_orientation`.
        blur: sigma_smooth of the level, px.
        pool: executes one task per photo.
    """
    # Face-major: numpy's sums over the views of a face depend on the memory layout.
    area, height, longest = (np.empty((len(faces), len(cameras))) for _ in range(3))
    reason = np.empty((len(faces), len(cameras)), dtype=np.int8)

    def project_into(v: int) -> None:
        found = footprints(vertices, faces, cameras[v], orientation, options, blur)
        area[:, v], longest[:, v], height[:, v] = found.area, found.longest_edge, found.height
        reason[:, v] = found.reason

    list(pool.map(project_into, range(len(cameras))))
    return Footprints(area, height, longest, reason)


def mark_surplus(reasons: np.ndarray, area: np.ndarray, max_views: int) -> None:
    """Mark all but the `max_views` largest footprints of each face as surplus, in place.

    Args:
        reasons: (m, V) int8, `Visibility`; modified.
        area: (m, V) float, px^2.
    """
    crowded = np.flatnonzero((reasons <= Visibility.PARTLY_SEEN).sum(1) > max_views)
    for rows in np.array_split(crowded, len(crowded) // 10_000 + 1):
        part = reasons[rows] <= Visibility.PARTLY_SEEN
        ranked = np.argsort(np.where(part, -area[rows], np.inf), axis=1, kind="stable")
        for rank in range(max_views, part.shape[1]):
            is_surplus = part[np.arange(len(rows)), ranked[:, rank]]
            reasons[rows[is_surplus], ranked[is_surplus, rank]] = Visibility.SURPLUS


def mesh_orientation(scene: Scene, vertices: np.ndarray) -> int:
    """1 if the photos show mostly the counter-clockwise side of the faces, -1 if the clockwise side.

    About eight photos decide, at a quarter of their resolution.

    Args:
        vertices: (n, 3) float, world units.
    """
    balance = 0
    faces = scene.mesh.faces
    points, normal = vertices[faces], face_normals(vertices, faces)
    for view in scene.views[:: max(1, len(scene.views) // 8)]:
        face_id = depth_map(vertices, faces, view.camera, reduction=4).face_id
        counts = np.bincount(face_id[face_id >= 0], minlength=len(faces))
        balance += int((counts * np.sign(((view.camera.center - points[:, 0]) * normal).sum(1))).sum())
    return 1 if balance >= 0 else -1

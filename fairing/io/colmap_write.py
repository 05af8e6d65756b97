"""COLMAP text model writer: PINHOLE cameras, OPENCV ones for distorted photos, pixel centres at 0.5 (`colmap.py` reads it)."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from fairing.errors import InputError
from fairing.io.atomic import write_atomically
from fairing.lens import Lens
from fairing.scene import SparsePoints, View

FILES = ("cameras.txt", "images.txt", "points3D.txt")
"""The files of a text model. cameras.txt, by which a model is recognised, is written last."""

_HALF_PIXEL = 0.5
_LARGEST_SKEW = 1e-7
"""Pixels across the photo: rounding errors of the matrix decomposition are smaller."""


def check_cameras(views: Iterable[View]) -> None:
    """Raises InputError if a camera has skew, which no COLMAP camera model supports."""
    for view in views:
        K = view.camera.K
        skew = K[0, 1] / K[1, 1] * view.camera.height
        if abs(skew) > _LARGEST_SKEW:
            raise InputError(
                f"photo {view.name}: its camera has a skew of {skew:.2g} px across the photo, which COLMAP cameras do not "
                "support; convert to scene.json"
            )


def write_text_model(
    folder: Path, views: Sequence[View], sparse: SparsePoints | None = None, lenses: Sequence[Lens | None] = ()
) -> None:
    """Write cameras.txt, images.txt and points3D.txt; views of the same intrinsics share a camera.

    Args:
        lenses: of photos that are undistorted in the views but not where the model is read; empty: there are none.

    Raises:
        InputError: a file cannot be written, or a camera is skew.
    """
    check_cameras(views)
    folder.mkdir(parents=True, exist_ok=True)
    cameras: dict[str, int] = {}
    images = ["# Image list with two lines of data per image:", "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME",
              "#   POINTS2D[] as (X, Y, POINT3D_ID)"]  # fmt: skip
    tracks: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for v, view in enumerate(views):
        lens, Rt = lenses[v] if lenses else None, view.camera.camera_from_world
        K = view.camera.K if lens is None else lens.K
        # Rounded so that rounding errors of the decomposition do not give every photo a camera of its own.
        intrinsics = np.round((K[0, 0], K[1, 1], K[0, 2] + _HALF_PIXEL, K[1, 2] + _HALF_PIXEL), 9)
        size = f"{view.camera.width} {view.camera.height}"
        line = f"PINHOLE {size} {_numbers(intrinsics)}"
        if lens is not None:
            line = f"OPENCV {size} {_numbers((*intrinsics, *np.round(lens.distortion[:4], 12)))}"
        camera_id = cameras.setdefault(line, len(cameras) + 1)
        x, y, z, w = Rotation.from_matrix(Rt[:, :3]).as_quat()
        images.append(f"{v + 1} {_numbers((w, x, y, z, *Rt[:, 3]))} {camera_id} {view.name}")
        images.append(" ".join(_features(v, lens, sparse, tracks)))
    points = ["# 3D point list with one line of data per point:",
              "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)"]  # fmt: skip
    if sparse is not None:
        errors = _errors(views, sparse)
        for i, (position, color) in enumerate(zip(sparse.positions.tolist(), sparse.colors.tolist(), strict=True)):
            track = " ".join(f"{image} {index}" for image, index in tracks[i])
            points.append(f"{i + 1} {_numbers(position)} {color[0]} {color[1]} {color[2]} {errors[i]!r} {track}")
    lines = ["# Camera list with one line of data per camera:", "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]"]
    lines += [f"{camera_id} {line}" for line, camera_id in cameras.items()]
    for name, content in (("points3D.txt", points), ("images.txt", images), ("cameras.txt", lines)):
        data = ("\n".join(content) + "\n").encode()
        write_atomically(folder / name, lambda file, data=data: file.write(data))


def _features(
    v: int, lens: Lens | None, sparse: SparsePoints | None, tracks: dict[int, list[tuple[int, int]]]
) -> list[str]:
    """The observations of a view as words; also appends (image id, index in the image) to the tracks of their points."""
    if sparse is None:
        return []
    mine = np.flatnonzero(sparse.observations[:, 1] == v)
    pixels = sparse.pixels[mine] if lens is None else lens.distort(sparse.pixels[mine])
    words = []
    for index, (point, (x, y)) in enumerate(zip(sparse.observations[mine, 0].tolist(), pixels.tolist(), strict=True)):
        words.append(f"{x + _HALF_PIXEL!r} {y + _HALF_PIXEL!r} {point + 1}")
        tracks[point].append((v + 1, index))
    return words


def _errors(views: Sequence[View], sparse: SparsePoints) -> list[float]:
    """(n,) mean reprojection error of each point, pixels; -1 without observations, as COLMAP writes unknown errors."""
    distance = np.zeros(len(sparse.pixels))
    for v, view in enumerate(views):
        mine = sparse.observations[:, 1] == v
        uv, _ = view.camera.project(sparse.positions[sparse.observations[mine, 0]])
        distance[mine] = np.linalg.norm(uv - sparse.pixels[mine], axis=1)
    n = len(sparse.positions)
    count = np.bincount(sparse.observations[:, 0], minlength=n)
    total = np.bincount(sparse.observations[:, 0], distance, minlength=n)
    return np.where(count > 0, total / np.maximum(count, 1), -1.0).tolist()


def _numbers(values: Iterable[float]) -> str:
    """Each number as the shortest text that reads back as the same number."""
    return " ".join(repr(float(value)) for value in values)

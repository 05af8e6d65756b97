"""COLMAP text models: cameras.txt, images.txt and points3D.txt."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.capture import naming, read_text
from fairing.io.colmap_model import ColmapCamera, ColmapImage, ColmapModel, ColmapPoints, parameter_names

_DECLARED_POINTS = re.compile(r"^# Number of points: ([0-9]{1,18})\b", re.MULTILINE)


def read_text_model(folder: Path) -> ColmapModel:
    """The model in a folder's text files."""
    points = folder / "points3D.txt"
    return ColmapModel(
        _read_cameras(folder / "cameras.txt"),
        _read_images(folder / "images.txt"),
        _read_points(points) if points.exists() else None,
    )


def _read_cameras(path: Path) -> dict[int, ColmapCamera]:
    """Lines of CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]."""
    cameras = {}
    for number, line in _data_lines(path):
        fields = line.split()
        with _explaining(path, number, "CAMERA_ID MODEL WIDTH HEIGHT PARAMS"):
            camera_id, model, width, height = int(fields[0]), fields[1], int(fields[2]), int(fields[3])
            with naming(f"camera {camera_id}"):
                names = parameter_names(model)
            values = [float(field) for field in fields[4:]]
            cameras[camera_id] = ColmapCamera(model, width, height, dict(zip(names, values, strict=True)))
    return cameras


def _read_images(path: Path) -> dict[int, ColmapImage]:
    """Pairs of lines: IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME; then triples of X, Y, POINT3D_ID."""
    images = {}
    lines = enumerate(read_text(path, "a COLMAP model").splitlines(), start=1)
    for number, line in lines:
        if not line.strip() or line.startswith("#"):
            continue
        with _explaining(path, number, "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"):
            *fields, name = line.split(maxsplit=9)
            image_id, camera_id = int(fields[0]), int(fields[8])
            pose = np.array([float(field) for field in fields[1:8]])
        number, line = next(lines, (number + 1, ""))
        with _explaining(path, number, "triples of X Y POINT3D_ID"):
            fields = line.split()
            pixels = np.array([[float(x) for x in fields[0::3]], [float(y) for y in fields[1::3]]])
            point_ids = np.array([int(field) for field in fields[2::3]], dtype=np.int64)
            if pixels.shape[1] != len(point_ids):
                raise ValueError("incomplete triple")
        images[image_id] = ColmapImage(name.strip(), camera_id, pose[:4], pose[4:], pixels.T, point_ids)
    return images


def _read_points(path: Path) -> ColmapPoints:
    """Lines of POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[].

    Raises:
        InputError: a malformed line, or another number of points than COLMAP's comment declares.
    """
    ids, positions, colors = [], [], []
    for number, line in _data_lines(path):
        with _explaining(path, number, "POINT3D_ID X Y Z R G B ERROR TRACK"):
            point_id, x, y, z, r, g, b, _ = line.split(maxsplit=8)[:8]
            ids.append(int(point_id))
            positions.append((float(x), float(y), float(z)))
            colors.append((int(r), int(g), int(b)))
            if not (0 <= min(colors[-1]) <= max(colors[-1]) <= 255 and 0 <= ids[-1] < 2**63):
                raise ValueError("out of range")
    declared = _DECLARED_POINTS.search(read_text(path, "a COLMAP model"))
    if declared is not None and int(declared[1]) != len(ids):
        raise InputError(
            f"{path}: expected {declared[1]} points as its comment declares, found {len(ids)}; it is incomplete, export the "
            "model again, or correct the comment"
        )
    return ColmapPoints(
        np.array(ids, dtype=np.int64),
        np.array(positions, dtype=np.float64).reshape(-1, 3),
        np.array(colors, dtype=np.uint8).reshape(-1, 3),
    )


def _data_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Numbered lines that are neither empty nor a comment."""
    for number, line in enumerate(read_text(path, "a COLMAP model").splitlines(), start=1):
        if line.strip() and not line.startswith("#"):
            yield number, line


@contextmanager
def _explaining(path: Path, number: int, expected: str) -> Iterator[None]:
    """Raises parse errors of a line as InputError that names the line."""
    try:
        with naming(f"{path}: line {number}"):
            yield
    except InputError:
        raise
    except (ValueError, IndexError, OverflowError):
        raise InputError(f"{path}: line {number}: expected {expected}; export the model from COLMAP again") from None

"""COLMAP binary models: cameras.bin, images.bin and points3D.bin, little-endian."""

import struct
from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.capture import naming, reading
from fairing.io.colmap_model import (
    MODEL_NAMES,
    ColmapCamera,
    ColmapImage,
    ColmapModel,
    ColmapPoints,
    parameter_names,
)

_OBSERVATION = np.dtype([("pixel", "<f8", 2), ("point_id", "<i8")])


def read_binary_model(folder: Path) -> ColmapModel:
    """The model in a folder's binary files."""
    points = folder / "points3D.bin"
    return ColmapModel(
        _read_cameras(folder / "cameras.bin"),
        _read_images(folder / "images.bin"),
        _read_points(points) if points.exists() else None,
    )


def _read_cameras(path: Path) -> dict[int, ColmapCamera]:
    """Records of camera id, model number, width, height, parameters."""
    file, cameras = _BinaryFile(path), {}
    for _ in range(file.count()):
        camera_id, number, width, height = file.take("<IiQQ")
        with naming(f"{path}: camera {camera_id}"):
            model = MODEL_NAMES.get(number, f"number {number}")
            names = parameter_names(model)
        parameters = dict(zip(names, file.take(f"<{len(names)}d"), strict=True))
        cameras[camera_id] = ColmapCamera(model, width, height, parameters)
    file.expect_end()
    return cameras


def _read_images(path: Path) -> dict[int, ColmapImage]:
    """Records of image id, quaternion, translation, camera id, NUL-terminated name, features."""
    file, images = _BinaryFile(path), {}
    for _ in range(file.count()):
        image_id, *pose, camera_id = file.take("<I7dI")
        name = file.take_name()
        observed = file.take_array(_OBSERVATION, file.count())
        images[image_id] = ColmapImage(
            name, camera_id, np.array(pose[:4]), np.array(pose[4:]), observed["pixel"], observed["point_id"]
        )
    file.expect_end()
    return images


def _read_points(path: Path) -> ColmapPoints:
    """Records of point id, position, colour, error, track (a count, then pairs of 4-byte numbers)."""
    file, ids, positions, colors = _BinaryFile(path), [], [], []
    for _ in range(file.count()):
        point_id, x, y, z, r, g, b, _, track_length = file.take("<q3d3BdQ")
        file.skip(8 * track_length)
        ids.append(point_id)
        positions.append((x, y, z))
        colors.append((r, g, b))
    file.expect_end()
    return ColmapPoints(
        np.array(ids, dtype=np.int64),
        np.array(positions, dtype=np.float64).reshape(-1, 3),
        np.array(colors, dtype=np.uint8).reshape(-1, 3),
    )


class _BinaryFile:
    """A cursor over a file's bytes that never passes their end."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._position = 0
        with reading(path, "a COLMAP model"):
            self._data = path.read_bytes()

    def take(self, layout: str) -> tuple:
        """The next numbers, of a `struct` layout."""
        start = self._position
        self.skip(struct.calcsize(layout))
        return struct.unpack_from(layout, self._data, start)

    def count(self) -> int:
        """The number of records that follow."""
        return self.take("<Q")[0]

    def take_array(self, record: np.dtype, count: int) -> np.ndarray:
        """The next records, (count,)."""
        start = self._position
        self.skip(record.itemsize * count)
        return np.frombuffer(self._data, record, count, start)

    def take_name(self) -> str:
        """The next string, which ends with a NUL."""
        start = self._position
        end = self._data.find(b"\0", start)
        if end < 0:
            end = len(self._data)
        self.skip(end + 1 - start)
        try:
            return self._data[start:end].decode()
        except UnicodeDecodeError:
            raise InputError(f"{self._path}: expected a photo's name in UTF-8 at byte {start}") from None

    def skip(self, n_bytes: int) -> None:
        if self._position + n_bytes > len(self._data):
            raise InputError(
                f"{self._path}: expected {n_bytes} bytes at byte {self._position}, found the end of the file at "
                f"{len(self._data)}; it is truncated or damaged, export the model from COLMAP again"
            )
        self._position += n_bytes

    def expect_end(self) -> None:
        """Raise InputError if the file holds more."""
        if self._position != len(self._data):
            raise InputError(
                f"{self._path}: expected its end at byte {self._position}, found {len(self._data)} bytes; "
                "it is damaged, export the model from COLMAP again"
            )

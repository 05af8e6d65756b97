"""Feature points as a PLY point cloud, for other programs."""

from pathlib import Path

import numpy as np

from fairing.features.points import FeaturePoints
from fairing.io.atomic import write_atomically

_VERTEX = np.dtype([
    ("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("red", "u1"), ("green", "u1"), ("blue", "u1"), ("views", "<i4"),
    ("residual", "<f4"), ("sigma", "<f4"),
])  # fmt: skip
_PLY_TYPES = {"<f8": "double", "|u1": "uchar", "<i4": "int", "<f4": "float"}


def write_point_cloud(path: Path, points: FeaturePoints) -> None:
    """Write positions, colours, number of photos, mean residual (px) and the largest standard deviation (world units).

    Raises:
        InputError: the file cannot be written.
    """
    rows = np.zeros(len(points), _VERTEX)
    for axis, name in enumerate(("x", "y", "z")):
        rows[name] = points.positions[:, axis]
    for channel, name in enumerate(("red", "green", "blue")):
        rows[name] = points.colors[:, channel]
    rows["views"], rows["residual"] = points.n_views, points.residual
    rows["sigma"] = np.sqrt(np.linalg.eigvalsh(points.covariance)[:, 2])
    assert _VERTEX.names is not None
    properties = [f"property {_PLY_TYPES[_VERTEX[name].str]} {name}" for name in _VERTEX.names]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}", *properties, "end_header", ""]
    write_atomically(path, lambda file: file.write("\n".join(header).encode() + rows.tobytes()))

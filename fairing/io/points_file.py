"""Sparse points as a NumPy archive (.npz) of the arrays of `SparsePoints`."""

from pathlib import Path

import numpy as np

from fairing.errors import InputError
from fairing.io.atomic import write_atomically
from fairing.io.capture import naming, reading
from fairing.scene import SparsePoints
from fairing.util.npz import read_npz

_COLUMNS = {"positions": (3, "f"), "colors": (3, "u"), "observations": (2, "iu"), "pixels": (2, "f")}


def write_points(path: Path, points: SparsePoints) -> None:
    """Write the points, complete or not at all."""
    arrays = {name: getattr(points, name) for name in _COLUMNS}
    write_atomically(path, lambda file: np.savez_compressed(file, **arrays))


def read_points(path: Path, n_views: int) -> SparsePoints:
    """The points of a file.

    Args:
        n_views: number of views; observations refer to views by index.

    Raises:
        InputError: no such file, a damaged one, or arrays of the wrong shape, type or range.
    """
    with reading(path, "sparse points"), path.open("rb") as file:
        try:
            arrays = read_npz(file, _COLUMNS)
        except ValueError as error:
            raise InputError(
                f"{path}: expected sparse points, cannot be read ({error}); convert the capture again"
            ) from None
    if missing := sorted(_COLUMNS.keys() - arrays.keys()):
        raise InputError(
            f"{path}: expected the arrays {', '.join(_COLUMNS)}, found no {missing[0]}; convert the capture again"
        )
    with naming(path):
        for name, (columns, kinds) in _COLUMNS.items():
            array = arrays[name]
            if array.ndim != 2 or array.shape[1] != columns or array.dtype.kind not in kinds:
                raise InputError(f"{name}: expected {columns} columns, found shape {array.shape} of {array.dtype}")
            if not np.isfinite(array).all():
                raise InputError(f"{name}: expected finite numbers, found NaN or infinity")
        observations = arrays["observations"].astype(np.int64)
        if len(observations) != len(arrays["pixels"]) or len(arrays["positions"]) != len(arrays["colors"]):
            raise InputError("expected as many observations as pixels, and as many positions as colors")
        if (observations < 0).any() or (observations >= [len(arrays["positions"]), n_views]).any():
            raise InputError(
                f"observations: expected points and views that exist, found {observations.max(0).tolist()}"
            )
    return SparsePoints(arrays["positions"], arrays["colors"].astype(np.uint8), observations, arrays["pixels"])

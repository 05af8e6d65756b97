"""Records of runs and of flips as files, written without the code under test: the format of version 1, and crafted ones."""

import io
import json
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fairing.options import options_to_dict
from tests.small_scene import FACES, VERTICES, small_options

N_VIEWS = 8


def block(**arrays: Any) -> bytes:
    """Length, checksum, and a compressed NumPy archive of the arrays."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **{name: np.asarray(array) for name, array in arrays.items()})
    return raw_block(buffer.getvalue())


def raw_block(payload: bytes) -> bytes:
    return len(payload).to_bytes(8, "little") + zlib.crc32(payload).to_bytes(4, "little") + payload


def text(value: Any) -> np.ndarray:
    """(n,) uint8: a text as a header holds it; anything but a text as JSON."""
    return np.frombuffer((value if isinstance(value, str) else json.dumps(value)).encode(), dtype=np.uint8)


def run_header() -> dict[str, Any]:
    """Of a run on the corner of `small_scene`."""
    return {
        "scene": "corner",
        "views": [f"photo{i}" for i in range(N_VIEWS)],
        "sparse_points": None,
        "options": options_to_dict(small_options()),
        "versions": {"numpy": "2.0.0"},
    }


def step(**changes: Any) -> dict[str, Any]:
    """A step of vertex 0; a change to ... takes the field away."""
    after = VERTICES[[0]] + 0.01
    values = {
        "position": np.array([0, 0, 0, 0]), "next_position": np.array([0, 0, 0, 1]), "sweep_moment": np.array(0),
        "vertices": np.array([0]), "before": VERTICES[[0]], "proposed": after, "after": after,
        "step_px": np.array([0.5]), "damping": np.array([0.0]), "eigenvalues": np.array([[1.0, 2.0, 3.0]]),
        "reasons": np.array([0], np.int8), "objective_before": np.array(2.0), "objective_after": np.array(1.0),
        "faces": np.arange(6), "face_energy_before": np.full(6, 0.2), "face_energy_after": np.full(6, 0.1),
        "view_energy_before": np.full(N_VIEWS, 0.2), "view_energy_after": np.full(N_VIEWS, 0.1),
        "damping_next": np.array([0.0]), "rejections": np.array([0]),
    }  # fmt: skip
    return _changed(values, changes)


def flip(**changes: Any) -> dict[str, Any]:
    """The flip of the edge from vertex 0 to vertex 2 of the corner; a change to ... takes the field away."""
    values = {
        "round": np.array(0), "edge": np.array([0, 2]), "opposite": np.array([3, 1]), "faces": np.array([1, 0]),
        "energy": np.array([2.0, 1.0]), "common_loss": np.array([0.4, 0.2]), "n_views": np.array(3),
        "round_energy": np.array([2.0, 1.0]),
    }  # fmt: skip
    return _changed(values, changes)


def split_round(**changes: Any) -> dict[str, Any]:
    """A round that splits the first face of the corner; a change to ... takes the field away."""
    a, b, c = sorted(FACES[0].tolist())
    middles = (VERTICES[[a, a, b]] + VERTICES[[b, c, c]]) / 2
    values = {
        "vertices": VERTICES, "faces": FACES, "chosen": np.array([0]), "offsets": np.array([1.5]), "parts": np.array([0]),
        "judges": np.array([7]), "errors": np.array([[2.0, 1.0]]), "significance": np.array([4.0]),
        "is_split": np.array([1], np.uint8), "after": np.vstack([VERTICES, middles]),
    }  # fmt: skip
    return _changed(values, changes)


def write_trace(path: Path, header: Any = None, steps: list[dict[str, Any]] | None = None, **mesh: Any) -> Path:
    """A trace file of the corner.

    Args:
        header: default `run_header()`.
        steps: default one.
        mesh: arrays that replace `start` and `faces`.
    """
    first = {"text_header": text(run_header() if header is None else header), "start": VERTICES, "faces": FACES}
    blocks = [block(**_changed(first, mesh)), *(block(**values) for values in (steps or [step()]))]
    path.write_bytes(b"EIGENFAIRING TRACE 1\n" + b"".join(blocks))
    return path


def write_flips(
    path: Path,
    header: Any = None,
    flips: list[dict[str, Any]] | None = None,
    splits: Sequence[dict[str, Any]] = (),
    n_splits: str = "",
    **mesh: Any,
) -> Path:
    """A record of flips of the corner; other arguments as for `write_trace`.

    Args:
        n_splits: number of splits that the header announces, if it is not theirs.
    """
    first = {"text_header": text({} if header is None else header), "vertices": VERTICES, "faces": FACES}
    if splits or n_splits:
        first["text_splits"] = text(n_splits or str(len(splits)))
    steps = [*splits, *([flip()] if flips is None else flips)]
    blocks = [block(**_changed(first, mesh)), *(block(**values) for values in steps)]
    path.write_bytes(b"EIGENFAIRING FLIPS 1\n" + b"".join(blocks))
    return path


def _changed(values: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    values = values | changes
    return {name: value for name, value in values.items() if value is not ...}

"""What is made of a file is bounded by what the file holds, before it is made."""

import io
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fairing.errors import InputError
from fairing.io.feature_points import load_points
from fairing.io.points_file import read_points, write_points
from fairing.trace import MAGIC, Trace
from fairing.triangulation.record import MAGIC as FLIPS_MAGIC
from fairing.triangulation.record import FlipTrace
from fairing.util.block_file import BlockFile, pack
from fairing.util.budget import FREE_BYTES, RATIO, Budget
from fairing.util.npz import read_npz
from tests.small_scene import sparse_points
from tests.synthetic_capture import CUBE_VERTICES

ZEROS = 1 << 27
"""Bytes of an array of zeros, which deflate makes a thousand times smaller."""


def bounded(path: Path, read: Callable[[Path], object], said: str) -> None:
    """Reading is refused, and makes no more than the budget; the file itself and its parts are in memory, too."""
    tracemalloc.start()
    with pytest.raises(InputError, match=said) as error:
        read(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "\n" not in str(error.value)
    size = path.stat().st_size
    # The file and its parts are in memory too, and zipfile decompresses a megabyte at a time.
    assert peak < max(FREE_BYTES, RATIO * size) + 4 * size + (1 << 22), f"{peak / 2**20:.0f} MiB of {size} bytes"


def archive(path: Path, **arrays: np.ndarray) -> Path:
    np.savez_compressed(path, **arrays)
    return path


def test_points_that_expand_a_thousandfold_are_refused(tmp_path: Path):
    points = sparse_points(CUBE_VERTICES)
    arrays = {name: getattr(points, name) for name in ("colors", "observations", "pixels")}
    path = archive(tmp_path / "points.npz", positions=np.zeros((ZEROS // 24, 3)), **arrays)
    bounded(path, lambda path: read_points(path, 3), "points.npz: expected sparse points.*at most 16 MiB of data from")
    empty = np.zeros(ZEROS // 8)
    bounded(
        archive(path, positions=empty, covariance=empty),
        load_points,
        "points.npz: expected feature points.*at most 16 MiB",
    )


def test_arrays_that_are_not_used_are_not_read(tmp_path: Path):
    points = sparse_points(CUBE_VERTICES)
    arrays = {name: getattr(points, name) for name in ("positions", "colors", "observations", "pixels")}
    path = archive(tmp_path / "points.npz", **arrays, more=np.zeros(ZEROS, np.uint8))
    tracemalloc.start()
    np.testing.assert_array_equal(read_points(path, 4).positions, CUBE_VERTICES)
    assert tracemalloc.get_traced_memory()[1] < 1 << 20
    tracemalloc.stop()


@pytest.mark.parametrize(
    ("magic", "read"), [(MAGIC, Trace.load), (FLIPS_MAGIC, FlipTrace.load)], ids=["trace", "flips"]
)
@pytest.mark.parametrize("n_blocks", [1, 12])
def test_blocks_that_expand_a_thousandfold_are_refused_in_all(
    tmp_path: Path, magic: bytes, read: Callable, n_blocks: int
):
    """One large one, or several that make too much together."""
    size = ZEROS // n_blocks // 24
    header = pack({}, **{f"a{i}": np.zeros((size, 3)) for i in range(n_blocks)})
    BlockFile(tmp_path / "run", magic, [header]).close()
    bounded(tmp_path / "run", read, "at most 16 MiB of data from")


def test_the_budget_of_a_file_is_for_all_its_blocks():
    """Blocks of one mebibyte each, of a file of 20."""
    budget = Budget(100_000, 1 << 33)
    block = io.BytesIO()
    np.savez_compressed(block, a=np.zeros(1 << 20, np.uint8))
    for _ in range(16):
        read_npz(block, budget=budget)
    with pytest.raises(ValueError, match="at most 16 MiB of data from 100000 bytes, found declarations of 17 MiB"):
        read_npz(block, budget=budget)


def test_the_budget_grows_with_the_file_up_to_a_total():
    Budget(1 << 20, 1 << 30).take(RATIO << 20)
    with pytest.raises(InputError, match="expected at most 32 MiB of data from 1048576 bytes"):
        Budget(1 << 20, 1 << 30).take((RATIO << 20) + 1)
    with pytest.raises(InputError, match="at most 1024 MiB"):
        Budget(1 << 40, 1 << 30).take((1 << 30) + 1)
    budget = Budget(0, 1 << 30)
    budget.take(FREE_BYTES)
    budget.add(1 << 20)
    budget.take(FREE_BYTES)
    with pytest.raises(InputError, match="at most 32 MiB"):
        budget.take(1)


def test_members_with_other_compression_are_refused(tmp_path: Path):
    """LZMA allocates what a member declares."""
    data = io.BytesIO()
    np.save(data, np.zeros((3, 3)))
    with zipfile.ZipFile(tmp_path / "points.npz", "w", zipfile.ZIP_LZMA) as file:
        file.writestr("positions.npy", data.getvalue())
    with pytest.raises(
        InputError, match=r"points\.npz: .*positions\.npy: expected deflate as compression, found method 14"
    ):
        read_points(tmp_path / "points.npz", 3)


def test_mistakes_of_this_program_are_not_called_damage():
    class Broken(io.BytesIO):
        def seek(self, *_: object) -> int:
            raise AttributeError("no such method")

    with pytest.raises(AttributeError, match="no such method"):
        read_npz(Broken(b""))


def test_points_of_a_capture_stay_far_below_the_budget(tmp_path: Path):
    """Grey points at whole numbers, every one seen in the same photos: as regular as points get."""
    positions = np.stack(np.meshgrid(*[np.arange(40.0)] * 3), axis=-1).reshape(-1, 3)
    observations = np.stack(np.meshgrid(np.arange(len(positions)), np.arange(5), indexing="ij"), axis=-1).reshape(-1, 2)
    pixels = np.random.default_rng(0).uniform(0, 4000, (len(observations), 2))
    points = type(sparse_points(CUBE_VERTICES))(
        positions, np.full((len(positions), 3), 128, np.uint8), observations, pixels
    )
    write_points(tmp_path / "points.npz", points)
    made = sum(getattr(points, name).nbytes for name in ("positions", "colors", "observations", "pixels"))
    assert made < RATIO / 8 * (tmp_path / "points.npz").stat().st_size
    assert len(read_points(tmp_path / "points.npz", 5).positions) == len(positions)

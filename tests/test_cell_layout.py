"""Layout of cells: the size of each face's grid, and the limit on the samples of all faces together."""

from dataclasses import replace

import numpy as np
import pytest

from fairing.cells import layout
from fairing.cells.layout import GRID_SIZES, LEAST_LARGEST, MAX_SAMPLES, plan_cells
from fairing.options import CellOptions, FairingOptions, LevelOptions

OPTIONS = FairingOptions(levels=(LevelOptions(blur=1.0, size=256),))


def planned(longest: np.ndarray, n_photos: int, options: FairingOptions = OPTIONS) -> tuple[np.ndarray, int]:
    """Size of each face's cells (m,), and the samples of all cells together, for faces seen in as many photos each."""
    seen = np.ones((len(longest), n_photos), dtype=bool)
    edges = np.repeat(longest[:, None], n_photos, axis=1)
    found = plan_cells(options, 0, edges, 0.8 * edges, seen)
    return found.grid_sizes[found.face_grid], int(found.samples.sum()) * n_photos


def test_a_cell_has_a_sample_a_pixel_and_hardly_more():
    longest = np.random.default_rng(0).uniform(8, 256, 50)
    sizes, _ = planned(longest, 3)
    assert (sizes >= longest).all()
    assert (sizes <= np.maximum(8, 1.5 * longest)).all()


@pytest.mark.parametrize("faces", [100, 400, 2000])
def test_many_faces_share_the_samples_and_only_large_cells_shrink(faces: int):
    longest = np.random.default_rng(1).uniform(20, 250, faces)
    sizes, samples = planned(longest, 11)
    wanted = [next(size for size in GRID_SIZES if size >= edge) for edge in longest]
    total = [
        (11 * sum(min(size, largest) * (min(size, largest) + 1) // 2 for size in wanted), largest)
        for largest in GRID_SIZES
    ]
    largest = max(limit for count, limit in total if limit <= LEAST_LARGEST or count <= MAX_SAMPLES)
    assert sizes.tolist() == [min(size, largest) for size in wanted]
    assert samples <= MAX_SAMPLES or largest == LEAST_LARGEST


def test_cells_of_one_size_keep_it(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(layout, "MAX_SAMPLES", 10)
    sizes, _ = planned(np.full(5, 200.0), 4, replace(OPTIONS, cells=CellOptions(adaptive=False)).with_levels(size=128))
    assert (sizes == 128).all()

"""The cells of a face as pictures: what each photo shows, what the eigenspace makes of it, and what remains."""

import base64

import cv2
import numpy as np

from app.palette import NOW, RGB, SELECTED, TRUTH
from fairing.inspect import FaceCells

TILE = 62  # px
GAP = 2
EMPTY: RGB = (36, 39, 43)  # outside of the triangle
MASKED: RGB = (58, 62, 68)  # samples that the photo does not really show
KINDS = ("photo", "U c", "residual", "weight", "norm ρ")


def strip_of_view(cells: FaceCells, row: int) -> str:
    """One photo's observed cell, reconstruction, signed residual, robust weight and norm side by side, as a data URI.

    Grey levels are stretched to what the face has. Residuals: blue below, red above, at full strength from the outlier
    threshold on; the weight is yellow there, where the norm begins to let go.
    """
    counts, everywhere = cells.counts[row], np.ones(cells.counts.shape[1], dtype=bool)
    threshold = _threshold(cells)
    shown = cells.observed[cells.counts] if cells.counts.any() else cells.observed.ravel()
    dark, bright = np.percentile(shown, (0.5, 99.5))
    stretch = 255 / max(bright - dark, 8.0)
    tiles = [
        _tile(cells, _grey((cells.observed[row] - dark) * stretch), everywhere),
        _tile(cells, _grey((cells.reconstruction[row] - dark) * stretch), everywhere),
        _tile(cells, _signed(cells.residual[row] / threshold), counts),
        _tile(cells, _weight(cells, row, threshold), counts),
        _tile(cells, _ramp(cells.rho[row] / max(float(np.percentile(cells.rho, 99.5)), 1e-12)), counts),
    ]
    return data_uri(_side_by_side(tiles))


def strip_of_basis(cells: FaceCells) -> str:
    """The basis images, zero in the middle grey, as a data URI."""
    everywhere = np.ones(cells.basis.shape[1], dtype=bool)
    tiles = []
    for image in cells.basis:
        largest = max(float(np.abs(image).max()), 1e-12)
        tiles.append(_tile(cells, _grey(127.5 + 127.5 * image / largest), everywhere))
    return data_uri(_side_by_side(tiles))


def data_uri(pixels: np.ndarray) -> str:
    """A PNG within a text, from (h, w, 3) uint8, RGB."""
    _, encoded = cv2.imencode(".png", np.ascontiguousarray(pixels[..., ::-1]), [cv2.IMWRITE_PNG_COMPRESSION, 3])
    return "data:image/png;base64," + base64.b64encode(encoded.tobytes()).decode()


def _threshold(cells: FaceCells) -> float:
    """Where residuals count as large: the robust norm's turning point, else three times their spread."""
    if np.isfinite(cells.outlier_threshold):
        return max(float(cells.outlier_threshold), 1e-6)
    return max(3 * float(np.std(cells.residual[cells.counts])) if cells.counts.any() else 1.0, 1e-6)


def _tile(cells: FaceCells, colors: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """(TILE, TILE, 3) uint8 from colours (p, 3) of the samples; with colour photos the first channel stands for all."""
    rows, columns = cells.rows_and_columns
    samples = len(rows)
    image = np.empty((cells.size, cells.size, 3), dtype=np.uint8)
    image[:] = EMPTY
    image[rows, columns] = np.where(shown[:samples, None], colors[:samples], MASKED)
    method = cv2.INTER_AREA if cells.size > TILE else cv2.INTER_NEAREST
    return cv2.resize(image, (TILE, TILE), interpolation=method)


def _side_by_side(tiles: list[np.ndarray]) -> np.ndarray:
    gap = np.empty((TILE, GAP, 3), dtype=np.uint8)
    gap[:] = EMPTY
    parts = [part for tile in tiles for part in (tile, gap)]
    return np.concatenate(parts[:-1], axis=1) if parts else gap


def _grey(values: np.ndarray) -> np.ndarray:
    return np.repeat(np.clip(values, 0, 255)[:, None], 3, axis=1).astype(np.uint8)


def _signed(values: np.ndarray) -> np.ndarray:
    """Blue for -1, dark for 0, red for 1."""
    strength = np.clip(np.abs(values), 0, 1)[:, None]
    color = np.where((values < 0)[:, None], np.array(TRUTH), np.array(NOW))
    return ((1 - strength) * 18 + strength * color).astype(np.uint8)


def _weight(cells: FaceCells, row: int, threshold: float) -> np.ndarray:
    """Bright where a residual counts fully, yellow beyond the outlier threshold."""
    weights = cells.weights[row]
    shade = _grey(230 * weights / max(float(weights.max()), 1e-12))
    is_outlier = np.abs(cells.residual[row]) > threshold
    return np.where(is_outlier[:, None], np.array(SELECTED, dtype=np.uint8), shade)


def _ramp(values: np.ndarray) -> np.ndarray:
    """Dark to bright, through the colours of fire."""
    levels = (255 * np.clip(values, 0, 1)).astype(np.uint8)
    return cv2.applyColorMap(levels[:, None], cv2.COLORMAP_INFERNO)[:, 0, ::-1]

"""Cell images: observed cells, reconstructions, residuals, weights and flows of a face as pictures."""

import base64
from collections.abc import Callable

import cv2
import numpy as np

from app.debugger.cell_queries import StepFlows
from app.html import number
from app.palette import NOW, RGB, SELECTED, TRUTH, css
from fairing.judge.inspect import FaceCells

GAP = 2
EMPTY: RGB = (36, 39, 43)  # outside the triangle
MASKED: RGB = (58, 62, 68)  # samples that are not visible in the photo
ZERO = 18  # grey level of a zero residual
FLOW_COLORS: dict[str, RGB] = {"model": NOW, "flow": (242, 244, 247)}
AXES = ("x", "y", "z")  # kinds of the derivatives of the residual by the world axes
MIN_CONFIDENCE = 0.3  # optical flow vectors of lower confidence are not drawn
MIN_ARROW = 1.2  # px: shorter arrows are not drawn


class CellPictures:
    """Pictures of a face's cells, with colour scales common to all photos.

    Args:
        cells: of the face.
        flows: flow vectors and the cells they are drawn over; without them, flow columns are dark.
        residual_scale: residual shown at full colour, grey levels; default: what makes these residuals visible.
    """

    def __init__(self, cells: FaceCells, flows: StepFlows | None = None, residual_scale: float | None = None) -> None:
        self.cells, self._flows = cells, flows
        shown = cells.observed[cells.counts] if cells.counts.any() else cells.observed.ravel()
        low, high = (float(value) for value in np.percentile(shown, (0.5, 99.5)))
        self.dark, self.bright = low, max(high, low + 8.0)
        self.threshold = _threshold(cells)
        scale = self.residual_scale = residual_scale or min(self.threshold, _visible_scale(cells))
        self.largest_rho = max(float(np.percentile(cells.rho, 99.5)), 1e-12)
        self.largest_weight = max(float(cells.weights.max(initial=0)), 1e-12)
        self._draw: dict[str, Callable[[int], np.ndarray]] = {
            "photo": lambda row: self._stretched(cells.observed[row]),
            "reconstruction": lambda row: self._stretched(cells.reconstruction[row]),
            "residual": lambda row: _signed(cells.residual[row] / scale),
            "weight": self._weight,
            "norm": lambda row: _fire(cells.rho[row] / self.largest_rho),
        }
        self.largest_slope = 1e-12
        if cells.derivatives is not None:
            slopes = cells.derivatives.of_residuals
            self.largest_slope = max(float(np.percentile(np.abs(slopes), 99.5)), 1e-12)
            for axis, name in enumerate(AXES):
                self._draw[name] = lambda row, axis=axis: _signed(slopes[axis, row] / self.largest_slope)

    def strip(self, row: int, kinds: tuple[str, ...], tile: int) -> str:
        """The given kinds of one photo's cell side by side as a data URI, each `tile` px wide."""
        gap = np.full((tile, GAP, 3), EMPTY, dtype=np.uint8)
        parts = [part for kind in kinds for part in (_scaled(self.picture(row, kind), tile), gap)]
        return data_uri(np.concatenate(parts[:-1], axis=1))

    def picture(self, row: int, kind: str) -> np.ndarray:
        """(N, N, 3) uint8: one cell, one pixel per sample; for a kind with arrows, the background of the arrows."""
        if kind in FLOW_COLORS:
            at = self._flow_row(row)
            if self._flows is None or at is None:
                return _placed(self.cells, np.full((self.cells.residual.shape[1], 3), ZERO, dtype=np.uint8), None)
            before = self._flows.cells
            over = _grey(ZERO + 130 * np.sqrt(np.abs(before.residual[at]) / _threshold(before)))
            return _placed(before, over, before.counts[at])
        counts = None if kind in ("photo", "reconstruction") else self.cells.counts[row]
        return _placed(self.cells, self._draw[kind](row), counts)

    def arrows(self, row: int, kind: str, tile: float, scale: float, every: int = 1) -> str:
        """SVG path of a cell's arrows in a tile `tile` px wide; empty if there are none.

        Args:
            scale: length of the arrows, in lengths of the flow vectors.
            every: draw every n-th arrow in each direction.
        """
        at = self._flow_row(row)
        if self._flows is None or at is None:
            return ""
        size = self._flows.cells.size
        if kind == "model":
            flow, shown = self._flows.model, None
        else:
            flow, shown = self._flows.optical, self._flows.optical.confidence[at] > MIN_CONFIDENCE
        if flow is None:
            return ""
        column, line = (np.unique(flow.places[:, k], return_inverse=True)[1] for k in (0, 1))
        chosen = (column % every == every // 2) & (line % every == every // 2)
        if shown is not None:
            chosen &= shown
        unit = tile / size
        starts = (flow.places[chosen] + 1 / 3) * unit
        return arrow_path(starts, starts + scale * unit * flow.vectors[at][chosen])

    def legend(self, kind: str) -> str:
        """Markup of the colour legend of a kind."""
        if kind in ("photo", "reconstruction"):
            return _bar("#000", "#fff", number(self.dark, 3), "grey levels", number(self.bright, 3))
        if kind == "residual":
            edge = number(self.residual_scale, 3)
            name = self._threshold_name() if self.residual_scale == self.threshold else "the 99th percentile"
            return _gradient(
                _css_gradient(_signed(np.linspace(-1, 1, 17))), f"−{edge}", f"0; ends at {name}", f"+{edge}"
            )
        if kind == "weight":
            outlier = f"<span style='color:{css(SELECTED)}'>■</span> |e| &gt; {self._threshold_name()}"
            return _bar("#000", "#e6e6e6", "0", f"of the largest weight · {outlier}", "1")
        if kind in AXES:
            edge = number(self.largest_slope, 3)
            return _gradient(
                _css_gradient(_signed(np.linspace(-1, 1, 17))), f"−{edge}", "grey levels / world unit", f"+{edge}"
            )
        if kind == "norm":
            return _gradient(_css_gradient(_fire(np.linspace(0, 1, 9))), "0", "ρ(e)", number(self.largest_rho, 3))
        word = "υ, displacement of the step" if kind == "model" else "f, optical flow from I to U c"
        return (
            f"<div class='dim'><span style='color:{css(FLOW_COLORS[kind])}'>→</span> {word}; behind it |I − U c|</div>"
        )

    def values(self, row: int) -> str:
        """I, U c and weight of every sample of a cell for the page's script: little-endian int16 as base64.

        Grey levels in units of 1/64, weights in units of 1/10000 of the largest weight, -1 for masked samples.
        """
        cells = self.cells
        samples = len(cells.rows_and_columns[0])
        weight = np.where(cells.counts[row], 1e4 * cells.weights[row] / self.largest_weight, -1)
        table = np.stack([64 * cells.observed[row], 64 * cells.reconstruction[row], weight])[:, :samples]
        return base64.b64encode(np.clip(np.round(table), -32768, 32767).astype("<i2").tobytes()).decode()

    def _flow_row(self, row: int) -> int | None:
        """Row of a photo among the cells before the step; None if it did not see the face."""
        if self._flows is None:
            return None
        found = np.flatnonzero(self._flows.cells.views == self.cells.views[row])
        return int(found[0]) if len(found) else None

    def _threshold_name(self) -> str:
        return "e<sub>T</sub>" if np.isfinite(self.cells.outlier_threshold) else "three standard deviations"

    def _stretched(self, values: np.ndarray) -> np.ndarray:
        return _grey((values - self.dark) * 255 / (self.bright - self.dark))

    def _weight(self, row: int) -> np.ndarray:
        """Bright at full weight, yellow beyond the outlier threshold."""
        shade = _grey(230 * self.cells.weights[row] / self.largest_weight)
        is_outlier = np.abs(self.cells.residual[row]) > self.threshold
        return np.where(is_outlier[:, None], np.array(SELECTED, dtype=np.uint8), shade)


def strip_of_basis(cells: FaceCells, tile: int) -> str:
    """The basis images side by side as a data URI; zero is middle grey."""
    gap = np.full((tile, GAP, 3), EMPTY, dtype=np.uint8)
    parts = []
    for image in cells.basis:
        largest = max(float(np.abs(image).max()), 1e-12)
        parts += [_scaled(_placed(cells, _grey(127.5 + 127.5 * image / largest), None), tile), gap]
    return data_uri(np.concatenate(parts[:-1], axis=1) if parts else gap)


def arrow_path(starts: np.ndarray, ends: np.ndarray) -> str:
    """SVG path of arrows from `starts` to `ends`, both (n, 2) px, without those shorter than `MIN_ARROW`."""
    parts = []
    along = ends - starts
    length = np.linalg.norm(along, axis=1)
    for (x, y), (dx, dy), size in zip(starts, along, length, strict=True):
        if size < MIN_ARROW:
            continue
        head = min(4.0, 0.4 * size) / size
        hx, hy, sx, sy = head * dx, head * dy, 0.6 * head * dy, 0.6 * head * dx
        parts.append(
            f"M{x:.1f} {y:.1f}l{dx:.1f} {dy:.1f}m{-hx - sx:.1f} {-hy + sy:.1f}"
            f"L{x + dx:.1f} {y + dy:.1f}l{-hx + sx:.1f} {-hy - sy:.1f}"
        )
    return "".join(parts)


def data_uri(pixels: np.ndarray, *, jpeg: bool = False) -> str:
    """A PNG (or JPEG) data URI of pixels (h, w, 3) uint8 RGB."""
    kind, options = (".jpg", [cv2.IMWRITE_JPEG_QUALITY, 88]) if jpeg else (".png", [cv2.IMWRITE_PNG_COMPRESSION, 3])
    _, encoded = cv2.imencode(kind, np.ascontiguousarray(pixels[..., ::-1]), options)
    return f"data:image/{'jpeg' if jpeg else 'png'};base64," + base64.b64encode(encoded.tobytes()).decode()


def _threshold(cells: FaceCells) -> float:
    """Outlier threshold, grey levels: inflection point of the robust norm, else three standard deviations."""
    if np.isfinite(cells.outlier_threshold):
        return max(float(cells.outlier_threshold), 1e-6)
    return max(3 * float(np.std(cells.residual[cells.counts])) if cells.counts.any() else 1.0, 1e-6)


def _visible_scale(cells: FaceCells) -> float:
    """Grey levels that 1 % of the residuals exceed; at least one grey level, or quantisation would look like a residual."""
    shown = np.abs(cells.residual[cells.counts])
    return max(float(np.percentile(shown, 99)), 1.0) if len(shown) else 1.0


def _placed(cells: FaceCells, colors: np.ndarray, counts: np.ndarray | None) -> np.ndarray:
    """(N, N, 3) uint8 from colours (p, 3) of the samples; for colour photos, from those of the first channel."""
    rows, columns = cells.rows_and_columns
    samples = len(rows)
    image = np.empty((cells.size, cells.size, 3), dtype=np.uint8)
    image[:] = EMPTY
    image[rows, columns] = (
        colors[:samples] if counts is None else np.where(counts[:samples, None], colors[:samples], MASKED)
    )
    return image


def _scaled(image: np.ndarray, tile: int) -> np.ndarray:
    method = cv2.INTER_AREA if len(image) > tile else cv2.INTER_LINEAR
    return cv2.resize(image, (tile, tile), interpolation=method)


def _grey(values: np.ndarray) -> np.ndarray:
    return np.repeat(np.clip(values, 0, 255)[:, None], 3, axis=1).astype(np.uint8)


def _signed(values: np.ndarray) -> np.ndarray:
    """Blue for -1, dark for 0, red for 1."""
    strength = np.sqrt(np.clip(np.abs(values), 0, 1))[:, None]  # square root: small values stay visible
    color = np.where((values < 0)[:, None], np.array(TRUTH), np.array(NOW))
    return ((1 - strength) * ZERO + strength * color).astype(np.uint8)


def _fire(values: np.ndarray) -> np.ndarray:
    """The colour map inferno, from dark to bright."""
    levels = (255 * np.clip(values, 0, 1)).astype(np.uint8)
    return cv2.applyColorMap(levels[:, None], cv2.COLORMAP_INFERNO)[:, 0, ::-1]


def _bar(left: str, right: str, low: str, middle: str, high: str) -> str:
    return _gradient(f"linear-gradient(90deg,{left},{right})", low, middle, high)


def _css_gradient(colors: np.ndarray) -> str:
    return f"linear-gradient(90deg,{','.join(f'rgb({r},{g},{b})' for r, g, b in colors.tolist())})"


def _gradient(colors: str, low: str, middle: str, high: str) -> str:
    return (
        f"<div style='height:10px;border-radius:2px;background:{colors}'></div>"
        f"<div class='row dim'><span>{low}</span><span class='grow' style='text-align:center'>{middle}</span>"
        f"<span>{high}</span></div>"
    )

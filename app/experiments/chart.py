"""Charts: the results of an experiment as plottable data, for the page and for image files."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.palette import CURVES, RGB
from fairing.experiments import CaptureRange, Experiment, KSweep, NoiseAgainstBound, Row, WarpComparison
from fairing.experiments.noise import rms_of, spread_of
from fairing.experiments.warps import VARIANTS

Kind = Literal["points", "line", "dashed"]
BLUE, PALE_BLUE, GREY, PALE_ORANGE, ORANGE, *_ = CURVES
# The hue shows the warp, the saturation the solver.
VARIANT_COLORS = dict(zip(VARIANTS, (PALE_ORANGE, ORANGE, PALE_BLUE, BLUE), strict=True))
OF_EDGE = "% of the edge"


@dataclass(frozen=True, eq=False)
class Series:
    """A curve.

    Attributes:
        label: entry in the legend; empty for none.
        x, y: (n,) float; x ascending.
        color: of line and markers.
        kind: how it is drawn.
    """

    label: str
    x: np.ndarray
    y: np.ndarray
    color: RGB
    kind: Kind = "line"


@dataclass(frozen=True, eq=False)
class Chart:
    """Curves with their axes, whose ranges hold all expected results, so that they do not change while results arrive.

    Attributes:
        x_range, y_range: limits of the axes.
        x_log, y_log: whether an axis is logarithmic.
    """

    title: str
    x_label: str
    y_label: str
    x_range: tuple[float, float]
    y_range: tuple[float, float]
    series: tuple[Series, ...]
    x_log: bool = False
    y_log: bool = True


def charts_of(experiment: Experiment, cases: Sequence[Row], rows: Sequence[Row]) -> list[Chart]:
    """The charts of the results so far; of an experiment of another package one for each measured number, over the cases.

    Args:
        cases: all cases of the experiment.
        rows: the measured ones, in any order.
    """
    draw: dict[str, Callable[[Sequence[Row], Sequence[Row]], list[Chart]]] = {
        CaptureRange.name: _capture_range,
        NoiseAgainstBound.name: _noise,
        KSweep.name: _k_sweep,
        WarpComparison.name: _warps,
    }
    if experiment.name not in draw:
        return _by_case(experiment, cases, rows)
    return draw[experiment.name](cases, rows)


def _by_case(experiment: Experiment, cases: Sequence[Row], rows: Sequence[Row]) -> list[Chart]:
    settings = set(cases[0])
    number_of = {tuple(case.values()): n + 1 for n, case in enumerate(cases)}
    charts = []
    for name, meaning in experiment.columns.items():
        at = sorted((number_of[tuple(row[key] for key in cases[0])], row[name]) for row in rows if name in row)
        if name in settings or not all(isinstance(value, int | float) for _, value in at):
            continue
        x, y = np.array(at, dtype=float).reshape(-1, 2).T
        limits = (min(0.0, *y), 1.08 * max(1e-9, *y)) if len(y) else (0.0, 1.0)
        series = Series("", x, y, BLUE, "points")
        charts.append(
            Chart(name, "number of the case", meaning, (0.4, len(cases) + 0.6), limits, (series,), y_log=False)
        )
    return charts


def _capture_range(cases: Sequence[Row], rows: Sequence[Row]) -> list[Chart]:
    starts = sorted({case["start_percent"] for case in cases})
    low, high = _decades([*_values(rows, "end_percent"), 0.01, 100.0])
    same = np.geomspace(low, starts[-1], 48)
    series = [Series("end = start", same, same, GREY, "dashed")]
    for direction in sorted({row["direction"] for row in rows}):
        x, y = _curve([row for row in rows if row["direction"] == direction], "start_percent", "end_percent")
        color = _color(direction)
        series.append(Series(f"direction {direction + 1}", x, y, color))
    return [
        Chart(
            "End error over start error", f"start error, {OF_EDGE}", f"end error, {OF_EDGE}",
            (0.0, 1.08 * starts[-1]), (low, high), tuple(series),
        )
    ]  # fmt: skip


def _noise(cases: Sequence[Row], rows: Sequence[Row]) -> list[Chart]:
    noises = sorted({case["noise"] for case in cases})
    low, high = _decades([*_values(rows, "end_percent"), *_values(rows, "bound_percent"), 1e-4, 0.1])
    by_noise = [[row for row in rows if row["noise"] == noise] for noise in noises]
    by_noise = [here for here in by_noise if here]
    x = np.array([here[0]["noise_in_all"] for here in by_noise])
    series = [
        Series("Cramér–Rao bound", x, np.array([here[0]["bound_percent"] for here in by_noise]), GREY, "dashed"),
        Series("rms of the draws", x, np.array([rms_of(here) for here in by_noise]), BLUE),
    ]
    drawn_twice = [here for here in by_noise if len(here) > 1]
    if drawn_twice:
        at = np.array([here[0]["noise_in_all"] for here in drawn_twice])
        series.append(Series("spread of the draws", at, np.array([spread_of(here) for here in drawn_twice]), PALE_BLUE))
    for draw in sorted({row["draw"] for row in rows}):
        own = [row for row in rows if row["draw"] == draw]
        series.append(Series("" if draw else "a draw", *_curve(own, "noise_in_all", "end_percent"), ORANGE, "points"))
    return [
        Chart(
            "Error over noise", "noise of a channel with rounding, grey levels", f"end error, {OF_EDGE}",
            (0.2, 1.4 * max(noises[-1], 1.0)), (low, high), tuple(series), x_log=True,
        )
    ]  # fmt: skip


def _k_sweep(cases: Sequence[Row], rows: Sequence[Row]) -> list[Chart]:
    most = max(case["k"] for case in cases)
    ends: list[Series] = []
    left: list[Series] = []
    for direction in sorted({row["direction"] for row in rows}):
        own = [row for row in rows if row["direction"] == direction]
        name = f"direction {direction + 1}"
        ends.append(Series(name, *_curve(own, "k", "end_percent"), _color(direction)))
        left.append(Series(name, *_curve(own, "k", "left_percent"), _color(direction)))
    return [
        Chart(
            "Error at the end of the run", "dimensions k", f"end error, {OF_EDGE}", (0.6, most + 0.4),
            _decades([*_values(rows, "end_percent"), 0.002, 1.0]), tuple(ends),
        ),
        Chart(
            "Residual of a misalignment", "dimensions k", "fraction not explained, %", (0.6, most + 0.4),
            _decades([*_values(rows, "left_percent"), 0.01, 100.0]), tuple(left),
        ),
    ]  # fmt: skip


def _warps(cases: Sequence[Row], rows: Sequence[Row]) -> list[Chart]:
    far = max(case["start_percent"] for case in cases)
    count = len({(case["start_percent"], case["direction"]) for case in cases})
    starts = sorted({(case["direction"], -case["start_percent"]) for case in cases})
    place = {key: n + 1 for n, key in enumerate(starts)}
    paths: list[Series] = []
    ends: list[Series] = []
    for variant in VARIANTS:
        warp, solver = variant
        own = [row for row in rows if (row["warp"], row["solver"]) == variant]
        name = f"{warp}, {solver.replace('_', ' ')}"
        first = [row for row in own if (row["start_percent"], row["direction"]) == (far, 0)]
        for row in first:
            path = np.array(row["path"])
            paths.append(Series(name, np.arange(len(path), dtype=float), path, VARIANT_COLORS[variant]))
        at = sorted((place[row["direction"], -row["start_percent"]], row["end_percent"]) for row in own)
        if at:
            x, y = np.array(at, dtype=float).T
            ends.append(Series("" if first else name, x, y, VARIANT_COLORS[variant], "points"))
    errors = [value for series in paths for value in series.y]
    longest = max((series.x[-1] for series in paths), default=100.0)
    limits = _decades([*errors, *_values(rows, "end_percent"), 0.002, far])
    return [
        Chart(
            f"Error by step, from {far:g} %", "steps", f"error, {OF_EDGE}", (0.0, 1.02 * longest),
            limits, tuple(paths),
        ),
        Chart(
            "End error of each start", "number of the start", f"end error, {OF_EDGE}", (0.4, count + 0.6), limits,
            tuple(ends),
        ),
    ]  # fmt: skip


def _color(direction: int) -> RGB:
    """Color of a direction; grey is reserved for references."""
    colors = [color for color in CURVES if color != GREY]
    return colors[direction % len(colors)]


def _values(rows: Sequence[Row], name: str) -> list[float]:
    return [float(row[name]) for row in rows]


def _curve(rows: Sequence[Row], x: str, y: str) -> tuple[np.ndarray, np.ndarray]:
    """Two columns of the rows as (n,) float each, by ascending x."""
    points = np.array(sorted((float(row[x]), float(row[y])) for row in rows)).reshape(-1, 2)
    return points[:, 0], points[:, 1]


def _decades(values: Sequence[float]) -> tuple[float, float]:
    """The powers of ten that enclose all positive values."""
    positive = np.array([value for value in values if value > 0])
    return float(10.0 ** np.floor(np.log10(positive.min()))), float(10.0 ** np.ceil(np.log10(positive.max())))

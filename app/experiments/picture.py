"""Chart image: charts as a PNG in the colors of the page."""

import io
import textwrap
from collections.abc import Sequence

from app.experiments.chart import Chart
from app.palette import BACKGROUND, RGB, grey

DPI = 150
WIDTH, HEIGHT = 6.4, 5.0  # inches, of one chart
WELL, LINE, DIM, TEXT, STRONG = (grey(name) for name in ("well", "line", "dim", "text", "strong"))


def png_of(charts: Sequence[Chart], title: str, note: str) -> bytes:
    """PNG of charts side by side, below a title and a note."""
    # Imported here: the import takes about a second, which every start of the program would spend.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(max(WIDTH * len(charts), WIDTH), HEIGHT), dpi=DPI, facecolor=_unit(BACKGROUND))
    FigureCanvasAgg(figure)
    left = 0.5 / figure.get_figwidth()
    figure.text(left, 1 - 0.22 / HEIGHT, title, color=STRONG, fontsize=15, fontweight="bold", va="top")
    wrapped = textwrap.fill(note, width=int(14 * figure.get_figwidth()))
    figure.text(left, 1 - 0.56 / HEIGHT, wrapped, color=DIM, fontsize=9.5, va="top", linespacing=1.35)
    for n, chart in enumerate(charts):
        _draw(figure.add_subplot(1, len(charts), n + 1), chart)
    figure.subplots_adjust(
        left=0.75 / figure.get_figwidth(), right=1 - 0.25 / figure.get_figwidth(), top=1 - 1.3 / HEIGHT,
        bottom=0.6 / HEIGHT, wspace=0.22,
    )  # fmt: skip
    file = io.BytesIO()
    # Without matplotlib's date, the same rows give the same bytes.
    figure.savefig(file, format="png", facecolor=figure.get_facecolor(), metadata={"Software": "EigenFairing"})
    return file.getvalue()


def _draw(axes, chart: Chart) -> None:
    axes.set_facecolor(WELL)
    axes.set_title(chart.title, color=TEXT, fontsize=10.5, loc="left", pad=8)
    axes.set_xlabel(chart.x_label, color=DIM, fontsize=9.5)
    axes.set_ylabel(chart.y_label, color=DIM, fontsize=9.5)
    axes.set_xscale("log" if chart.x_log else "linear")
    axes.set_yscale("log" if chart.y_log else "linear")
    axes.set_xlim(*chart.x_range)
    axes.set_ylim(*chart.y_range)
    axes.xaxis.set_major_formatter(_plain)
    axes.yaxis.set_major_formatter(_plain)
    axes.xaxis.set_minor_formatter(lambda value, at: "")
    axes.yaxis.set_minor_formatter(lambda value, at: "")
    axes.tick_params(colors=DIM, labelsize=9, which="both", length=3, color=LINE)
    axes.grid(True, which="major", color=LINE, linewidth=0.8)
    axes.set_axisbelow(True)
    for side in axes.spines.values():
        side.set_color(LINE)
    styles = {"points": ("none", "o", 4.5), "line": ("-", "o", 4.0), "dashed": ("--", "none", 0.0)}
    for series in chart.series:
        line, marker, size = styles[series.kind]
        if len(series.x) > 40:
            marker = "none"
        axes.plot(
            series.x, series.y, color=_unit(series.color), linestyle=line, marker=marker, markersize=size, linewidth=1.7,
            label=series.label or "_", alpha=0.75 if series.kind == "points" else 1.0,
        )  # fmt: skip
    if any(series.label for series in chart.series):
        axes.legend(facecolor=WELL, edgecolor=LINE, labelcolor=TEXT, fontsize=8.5, framealpha=0.9)


def _plain(value: float, _: int) -> str:
    return f"{value:g}"


def _unit(color: RGB) -> tuple[float, float, float]:
    return color[0] / 255, color[1] / 255, color[2] / 255

"""Plot of a quantity over the recorded moments. A click jumps to a moment; a dot marks the current one.

Drawn as SVG, because viser's plots have no gaps between lines and report no clicks.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import viser

from app.debugger.compare import Compared, RunEnergies, look_up
from app.debugger.error_history import RunErrors
from app.debugger.history import EnergyHistory, Recorded
from app.debugger.residual_history import ResidualHistory
from app.debugger.run_state import RunState
from app.debugger.series import NAN, QUANTITIES, RESIDUAL, Quantity, Series, series_of
from app.debugger.stage_text import blur_text, fit_lines, stage_name
from app.debugger.step_text import slot_of
from app.html import number, text
from app.page_state.page_state import PageState, PlotView
from app.page_state.pull_source import PullSource
from app.palette import NOW, REFERENCE, RGB, SELECTED, css, solid
from app.panels.choice import chip
from app.panels.plot_drawing import (
    BOTTOM,
    HEIGHT,
    LEFT,
    RIGHT,
    TOP,
    WIDTH,
    band,
    cursor,
    frame,
    known_points,
    line_at,
    value_scale,
)
from app.pictures.stage_colors import COLOR_OF_STAGE
from app.pictures.term_colors import colors_of_terms
from app.plot_line import Line, intervals
from app.viser_bridge.html_events import Handler, HtmlEvents, choice_of, press
from app.viser_bridge.html_panel import HtmlPanel
from fairing.judge.comparable_residual import SIGMA
from fairing.mesh import Mesh
from fairing.run.recorded_terms import term_meanings
from fairing.stage_kind import StageKind
from fairing.trace import StepRecord

RISE = 1.01  # times its lowest value: an error that ends higher is explained
A_WIDTH = 10  # of the mark of A, in units of the plot
NUMBER_WIDTH = 50  # of the present value

ERROR, FIT, TERMS = "error", "fit", "terms"
_RESIDUAL = Quantity(
    RESIDUAL, "what the photos do not agree about: the same faces, photos and samples at the finest level at all moments and in "
    f"all runs, so that all points compare. Root mean square, in which more than {SIGMA:g} grey levels count as {SIGMA:g}. "
    "Measured at the ends of stages, and in between while the run is paused",
    "RMS at the finest level, grey levels", "Its faces, finest level, grey levels", False,
    lambda record: NAN, lambda record, slot, ring: NAN,
)  # fmt: skip
_ERROR = Quantity(
    ERROR, "distance to the truth along directions the photos determine, % of the diagonal; of the run: RMS",
    "RMS distance to the truth, % of diagonal", "Distance to the truth, % of diagonal", False,
    lambda record: NAN, lambda record, slot, ring: NAN,
)  # fmt: skip
_FIT = Quantity(
    FIT, "objective of the fits, percent of its value at the beginning of each stage. Every gate or sweep has its own "
    "associations; what each leaves multiplies with what the earlier ones have left",
    "Objective of each fit, % of its beginning", "Objective of each fit, % of its beginning", False,
    lambda record: NAN, lambda record, slot, ring: NAN,
)  # fmt: skip
_TERMS = Quantity(
    "energy", "energy of each term at the moments visited, sum over the vertices; a face counts for each of its corners. "
    "Only connected points compare", "", "", True,
    lambda record: NAN, lambda record, slot, ring: NAN,
)  # fmt: skip


class Plot:
    """The residual at the finest level compares throughout. The energy has one line per sweep, because every sweep has its own
    cells."""

    def __init__(
        self,
        gui: viser.GuiApi,
        mesh: Mesh,
        energies: EnergyHistory,
        run_energies: RunEnergies,
        run_errors: RunErrors | None,
        residuals: ResidualHistory,
        html_events: HtmlEvents,
        page_state: PageState,
        pulls: PullSource,
        jump: Handler,
        republish: Callable[[], None],
    ) -> None:
        self._mesh, self._energies, self._run_energies, self._run_errors = mesh, energies, run_energies, run_errors
        self._pulls, self._residuals = pulls, residuals
        errors = {} if run_errors is None else {ERROR: _ERROR}
        self._quantities = {RESIDUAL: _RESIDUAL} | errors | QUANTITIES | {FIT: _FIT, TERMS: _TERMS}

        def change(**changes: object) -> None:
            page_state.plot = replace(page_state.plot, **changes)
            republish()

        self._events = html_events.named(
            {
                "jump": jump,
                "quantity": choice_of(
                    lambda name: change(name=name, is_log=None), lambda: list(self._quantities), "quantity"
                ),
                "vertex": press(lambda: change(of_vertex=not page_state.plot.of_vertex)),
                "terms": press(
                    lambda: change(name="energy" if self._name(page_state.plot) == TERMS else TERMS, is_log=None)
                ),
                "log": press(lambda: change(is_log=not self._is_log(page_state.plot))),
            }
        )
        self._panel = HtmlPanel(gui)
        self._series: dict[str, tuple[object, Series]] = {}
        self._shown: object = None

    def _name(self, plot: PlotView) -> str:
        """The quantity that is plotted: the user's choice, else the residual, which compares throughout."""
        return plot.name if plot.name in self._quantities else RESIDUAL

    def _has_fits(self) -> bool:
        return bool(np.isin(self._energies.curves.kinds, [kind for kind in StageKind if kind.is_fit]).any())

    def _is_log(self, plot: PlotView) -> bool:
        """Whether the scale is logarithmic: the user's choice, else the default of the quantity."""
        return self._quantities[self._name(plot)].is_log if plot.is_log is None else plot.is_log

    def show(self, state: RunState, page_state: PageState) -> None:
        plot = page_state.plot
        vertex = page_state.selected if plot.of_vertex else None
        compared = look_up(page_state.reference, state)
        reference = None if compared is None else (compared.run.run_id, compared.run.length, compared.moment)
        name = self._name(plot)
        known = () if name != TERMS or self._pulls.at(state) is None else tuple(self._pulls.energies(state.run_id))
        if name in (RESIDUAL, ERROR):
            runs = (state.run_id, *(() if compared is None else (compared.run.run_id,)))
            known = tuple(self._residuals.count(run_id) for run_id in runs)
        key = (state.run_id, state.length, state.moment, plot, vertex, page_state.selected, reference, known)
        if key == self._shown:
            return
        self._shown = key
        chips = self._chips(state, plot, page_state.selected, vertex)
        if state.length == 0:
            self._panel.set(chips + _empty("No steps yet."))
            return
        if plot.of_vertex and vertex is None:
            self._panel.set(chips + _empty("Select a vertex to plot it."))
            return
        lines, colors = self._lines(state, self._energies, name, vertex, "now"), None
        if name == TERMS:
            lines, colors = self._lines_of_terms(state, vertex)
        if not lines:
            why = self._why_empty(state, name)
            self._panel.set(chips + _empty(why))
            return
        others: list[Line] = []
        if compared is not None and compared.run.run_id != state.run_id and compared.run.length:
            energies = self._run_energies.of(compared.run)
            others = self._lines(compared.run, energies, name, vertex, "reference")
        picture = self._picture(state, plot, lines, colors, compared, others)
        why = self._why_error_rises(state) if name == ERROR and vertex is None else ""
        self._panel.set(chips + picture + (why and f"<div class='dim note'>{text(why)}</div>"))

    def _why_empty(self, state: RunState, name: str) -> str:
        """Why there is nothing to plot."""
        if name == TERMS:
            return "Computing…"
        if name == RESIDUAL:
            why_not = self._residuals.of(state).why_not
            return text(f"Not measured: {why_not}") if why_not else "Measuring…"
        return "No step has recorded this yet."

    def _lines_of_terms(self, state: RunState, vertex: int | None) -> tuple[list[Line], list[RGB]]:
        """Lines of the terms at the moments whose pulls are known, one a sweep, and their colours."""
        known, color_of = self._pulls.energies(state.run_id), colors_of_terms(term_meanings(state.trace))
        moments = np.array([moment for moment in known if moment <= state.length], dtype=int)
        sweeps = self._energies.sweeps[np.minimum(moments, state.length - 1)]
        lines, colors = [], []
        for begin, end in intervals(sweeps) if len(moments) else ():
            part = moments[begin:end].tolist()
            for name in {name: None for moment in part for name in known[moment]}:
                found = [(moment, known[moment][name]) for moment in part if name in known[moment]]
                values = [energy.sum() if vertex is None else energy[vertex] for _, energy in found]
                lines.append(Line(np.array([moment for moment, _ in found]), np.array(values, dtype=float)))
                colors.append(color_of[name])
        return lines, colors

    def _lines(self, run: Recorded, energies: EnergyHistory, name: str, vertex: int | None, role: str) -> list[Line]:
        if name == TERMS:
            return []
        if name == RESIDUAL:
            line = self._residuals.of(run).line(None if vertex is None else self._mesh.one_rings[vertex])
            return [line] if len(line.moments) else []
        if name == FIT:
            return fit_lines(run.trace.steps, energies.stages(run.length))
        if name == "energy" and vertex is None:
            return energies.lines(run.length)
        if name == ERROR and vertex is None:
            assert self._run_errors is not None
            values = self._run_errors.values_of(run)
            return [Line(np.arange(len(values)), values)]
        key = (name, vertex)
        if role not in self._series or self._series[role][0] != key:
            self._series[role] = (key, self._series_of(name, vertex))
        series = self._series[role][1]
        series.update(run)
        moments, values = series.moments, series.values
        known = moments <= run.length
        return [Line(moments[known], values[known])] if known.any() else []

    def _series_of(self, name: str, vertex: int | None) -> Series:
        if name == ERROR and vertex is not None:
            assert self._run_errors is not None
            percent = self._run_errors.measure.percent

            def error(record: StepRecord, moment: int) -> float | None:
                slot = slot_of(record, vertex)
                return None if slot is None else float(percent(np.array([vertex]), record.after[slot : slot + 1])[0])

            return Series(error)
        return series_of(name, vertex, np.zeros(0, dtype=int) if vertex is None else self._mesh.one_rings[vertex])

    def _chips(self, state: RunState, plot: PlotView, selected: int | None, vertex: int | None) -> str:
        """Buttons for the quantities; below, what the chosen one is (once a step has recorded it), whose it is, and its scale."""
        chosen = self._name(plot)
        is_energy = chosen in ("energy", TERMS)
        left_out = {"energy", TERMS} if self._has_fits() else {"energy", TERMS, FIT}
        quantities = "".join(
            chip(
                quantity.title,
                self._events("quantity", n),
                f"Plot {quantity.meaning}",
                name == chosen,
                "chip tight",
            )
            for n, (name, quantity) in enumerate(self._quantities.items())
            if name not in left_out
        )
        whose = "vertex" if selected is None else f"v {selected}"
        hint = "Plot the selected vertex (instead of the whole run)"
        of_vertex = chip(whose, self._events("vertex"), hint, plot.of_vertex, "chip tight")
        log = chip("log", self._events("log"), "Logarithmic scale", self._is_log(plot), "chip tight")
        quantity = self._quantities[chosen]
        has_steps = state.length > 0
        caption = text((quantity.run_caption if vertex is None else quantity.vertex_caption) if has_steps else "")
        meaning = quantity.meaning[:1].upper() + quantity.meaning[1:]
        if chosen == TERMS:
            caption = self._legend_of_terms(state)
        note = f"<span class='dim one grow' title='{text(meaning)}'>{caption}</span>"
        if is_energy:
            hint = "Energy of each term at the moments visited (each costs about one iteration)"
            note += chip("terms", self._events("terms"), hint, chosen == TERMS, "chip tight")
        energy = self._quantities["energy"]
        at = list(self._quantities).index("energy")
        of_sweeps = chip("energy", self._events("quantity", at), f"Plot {energy.meaning}", is_energy, "chip tight")
        return (
            f"<div class='row chips quantities'>{quantities}</div>"
            f"<div class='row chips quantities kind'>{note}{of_sweeps}{of_vertex}{log}</div>"
        )

    def _why_error_rises(self, state: RunState) -> str:
        """Why the error of a finished run ends above its lowest value at the end of a stage; empty if it does not."""
        assert self._run_errors is not None
        values = self._run_errors.values_of(state)
        ends = np.array([0, *(stage.end for stage in self._energies.stages(state.length))])
        lowest = int(ends[values[ends].argmin()])
        if not state.finished or values[-1] < RISE * values[lowest]:
            return ""
        known = self._residuals.of(state).by_moment
        before, after = known.get(lowest), known.get(state.length)
        change = "" if before is None or after is None else (
            f" (residual {number(before.mean, 4)} at moment {lowest}, {number(after.mean, 4)} at the end)"
        )  # fmt: skip
        error = number(float(values[lowest]), 3)
        return (
            f"The error was lower at moment {lowest}, {error} %. The judge keeps the end by the energy of "
            f"the photos and by held-out points{change}: it does not know the truth. Along directions that the photos hardly "
            "determine, a mesh that explains them better may lie farther from it."
        )

    def _legend_of_terms(self, state: RunState) -> str:
        """The terms that have lines, in their colours."""
        known = {name for energies in self._pulls.energies(state.run_id).values() for name in energies}
        return " ".join(
            f"<i class='swatch' style='background:{solid(color)}'></i>{text(name)}"
            for name, color in colors_of_terms(term_meanings(state.trace)).items()
            if name in known
        )

    def _picture(
        self, state: RunState, plot: PlotView, lines: list[Line], colors: list[RGB] | None, compared: Compared | None,
        others: list[Line],
    ) -> str:  # fmt: skip
        """The plot.

        Args:
            lines: of this run.
            colors: of the lines; None: that of the current mesh.
            others: lines of the compared run.
        """
        name = self._name(plot)
        everything = np.concatenate([line.values for line in (*lines, *others)])
        length, length_of_a = max(state.length, 1), 1 if compared is None else max(compared.run.length, 1)
        by_share = bool(others) and compared is not None and not _share_steps(state, compared)
        if others and not by_share:
            length = length_of_a = max(length, length_of_a)
        scale = value_scale(everything, self._is_log(plot))

        def x(moment: np.ndarray | float) -> np.ndarray:
            return LEFT + (WIDTH - LEFT - RIGHT) * np.asarray(moment) / length

        def x_of_a(moment: np.ndarray | float) -> np.ndarray:
            return x(np.asarray(moment) * length / length_of_a)

        def y(values: np.ndarray | float) -> np.ndarray:
            return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * scale.heights(values)

        parts = [frame(scale.marks, y)]
        shown = np.zeros(length + 1, dtype=bool)
        for line in lines:
            shown[line.moments] = True
        for stage in self._energies.stages(state.length):
            is_photos = stage.kind is StageKind.PHOTOS
            label = (
                f"σ {blur_text(stage.level, state.options)}" if is_photos else stage_name(stage.kind, 0, state.options)
            )
            color, is_empty = COLOR_OF_STAGE[stage.kind], not shown[stage.begin + 1 : stage.end + 1].any()
            left, right = float(x(stage.begin)), float(x(stage.end))
            parts.append(
                band(
                    left,
                    right,
                    label,
                    color,
                    is_empty=is_empty and name not in (TERMS, RESIDUAL),
                    has_border=stage.begin > 0,
                )
            )
        at_a = 0.0
        # Lines of A are pale beyond A's moment; the other lines are pale beyond the current moment.
        parts.extend(line_at(line, compared.moment, x_of_a, y, length_of_a, REFERENCE) for line in others if compared)
        for line, color in zip(lines, colors or [NOW] * len(lines), strict=True):
            parts.append(line_at(line, state.moment, x, y, length, color))
            if name == RESIDUAL:
                parts.append(known_points(line, state.moment, x, y, color))
        if compared is not None:
            at_a = float((x if compared.run.run_id == state.run_id else x_of_a)(compared.moment))
            parts.append(_mark_of_a(at_a))
        here = [line for line in lines if line.moments[0] <= state.moment]
        if name in (FIT, "energy") and not plot.of_vertex:  # no line reaches a stage that has no such values
            here = [line for line in here if state.moment <= line.moments[-1]]
        if name == RESIDUAL and not np.isin(state.moment, lines[0].moments):
            parts.append(cursor(float(x(state.moment))))
        elif here and name != TERMS:
            value = here[-1].values[np.searchsorted(here[-1].moments, state.moment, side="right") - 1]
            parts.append(f'<circle cx="{x(state.moment):.1f}" cy="{y(value):.1f}" r="4" fill="{css(SELECTED)}"/>')
            right = WIDTH - RIGHT - 2
            if at_a > right - NUMBER_WIDTH:  # the mark of A would cover the number
                right = at_a - A_WIDTH
            parts.append(f'<text x="{right:.1f}" y="{TOP + 6}" text-anchor="end">{number(float(value), 4)}</text>')
        sides = f"{LEFT / WIDTH:.5f},{RIGHT / WIDTH:.5f}"
        press = self._events("jump", f"ef.moment(event,{length},{state.length},{sides})")
        meaning = self._quantities[name].meaning
        along = "share of the steps of each run" if by_share else "moment"
        # Not onclick: while a run redraws the plot, press and release may hit two different elements.
        return (
            f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" class="plot" role="img" '
            f'aria-label="{text(self._quantities[name].title.capitalize())} plot" onpointerdown="{text(press)}">'
            f"<title>By {along}: {text(meaning)}. Click to go to a moment</title>{''.join(parts)}</svg>"
        )


def _share_steps(state: RunState, compared: Compared) -> bool:
    """Whether one of the two runs was branched from the other, so that their moments compare."""
    parents = {run.run_id: run.parent for run in state.runs}
    return parents.get(state.run_id) == compared.run.run_id or compared.run.parent == state.run_id


def _empty(note: str) -> str:
    return f'<div class="plot dim" style="aspect-ratio:{WIDTH}/{HEIGHT}">{note}</div>'


def _mark_of_a(x: float) -> str:
    """Mark of the reference moment A."""
    return (
        f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}" stroke="{css(REFERENCE, 0.8)}"/>'
        f'<rect x="{x - A_WIDTH / 2:.1f}" y="0" width="{A_WIDTH}" height="11" rx="2" fill="{css(REFERENCE)}"/>'
        f'<text x="{x:.1f}" y="9" text-anchor="middle" style="fill:#16181c;font-weight:700">A</text>'
    )

"""Pulls panel: the terms that pull at the selected vertex, with their energy, part of the next step and information."""

from collections.abc import Callable

import numpy as np
import viser

from app.debugger.moment_pulls import MomentPulls
from app.debugger.run_state import RunState
from app.html import number, text
from app.page_state.page_state import PULL_SCALES, PageState
from app.page_state.pull_source import PullSource
from app.palette import SELECTED, solid
from app.panels.choice import arrow_scales, choice
from app.pictures.term_colors import colors_of_terms
from app.viser_bridge.html_events import HtmlEvents, choice_of
from app.viser_bridge.html_panel import HtmlPanel


class PullsPanel:
    """A row a term for the current vertex of the selection. While the run moves, it names the moment that it belongs to."""

    def __init__(
        self,
        gui: viser.GuiApi,
        html_events: HtmlEvents,
        source: PullSource,
        page_state: PageState,
        republish: Callable[[], None],
    ) -> None:
        def choose(scale: int) -> None:
            page_state.pull_scale = scale
            republish()

        self._source = source
        self._events = html_events.named({"scale": choice_of(choose, lambda: list(PULL_SCALES), "arrow length")})
        self._panel = HtmlPanel(gui)

    def show(self, state: RunState, page_state: PageState) -> None:
        if page_state.selected is None:
            self._panel.set("")
            return
        now, latest = self._source.at(state), self._source.latest(state)
        if isinstance(now, Exception):
            self._panel.set(f"<h4>Pulls</h4><div class='note rejected'>{text(now)}</div>")
        elif latest is None:
            self._panel.set("<h4>Pulls</h4><div class='dim'>Computing…</div>")
        else:
            moment, found = latest
            of_other = "" if moment == state.moment else f" at moment {moment}"
            content = pulls_html(found, page_state.selected, of_other, is_over=state.finished and not of_other)
            self._panel.set(content + (self._scales(page_state) if page_state.shows("pulls") else ""))

    def _scales(self, page_state: PageState) -> str:
        scales = {scale: (label, self._events("scale", k)) for k, (scale, label) in enumerate(PULL_SCALES.items())}
        return arrow_scales(choice(scales, page_state.pull_scale, "Pull arrows"))


def pulls_html(found: MomentPulls, vertex: int, when: str, is_over: bool) -> str:
    """Markup: the table of one vertex.

    Args:
        when: added to the title.
        is_over: whether the run has finished, so that no next step follows.
    """
    what = "one more step" if is_over else "the next step"
    colors = colors_of_terms(found.meanings)
    rows = "".join(
        _row(
            f"<i class='swatch' style='background:{solid(colors[pull.name])}'></i>{text(pull.name)}",
            *(float(values[vertex]) for values in (pull.energy, pull.step_px, share)),
            hint=found.meanings[pull.name],
        )
        for pull, share in zip(found.pulls, found.shares, strict=True)
    )
    energy = float(np.sum([pull.energy[vertex] for pull in found.pulls]))
    whole = _row(
        f"<i class='swatch' style='background:{solid(SELECTED)}'></i>all",
        energy,
        float(found.step_px[vertex]),
        float("nan"),
        hint="the step that is proposed, which the parts add up to",
    )
    note = "" if found.step[vertex].any() else "<div class='dim note'>This vertex does not move in the sweep.</div>"
    head = "".join(
        f"<th class='n' title='{text(hint)}'>{name}</th>"
        for name, hint in (
            ("energy", "Of the term at this vertex; for photos of the faces around it"),
            ("step, px", "Length of the term's part in the photo where it is longest"),
            ("share", "Share of the term in the information along the step"),
        )
    )
    title = f"<th class='title'>Pulls on {what}{when}</th>"
    return f"<table class='pulls'><tr>{title}{head}</tr>{rows}{whole}</table>{note}"


def _row(name: str, energy: float, px: float, share: float, hint: str) -> str:
    percent = f"{100 * share:.0f} %" if share == share else ""
    return (
        f"<tr title='{text(hint)}'><th><span>{name}</span></th><td class='n'>{number(energy, 3)}</td>"
        f"<td class='n'>{number(px, 3)}</td><td class='n'>{percent}</td></tr>"
    )

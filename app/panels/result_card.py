"""Result card: whether a finished run helped, the vertices it left worst, and the run as files to share."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

import numpy as np

from app.background_worker import BackgroundWorker
from app.debugger.residual_history import ResidualHistory
from app.debugger.result_facts import ResultFacts, result_facts
from app.debugger.run_state import RunState
from app.html import button, copy_button, number, text
from app.page_state.page_state import PageState
from app.panels.choice import chip
from app.query_cache import QueryCache
from app.viser_bridge.html_events import HtmlEvents, choice_of, integer, press
from fairing.scene import Scene

LESSON_OF_PAPER = "dimensions"
DISTANCE = "Distance to the truth, RMS, %"
HINTS = {
    DISTANCE: "Of the vertices. Flat faces fit a curved surface best with their vertices beside it: there a run can end with a "
    "larger distance, and with a lower residual than the true mesh."
}


class Shares(Protocol):
    """What makes files of the run."""

    kind: str | None
    fraction: float
    left: float | None

    def make(self, name: str) -> None: ...
    def cancel(self) -> None: ...
    def command(self, name: str, state: RunState) -> str: ...


class ResultCard:
    """Markup of the card; the figures are computed in the background.

    Args:
        titles: of the files that can be made, by the names that `shares` knows.
        fly_to: selects a vertex and approaches it.
        open_lesson: opens a lesson by its name.
        report_of: the file that may report on a run, by the run's id.
        divide: switches the divider between the start and now.
    """

    def __init__(
        self,
        scene: Scene,
        html_events: HtmlEvents,
        residuals: ResidualHistory,
        background: BackgroundWorker,
        shares: Shares,
        titles: Mapping[str, str],
        fly_to: Callable[[int], None],
        open_lesson: Callable[[str], None],
        report_of: Callable[[int], Path | None],
        divide: Callable[[], None],
    ) -> None:
        self._scene, self._residuals, self._shares, self._titles = scene, residuals, shares, titles
        self._report_of, self._facts = report_of, QueryCache[tuple[int, int], ResultFacts](background.post)
        self._chosen = next(iter(titles))

        def make(name: str) -> None:
            self._chosen = name
            shares.make(name)

        self._events = html_events.named(
            {
                "fly": integer(fly_to, "vertex", 0, len(scene.mesh.vertices) - 1),
                "lesson": press(lambda: open_lesson(LESSON_OF_PAPER)),
                "share": choice_of(make, lambda: list(titles), "file"),
                "cancel": press(shares.cancel),
                "divide": press(divide),
            }
        )

    def markup(self, state: RunState, page_state: PageState) -> str:
        """The card at the end of a finished run; empty elsewhere."""
        if not state.finished or state.moment < state.length or state.length == 0 or state.is_working:
            return ""
        known = self._residuals.of(state)
        before, after = known.by_moment.get(0), known.by_moment.get(state.length)
        if known.why_not or before is None or after is None:
            line = f"Not measured: {known.why_not}" if known.why_not else "Measuring the result…"
            return f"<h4>Did it help?</h4><div class='dim'>{text(line)}</div>{self._share(state)}"
        run = next(run for run in state.runs if run.run_id == state.run_id)
        key = (run.run_id, run.length)
        report = self._report_of(run.run_id)
        self._facts.request(key, lambda: result_facts(self._scene, run, before, after, report))
        facts = self._facts.result_for(key)
        if not isinstance(facts, ResultFacts):
            line = "Measuring the result…" if facts is None else str(facts)
            return f"<h4>Did it help?</h4><div class='dim'>{text(line)}</div>{self._share(state)}"
        return (
            f"<h4>Did it help?</h4>{self._verdict(facts)}{_figures(facts)}{self._paper(facts)}"
            f"{self._compare(page_state)}{self._worst(facts)}{self._share(state)}"
        )

    def _verdict(self, facts: ResultFacts) -> str:
        before, after = facts.residual
        percent = 100 * (after / before - 1) if before > 0 else 0.0
        change = f"the residual is {number(abs(percent), 3)} % {'lower' if percent < 0 else 'higher'} than at the start"
        if not facts.helped:
            return f"<div class='big selected'>Hardly: {change}.</div>"
        if facts.objection:
            return f"<div class='big selected'>Not surely: {change}, but {text(facts.objection)}.</div>"
        return f"<div class='big start'>Yes: {change}.</div>"

    def _paper(self, facts: ResultFacts) -> str:
        """Why the preset `paper` ends far from the truth, where it does."""
        if not facts.is_paper or (facts.error is not None and facts.error[1] < 0.5 * facts.error[0]):
            return ""
        lesson = button(
            "Lesson: the number of dimensions k", self._events("lesson"), hint="Open this lesson", css_class="link"
        )
        return (
            "<p class='dim'>The preset <b>paper</b> holds the eigenspace fixed while it computes a step, and five dimensions "
            "absorb most of a misalignment: its steps are 10 to 200 times too short. With an affine warp the minimum itself is "
            "displaced. "
            f"{lesson}</p>"
        )

    def _compare(self, page_state: PageState) -> str:
        """A button for the divider between the start and now."""
        hint = "Start and current moment, with a divider to drag"
        return f"<div class='row chips'>{chip('Before and now', self._events('divide'), hint, page_state.shows_divider)}</div>"

    def _worst(self, facts: ResultFacts) -> str:
        if not facts.worst:
            return ""
        chips = "".join(
            chip(
                f"{vertex} · {number(residual, 3)}",
                self._events("fly", vertex),
                f"Fly to vertex {vertex}: residual {number(residual, 3)} grey levels around it",
                is_on=False,
            )
            for vertex, residual in facts.worst
        )
        return (
            f"<h4>Where the photos agree least</h4><div class='row chips'>{chips}</div>"
            "<div class='dim'>Vertex and residual around it, grey levels. A click flies there.</div>"
        )

    def _share(self, state: RunState) -> str:
        """Buttons that make files of the run, and the command line of the one chosen last."""
        shares = self._shares
        chips = "".join(
            chip(
                title,
                self._events("share", n),
                f"Make this file and download it: {title.lower()}",
                name == self._chosen,
            )
            for n, (name, title) in enumerate(self._titles.items())
        )
        progress = ""
        if shares.kind is not None:
            left = "" if shares.left is None else f", {shares.left:.0f} s left"
            cancel = button("Cancel", self._events("cancel"), hint="Cancel the export", css_class="small")
            done = 100 * shares.fraction
            progress = (
                f"<div class='row'><span class='grow working'>Making the {text(self._titles[shares.kind].lower())}: "
                f"{done:.0f} %{left}</span>{cancel}</div>"
                f"<div class='bar work' role='progressbar' aria-label='Export' aria-valuenow='{done:.0f}'>"
                f"<div style='width:{done:.1f}%'></div></div>"
            )
        command = shares.command(self._chosen, state)
        copy = copy_button(command, "Copy the command")
        return (
            f"<h4>Share</h4><div class='row chips'>{chips}</div>{progress}"
            f"<div class='dim'>Without the page:</div><div class='row'><code class='grow'>{text(command)}</code>{copy}</div>"
        )


def _title(row: str) -> str:
    """The tooltip of a row as an attribute; empty without one."""
    return f' title="{text(HINTS[row])}"' if row in HINTS else ""


def _figures(facts: ResultFacts) -> str:
    """The table of figures before and after."""
    rows = [("Residual at the finest level, grey levels", *(number(value, 4) for value in facts.residual))]
    if facts.held_out is not None:
        held_out = facts.held_out
        medians = (number(float(np.median(each.percent)), 3) for each in (held_out.before, held_out.after))
        counts = f"{len(held_out.after.values)} held-out points on the surface, median distance, %"
        rows.append((counts, *medians))
    if facts.error is not None:
        rows.append((DISTANCE, *(number(value, 3) for value in facts.error)))
    if facts.left_out is not None:
        before, after, photos = facts.left_out
        rows.append((f"{photos} left-out photos, PSNR, dB", f"{before:.2f}", f"{after:.2f}"))
    body = "".join(
        f"<tr{_title(name)}><td>{text(name)}</td><td class='n'>{before}</td><td class='n'><b>{after}</b></td></tr>"
        for name, before, after in rows
    )
    moved = facts.moved > 0
    median = number(float(np.median(facts.moved[moved])), 3) if moved.any() else "0"
    most = number(float(facts.moved.max()), 3)
    cameras = ""
    if facts.corrections is not None:
        cameras = (
            f"<div>Cameras corrected by {number(float(np.median(facts.corrections)), 2)} px (median), at most "
            f"{number(float(facts.corrections.max()), 2)} px.</div>"
        )
    return (
        f"<table class='photos result'><tr><th></th><th class='n'>before</th><th class='n'>after</th></tr>{body}</table>"
        f"<div>{int(moved.sum())} of {len(moved)} vertices moved: median {median} % of the diagonal, at most {most} %."
        f"</div>{cameras}"
    )

"""Experiments panel: chooses and starts an experiment on the current scene, shows its charts, downloads its results."""

import viser

from app.debugger.controller import Controller
from app.debugger.run_state import RunState
from app.experiments.chart import charts_of
from app.experiments.experiment_runner import ExperimentRunner, Outcome, Status
from app.html import button, icon, text
from app.page_state.page_state import PageState
from app.panels.chart_svg import charts_svg
from app.panels.choice import chip
from app.viser_bridge.error_toasts import NothingToDo
from app.viser_bridge.html_events import HtmlEvents, choice_of, press
from app.viser_bridge.html_panel import HtmlPanel
from fairing.experiments import experiments
from fairing.options import PRESETS, FairingOptions


class ExperimentsPanel:
    """Shows the experiment chosen in one browser. Results are shared by all browsers."""

    def __init__(
        self,
        client: viser.ClientHandle,
        html_events: HtmlEvents,
        runner: ExperimentRunner,
        controller: Controller,
        page_state: PageState,
    ) -> None:
        self._client, self._runner, self._controller, self._page_state = client, runner, controller, page_state
        self._events = html_events.named(
            {
                "choose": choice_of(self.choose, lambda: list(experiments()), "experiment"),
                "start": press(self._begin),
                "cancel": press(runner.cancel),
                "csv": press(self._download_csv),
                "png": press(self._download_png),
            }
        )
        self._obstacle = runner.obstacle()
        self._panel = HtmlPanel(client.gui)
        self._shown: object = None

    def choose(self, name: str) -> None:
        """Show the experiment of this name."""
        self._page_state.experiment = name
        self._controller.republish()

    def _begin(self) -> None:
        experiment = experiments()[self._page_state.experiment]()
        self._runner.start(experiment, self._controller.state.options, self._page_state.selected)

    def _download_csv(self) -> None:
        outcome, record = self._measured()
        self._client.send_file_download(f"{record.stem}.csv", record.csv(outcome.rows), save_immediately=True)

    def _download_png(self) -> None:
        outcome, record = self._measured()
        self._client.send_file_download(f"{record.stem}.png", record.png(outcome.rows), save_immediately=True)

    def _measured(self):
        outcome = self._runner.outcome(self._page_state.experiment)
        if outcome is None or outcome.record is None or not outcome.rows:
            raise NothingToDo("nothing has been measured yet; start the experiment first")
        return outcome, outcome.record

    def show(self, state: RunState, page_state: PageState) -> None:
        outcome = self._runner.outcome(page_state.experiment)
        key = (page_state.experiment, outcome, self._runner.working, page_state.selected, state.options)
        if key == self._shown:
            return
        self._shown = key
        results = "" if outcome is None else _progress(outcome) + self._findings(outcome)
        self._panel.set(self._choices(page_state) + self._start(state, page_state, outcome) + results)

    def _choices(self, page_state: PageState) -> str:
        chips = "".join(
            chip(experiment.title, self._events("choose", n), experiment.question, name == page_state.experiment)
            for n, (name, experiment) in enumerate(experiments().items())
        )
        return f"<div class='row chips'>{chips}</div><div>{text(experiments()[page_state.experiment].question)}</div>"

    def _start(self, state: RunState, page_state: PageState, outcome: Outcome | None) -> str:
        if self._obstacle:
            return f"<div class='note dim'>{text(self._obstacle)}.</div>"
        working = self._runner.working
        if working is not None and working != page_state.experiment:
            title = text(experiments()[working].title)
            return f"<div class='note dim'>{title} is running; only one experiment runs at a time.</div>"
        if working is not None and outcome is not None:
            cancel = button("Cancel", self._events("cancel"), hint="Cancel (finished runs are kept)", css_class="main")
            return f"<div class='row note'>{cancel}<span class='dim'>Finished runs are kept.</span></div>"
        which = (
            "the vertex with the best coverage"
            if page_state.selected is None
            else f"vertex {page_state.selected}, which is selected"
        )
        start = button("Start", self._events("start"), hint="Start the experiment", icon=icon("run"), css_class="main")
        return (
            f"<div class='row note'>{start}<span class='dim'>Uses {which}, and {_preset_of(state.options)}. "
            "The run does not change.</span></div>"
        )

    def _findings(self, outcome: Outcome) -> str:
        if outcome.status is Status.FAILED:
            return f"<div class='rejected'>{text(outcome.problem)}</div>"
        if outcome.record is None or not outcome.rows:
            return ""
        finding = outcome.experiment.finding(outcome.record.in_order(outcome.rows))
        count = f"{len(outcome.rows)} of {len(outcome.record.cases)} runs"
        progress = {
            Status.WORKING: f"{count} so far", Status.DONE: f"{count}, {_duration(outcome.seconds)}",
            Status.CANCELLED: f"cancelled after {count}",
        }[outcome.status]  # fmt: skip
        csv = button("CSV", self._events("csv"), hint="Download the table", css_class="small")
        png = button("PNG", self._events("png"), hint="Download the picture", css_class="small")
        about = f"vertex {outcome.setting.vertex}, {_preset_of(outcome.setting.options)}"
        charts = charts_svg(charts_of(outcome.experiment, outcome.record.cases, outcome.rows))
        return (
            f"{charts}<div class='note'>{text(finding)}</div>"
            f"<div class='row note'><span class='dim grow'>{text(about)}; {text(progress)}</span>{csv}{png}</div>"
        )


def _progress(outcome: Outcome) -> str:
    if outcome.status is not Status.WORKING:
        return ""
    done, total = len(outcome.rows), len(outcome.record.cases) if outcome.record is not None else 0
    left = "" if outcome.left is None else f", about {_duration(outcome.left)} left"
    line = f"{done} of {total} runs{left}" if total else "preparing"
    share = 100 * done / max(total, 1)
    return f"<div class='note'>{line}</div><div class='bar'><div style='width:{share:.1f}%'></div></div>"


def _preset_of(options: FairingOptions) -> str:
    """The preset with these options; other options are those of the current run."""
    for name, preset in PRESETS.items():
        if options == preset:
            return f"the preset {name}"
    return "the options of the current run"


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"

"""Loading a scene and opening a run with a progress bar."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from rich.console import Console

from app.cli.progress_bar import progress_bar
from app.files.scene_source import SceneSource
from app.html import duration
from fairing.options import FairingOptions
from fairing.scene import Scene

if TYPE_CHECKING:
    from fairing.run.session import Session
    from fairing.trace import Trace

ShowProgress = Callable[[str, float | None], None]
"""Called with a line and the finished fraction, 0 to 1, or None."""
SHOW_EVERY = 0.25  # seconds between lines
SKIPPABLE = ("finding points", "refining cameras")  # lines of progress begin with one of them while a skip is possible


@dataclass(frozen=True)
class OpeningProgress:
    """What is shown of the opening of a scene, and what the user requests meanwhile.

    Attributes:
        show: shows progress.
        skip_points: whether not to look for points in the photos.
    """

    show: ShowProgress = lambda line, fraction: None
    skip_points: Callable[[], bool] = lambda: False


_Loaded = TypeVar("_Loaded")


def load_with_progress(source: SceneSource, console: Console) -> Scene:
    """The scene of a source. The bar shows rendering of a demo's photos, and finding and triangulation of points without a mesh."""
    return load_with_bar(source.scene, source.load, console)


def load_with_points(source: SceneSource, console: Console) -> Scene:
    """The scene of a source with the cameras and sparse points that a run of it has. The bar also shows how they are found."""
    # Imported on first use: the page is served before the engine is loaded.
    from fairing.io.chosen_inputs import with_chosen_inputs

    return load_with_bar(
        source.scene, lambda progress: with_chosen_inputs(source.load(progress), on_progress=progress), console
    )


def open_session(
    source: SceneSource,
    console: Console,
    options: FairingOptions | None = None,
    trace: "Trace | None" = None,
    opening: OpeningProgress | None = None,
    load: Callable[[Callable[[float, str], None]], Scene] | None = None,
    own: Sequence[Path] = (),
) -> "Session":
    """A session on the scene of a source, with its cameras and sparse points. The bar shows what `load_with_points` does.

    Args:
        options, trace: of the run, see `Session`.
        opening: what is shown of it elsewhere.
        load: loads the scene; default: that of the source.
        own: files with code of one's own, see `load_own`.

    Raises:
        InputError: the scene, an option or the trace cannot be used.
    """
    opening = opening or OpeningProgress()
    load = load or partial(source.load, skip_points=opening.skip_points)

    def opened(progress: Callable[[float, str], None]) -> "Session":
        # Imported on first use: the page is served before the engine is loaded.
        from fairing.run.own_files import load_own
        from fairing.run.session import Session

        mine = load_own(own)  # before photos are read: a mistake there is told at once
        session = Session(
            load(progress), options, trace, terms=mine.terms, norm=mine.norm, plan=mine.plan, plan_file=mine.plan_file
        )
        session.choose_inputs(progress, opening.skip_points)
        return session

    return load_with_bar(source.scene, opened, console, opening.show)


def load_with_bar(
    name: str,
    load: Callable[[Callable[[float, str], None]], _Loaded],
    console: Console,
    show: ShowProgress = lambda line, fraction: None,
) -> _Loaded:
    """The result of `load`, which receives a callback (fraction done, line) that moves the bar.

    Ctrl-C raises KeyboardInterrupt.

    Args:
        show: called with the line and the remaining time, a few times a second.
    """
    with progress_bar(console) as bar:
        task, due = bar.add_task(f"opening {name}", total=1.0), 0.0

        def on_progress(fraction: float, line: str) -> None:
            nonlocal due
            if bar.tasks[0].finished and fraction < 1:  # another piece of work, which takes its own time
                bar.reset(task)
            bar.update(task, completed=fraction, description=line)
            if time.monotonic() < due:
                return
            due = time.monotonic() + SHOW_EVERY
            left = bar.tasks[0].time_remaining
            show(line if left is None or fraction == 0 else f"{line}; {duration(left)} left", fraction)

        return load(on_progress)
